#include "client/cpp/held_weights.h"

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform {

void HeldWeights::Add(const HeldBinding& weights, const std::string& present) {
  std::erase_if(deformers_,
                [&](const auto& held) { return held.first != present; });
  deformers_[weights.binding_id] =
      std::make_unique<Deformer>(weights.binding, pool_);
}

Deformer* HeldWeights::Find(const std::string& binding_id) const {
  const auto found = deformers_.find(binding_id);
  return found == deformers_.end() ? nullptr : found->second.get();
}

absl::Status HeldWeights::Check(const HeldBinding& weights,
                                const JoinedSession& session) {
  const Binding& binding = *weights.binding;
  if (binding.dimension() == session.dimension &&
      binding.point_count() == session.point_count) {
    return absl::OkStatus();
  }
  return InvalidInput(
      "OTHER_MODEL", "weights",
      absl::StrCat("these weights are of a model with ", binding.point_count(),
                   " points in ", binding.dimension(), "D, the session's has ",
                   session.point_count, " in ", session.dimension, "D"));
}

}  // namespace deform
