#include "client/cpp/held_weights.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform {
namespace {

// `what` is of a model like this.
absl::Status CheckModel(absl::string_view what, int dimension, int64_t points,
                        const JoinedSession& session) {
  if (dimension == session.dimension && points == session.point_count) {
    return absl::OkStatus();
  }
  return InvalidInput(
      "OTHER_MODEL", what,
      absl::StrCat("this ", what, " is of a model with ", points, " points in ",
                   dimension, "D, the session's has ", session.point_count,
                   " in ", session.dimension, "D"));
}

}  // namespace

void HeldWeights::Add(const HeldBinding& weights, const std::string& present) {
  std::erase_if(deformers_,
                [&](const auto& held) { return held.first != present; });
  deformers_[weights.binding_id] =
      std::make_unique<Deformer>(weights.binding, pool_);
}

void HeldWeights::Add(HeldBasis basis) {
  std::erase_if(bases_, [&](const HeldBasis& held) {
    return held.basis_id == basis.basis_id;
  });
  if (bases_.size() == 2) bases_.erase(bases_.begin());
  bases_.push_back(std::move(basis));
}

Deformer* HeldWeights::Find(const std::string& binding_id) const {
  const auto found = deformers_.find(binding_id);
  return found == deformers_.end() ? nullptr : found->second.get();
}

const LeafBasis* HeldWeights::FindBasis(const std::string& basis_id) const {
  for (const HeldBasis& held : bases_) {
    if (held.basis_id == basis_id) return held.basis.get();
  }
  return nullptr;
}

absl::Status HeldWeights::Check(const HeldBinding& weights,
                                const JoinedSession& session) {
  return CheckModel("binding", weights.binding->dimension(),
                    weights.binding->point_count(), session);
}

absl::Status HeldWeights::Check(const HeldBasis& basis,
                                const JoinedSession& session) {
  return CheckModel("basis", basis.basis->dimension(),
                    basis.basis->point_count(), session);
}

}  // namespace deform
