// Celestial coordinates of points among free handles: T-CC and S-CC.
//
// Source: [C16] Cervero, Vinacua, Brunet, "3D Model Deformations with Arbitrary
//   Control Points", sections 4 and 5.
// Departs: both are solved as one convex problem (celestial_potential.h) by
//   damped Newton from 0 or a neighbour's solution, instead of the paper's
//   undamped one, which fails on up to a third of the points among skew handles
//   and nearly all of them next to the hull. lambda cancels.
// Precision: partition of unity and reproduction of the point to 1e-15 D; next
//   to the hull, at e D, the single weights of S-CC to 1e-15 / sqrt(e).
// Cost: 4 to 6 steps of O(n) a point inside, 20 at 1e-6 D from the hull.
#include <cmath>
#include <memory>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/weights/scheme.h"
#include "core/weights/schemes/celestial_evaluator.h"

namespace deform {
namespace {

// Beyond it products with exponents overflow; no one means so much.
constexpr double kMaxHandleWeight = 1e12;

absl::Status CheckHandleWeights(const std::vector<double>& s, int64_t handles) {
  if (s.empty()) return absl::OkStatus();
  if (std::ssize(s) != handles) {
    return InvalidInput(
        "INVALID_OPTION", "options.handle_weights",
        absl::StrCat("there are ", s.size(), " handle weights for ", handles,
                     " handles; give one for each or none"));
  }
  for (int64_t i = 0; i < handles; ++i) {
    if (!(s[i] >= 0)) {
      return InvalidInput("INVALID_OPTION", "options.handle_weights",
                          absl::StrCat("handle weight ", i, " is ", s[i],
                                       "; it must be at least 0"));
    }
    if (!(s[i] <= kMaxHandleWeight)) {
      return InvalidInput(
          "INVALID_OPTION", "options.handle_weights",
          absl::StrCat("handle weight ", i, " is ", s[i],
                       "; it must be at most ", kMaxHandleWeight));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<const Handles*> HandlesOf(const Rig& rig, absl::string_view id) {
  const auto* handles = std::get_if<Handles>(&rig);
  if (handles == nullptr) {
    return InvalidInput(
        "WRONG_RIG", "rig",
        absl::StrCat("scheme ", id, " needs handles, but the rig is a cage"));
  }
  return handles;
}

class TranslationScheme final : public CoordinateScheme {
 public:
  absl::string_view id() const override { return "t_cc"; }
  absl::string_view description() const override {
    return "Celestial coordinates by translation: free handles, each with a "
           "weight of its own";
  }
  RigKind rig_kind() const override { return RigKind::kHandles; }
  bool uses_normals() const override { return false; }

  absl::StatusOr<std::unique_ptr<const WeightEvaluator>> Prepare(
      const Rig& rig, const SchemeOptions& options) const override {
    DEFORM_ASSIGN_OR_RETURN(const Handles* handles, HandlesOf(rig, id()));
    if (options.lambda != 0) {
      return InvalidInput("INVALID_OPTION", "options.lambda",
                          "scheme t_cc has no lambda; it belongs to s_cc");
    }
    DEFORM_RETURN_IF_ERROR(
        CheckHandleWeights(options.handle_weights, handles->free_count()));
    return MakeCelestialEvaluator(CelestialKind::kTranslation, *handles,
                                  options.handle_weights);
  }
};

class ScalingScheme final : public CoordinateScheme {
 public:
  absl::string_view id() const override { return "s_cc"; }
  absl::string_view description() const override {
    return "Celestial coordinates by scaling: free handles, nothing to choose";
  }
  RigKind rig_kind() const override { return RigKind::kHandles; }
  bool uses_normals() const override { return false; }

  absl::StatusOr<std::unique_ptr<const WeightEvaluator>> Prepare(
      const Rig& rig, const SchemeOptions& options) const override {
    DEFORM_ASSIGN_OR_RETURN(const Handles* handles, HandlesOf(rig, id()));
    if (!options.handle_weights.empty()) {
      return InvalidInput("INVALID_OPTION", "options.handle_weights",
                          "scheme s_cc has no handle weights; they belong to "
                          "t_cc");
    }
    if (options.lambda != 0 &&
        !(options.lambda > 1 && std::isfinite(options.lambda))) {
      return InvalidInput("INVALID_OPTION", "options.lambda",
                          absl::StrCat("lambda is ", options.lambda,
                                       "; it must be above 1, or 0 for the "
                                       "default (it does not change weights)"));
    }
    return MakeCelestialEvaluator(CelestialKind::kScaling, *handles, {});
  }
};

}  // namespace

const CoordinateScheme& TranslationCelestialScheme() {
  static const TranslationScheme scheme;
  return scheme;
}

const CoordinateScheme& ScalingCelestialScheme() {
  static const ScalingScheme scheme;
  return scheme;
}

}  // namespace deform
