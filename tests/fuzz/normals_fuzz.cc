// Normals as they come from outside: unit vectors or BAD_FRAME.
//
// Input: how many there are, one byte; then two bytes each.
#include <cmath>
#include <vector>

#include "core/base/error.h"
#include "core/frames/normals.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  std::vector<float> normals(data[0] * 3);
  const absl::Status status =
      deform::DecodeNormals({data + 1, size - 1}, normals);
  if (!status.ok()) {
    FUZZ_EXPECT(deform::DetailOf(status).reason == "BAD_FRAME");
    return 0;
  }
  for (size_t i = 0; i < normals.size(); i += 3) {
    const float length = std::hypot(normals[i], normals[i + 1], normals[i + 2]);
    FUZZ_EXPECT(std::abs(length - 1) < 1e-5F);
  }
  return 0;
}
