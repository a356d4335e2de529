// Frames as a client receives them: any chunks give whole frames or BAD_FRAME.
//
// Input: dimension and number of points, one byte each; then chunks, each after
// its length in two bytes.
#include <algorithm>

#include "client/cpp/frame_assembler.h"
#include "core/base/error.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) return 0;
  const int dimension = data[0] % 2 == 0 ? 2 : 3;
  const int64_t points = data[1];
  deform::FrameAssembler assembler(*deform::FindEncoding("float32"), dimension,
                                   points);
  deform::Frame frame;
  size_t at = 2;
  while (at + 2 <= size) {
    const size_t length =
        std::min<size_t>(data[at] + 256u * data[at + 1], size - at - 2);
    deform::v1::FrameChunk chunk;
    const bool parsed =
        chunk.ParseFromArray(data + at + 2, static_cast<int>(length));
    at += 2 + length;
    if (!parsed) continue;
    const absl::StatusOr<bool> complete = assembler.Add(chunk, frame);
    if (!complete.ok()) {
      FUZZ_EXPECT(deform::DetailOf(complete.status()).reason == "BAD_FRAME");
      return 0;
    }
    if (*complete) {
      FUZZ_EXPECT(frame.point_count() == points);
      FUZZ_EXPECT(frame.DoublePositions().rows() == points);
    }
  }
  return 0;
}
