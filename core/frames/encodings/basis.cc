#include "core/frames/encodings/basis.h"

#include <cmath>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/frames/basis_payload.h"
#include "core/frames/encodings/one_chunk.h"
#include "core/frames/leaf_pose.h"

namespace deform {
namespace {

class BasisFrames final : public FrameEncoding {
 public:
  absl::string_view id() const override { return "basis"; }
  Needs needs() const override { return Needs::kBasis; }
  // Sums of floats carry 24 bits, and some of these are for rounding.
  double FinestTolerance(double reach) const override {
    return std::ldexp(reach, -20);
  }

  int64_t PointsPerChunk(int /*dimension*/) const override {
    return std::numeric_limits<int32_t>::max();
  }

  absl::StatusOr<int64_t> Encode(const ChunkSource& source,
                                 uint8_t* out) const override {
    if (source.basis == nullptr) {
      return MakeError(absl::StatusCode::kFailedPrecondition,
                       "the weights are dense: they have no leaf bases",
                       {.reason = "NO_BASIS"});
    }
    DEFORM_ASSIGN_OR_RETURN(
        const std::vector<uint8_t> bytes,
        EncodeLeafPose(LeafPoseOf(*source.deformer), *source.basis,
                       source.tolerance, source.pool));
    return PutInOneChunk("a frame of leaf coefficients", bytes, out);
  }

  absl::Status Decode(std::span<const uint8_t> bytes,
                      const ChunkTarget& target) const override {
    if (target.basis == nullptr) {
      return BadFrameData(
          "leaf coefficients have come, but no basis is held for them");
    }
    if (target.first != 0 || target.count != target.basis->point_count()) {
      return BadFrameData(absl::StrCat(
          "leaf coefficients are cut: vertices from ", target.first, " on, ",
          target.count, " of ", target.basis->point_count()));
    }
    DEFORM_ASSIGN_OR_RETURN(const LeafPose pose,
                            DecodeLeafPose(bytes, *target.basis));
    return PlacePoints(pose, *target.basis, target.origin, target.pool,
                       target.positions);
  }
};

}  // namespace

const FrameEncoding& BasisEncoding() {
  static const BasisFrames encoding;
  return encoding;
}

}  // namespace deform
