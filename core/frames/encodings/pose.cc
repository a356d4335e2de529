#include "core/frames/encodings/pose.h"

#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/deform/deformer.h"
#include "core/frames/encodings/one_chunk.h"
#include "core/frames/pose_payload.h"

namespace deform {
namespace {

class PoseFrames final : public FrameEncoding {
 public:
  absl::string_view id() const override { return "pose"; }
  // The pose is; how exact the vertices are is up to the receiver's weights.
  bool is_exact() const override { return true; }
  Needs needs() const override { return Needs::kWeights; }
  bool refers() const override { return true; }
  double FinestTolerance(double /*reach*/) const override { return 0; }

  int64_t PointsPerChunk(int /*dimension*/) const override {
    return std::numeric_limits<int32_t>::max();
  }

  absl::StatusOr<int64_t> Encode(const ChunkSource& source,
                                 uint8_t* out) const override {
    const std::vector<uint8_t> bytes =
        EncodePose(source.deformer->pose(), source.reference_pose,
                   ShapeOf(source.deformer->binding().rig()));
    return PutInOneChunk("a pose", bytes, out);
  }

  absl::Status Decode(std::span<const uint8_t> bytes,
                      const ChunkTarget& target) const override {
    if (target.deformer == nullptr) {
      return BadFrameData("a pose has come, but no weights are held for it");
    }
    Deformer& deformer = *target.deformer;
    const PoseShape shape = ShapeOf(deformer.binding().rig());
    const absl::StatusOr<PoseUpdate> update = DecodePose(bytes, shape);
    if (!update.ok()) return BadFrameData(update.status().message());
    if (target.reference_pose == nullptr &&
        update->positions.rows() != shape.rows) {
      return BadFrameData(absl::StrCat("a keyframe tells ",
                                       update->positions.rows(), " of the ",
                                       shape.rows, " rows of a pose"));
    }
    Pose pose = target.reference_pose != nullptr ? *target.reference_pose
                                                 : deformer.pose();
    ApplyPoseUpdate(*update, pose);
    const DeformReport report = deformer.MoveTo(pose);
    if (target.error_bound != nullptr) {
      *target.error_bound = report.error_bound;
    }
    deformer.CopyRelative(target.first, target.count, target.origin,
                          target.positions.data());
    return absl::OkStatus();
  }
};

}  // namespace

const FrameEncoding& PoseEncoding() {
  static const PoseFrames encoding;
  return encoding;
}

}  // namespace deform
