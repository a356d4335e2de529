// Frames as a client receives them: any chunks give whole frames or BAD_FRAME.
//
// Input: dimension (lowest bit) and whether there are normals (the next), and
// the number of points, one byte each; then messages, each after its length in
// two bytes: chunks of frames, or, if the highest bit of the length is set, of
// the order of points.
#include <algorithm>

#include "client/cpp/frame_assembler.h"
#include "core/base/error.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) return 0;
  const int dimension = data[0] % 2 == 0 ? 2 : 3;
  const int64_t points = data[1];
  const bool normals = (data[0] & 2) != 0;
  deform::FrameAssembler assembler(dimension, points, normals);
  deform::Frame frame;
  size_t at = 2;
  while (at + 2 <= size) {
    const bool is_order = data[at + 1] >= 128;
    const size_t length =
        std::min<size_t>(data[at] + 256u * (data[at + 1] % 128), size - at - 2);
    const uint8_t* const message = data + at + 2;
    at += 2 + length;
    if (is_order) {
      deform::v1::PointOrderChunk order;
      if (!order.ParseFromArray(message, static_cast<int>(length))) continue;
      const absl::Status status = assembler.AddOrder(order);
      if (status.ok()) continue;
      FUZZ_EXPECT(deform::DetailOf(status).reason == "BAD_POINT_ORDER");
      return 0;
    }
    deform::v1::FrameChunk chunk;
    if (!chunk.ParseFromArray(message, static_cast<int>(length))) continue;
    const absl::StatusOr<bool> complete = assembler.Add(chunk, frame);
    if (!complete.ok()) {
      FUZZ_EXPECT(deform::DetailOf(complete.status()).reason == "BAD_FRAME");
      return 0;
    }
    if (*complete) {
      FUZZ_EXPECT(frame.point_count() == points);
      FUZZ_EXPECT(frame.normals.size() ==
                  (normals ? 3u * static_cast<size_t>(points) : 0u));
      FUZZ_EXPECT(frame.DoublePositions().rows() == points);
    }
  }
  return 0;
}
