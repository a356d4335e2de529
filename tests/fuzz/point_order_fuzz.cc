// Orders of points as they come from outside: a permutation or
// BAD_POINT_ORDER.
//
// Input: how many points there are, one byte; then the order.
#include <algorithm>

#include "core/base/error.h"
#include "core/frames/point_order.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  const auto order =
      deform::PointOrder::FromBytes({data + 1, size - 1}, data[0]);
  if (!order.ok()) {
    FUZZ_EXPECT(deform::DetailOf(order.status()).reason == "BAD_POINT_ORDER");
    return 0;
  }
  std::vector<int32_t> sorted = order->points();
  std::sort(sorted.begin(), sorted.end());
  for (int32_t i = 0; i < data[0]; ++i) FUZZ_EXPECT(sorted[i] == i);
  const std::vector<uint8_t> bytes = order->ToBytes();
  FUZZ_EXPECT(std::equal(bytes.begin(), bytes.end(), data + 1, data + size));
  return 0;
}
