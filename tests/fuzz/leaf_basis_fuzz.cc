// Leaf bases as they come from outside: right ones that come back to the same
// bytes and place points, or BAD_BASIS.
#include <algorithm>
#include <cmath>

#include "core/base/error.h"
#include "core/frames/leaf_pose.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto basis = deform::LeafBasis::FromBytes({data, size}, 1 << 20);
  if (!basis.ok()) {
    FUZZ_EXPECT(deform::DetailOf(basis.status()).reason == "BAD_BASIS");
    return 0;
  }
  const std::vector<uint8_t> bytes = (*basis)->ToBytes();
  FUZZ_EXPECT(std::equal(bytes.begin(), bytes.end(), data, data + size));
  const deform::LeafPose pose{.coefficients = std::vector<float>(
                                  (*basis)->coefficient_rows() * 3, 1.0F)};
  std::vector<float> positions((*basis)->point_count() * (*basis)->dimension());
  const absl::Status placed = deform::PlacePoints(
      pose, **basis, deform::Vec3::Zero(), nullptr, positions);
  FUZZ_EXPECT(placed.ok() || deform::DetailOf(placed).reason == "BAD_FRAME");
  FUZZ_EXPECT(!placed.ok() ||
              std::all_of(positions.begin(), positions.end(),
                          [](float x) { return std::isfinite(x); }));
  return 0;
}
