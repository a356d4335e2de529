// Poses in frames, as they come from outside: right ones that come back to the
// same bytes, or a reason.
//
// Input: dimension and rows, one byte each; then the payload.
#include <algorithm>
#include <set>
#include <string>

#include "core/base/error.h"
#include "core/frames/pose_payload.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) return 0;
  const deform::PoseShape shape{.dimension = data[0] % 2 == 0 ? 2 : 3,
                                .rows = data[1]};
  const std::span<const uint8_t> payload(data + 2, size - 2);
  const auto update = deform::DecodePose(payload, shape);
  if (!update.ok()) {
    static const auto& reasons = *new std::set<std::string>{
        "BAD_FRAME", "NON_FINITE", "COORDINATE_TOO_LARGE",
        "STRETCH_BLEND_OUT_OF_RANGE"};
    FUZZ_EXPECT(reasons.contains(deform::DetailOf(update.status()).reason));
    return 0;
  }
  FUZZ_EXPECT(deform::CheckPoseUpdate(*update, shape).ok());
  deform::Pose pose{.vertices = deform::Positions::Zero(shape.rows, 3)};
  deform::ApplyPoseUpdate(*update, pose);
  if (payload[0] != 0) return 0;
  const std::vector<uint8_t> again = deform::EncodePose(pose, nullptr, shape);
  FUZZ_EXPECT(
      std::equal(again.begin(), again.end(), payload.begin(), payload.end()));
  return 0;
}
