// Frames of leaf coefficients as they come from outside: finite places that
// come back when they are told again, or BAD_FRAME.
//
// Input: how many bytes a basis has, two bytes, lowest first; the basis; the
// payload.
#include <algorithm>
#include <cmath>

#include "core/base/error.h"
#include "core/frames/basis_payload.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) return 0;
  const size_t of_basis = data[0] + 256 * data[1];
  const std::span<const uint8_t> bytes(data + 2, size - 2);
  if (of_basis > bytes.size()) return 0;
  const auto basis =
      deform::LeafBasis::FromBytes(bytes.first(of_basis), 1 << 16);
  if (!basis.ok()) return 0;
  const auto pose = deform::DecodeLeafPose(bytes.subspan(of_basis), **basis);
  if (!pose.ok()) {
    FUZZ_EXPECT(deform::DetailOf(pose.status()).reason == "BAD_FRAME");
    return 0;
  }
  std::vector<float> positions((*basis)->point_count() * (*basis)->dimension());
  const auto place = [&](const deform::LeafPose& of) {
    return deform::PlacePoints(of, **basis, deform::Vec3::Zero(), nullptr,
                               positions);
  };
  if (const absl::Status placed = place(*pose); placed.ok()) {
    FUZZ_EXPECT(std::all_of(positions.begin(), positions.end(),
                            [](float x) { return std::isfinite(x); }));
  } else {
    FUZZ_EXPECT(deform::DetailOf(placed).reason == "BAD_FRAME");
  }
  const auto again = deform::EncodeLeafPose(*pose, **basis, 0, nullptr);
  if (!again.ok()) {
    FUZZ_EXPECT(deform::DetailOf(again.status()).reason == "NON_FINITE");
    return 0;
  }
  FUZZ_EXPECT(deform::DecodeLeafPose(*again, **basis)->coefficients ==
              pose->coefficients);
  const auto rounded = deform::EncodeLeafPose(*pose, **basis, 1e-3, nullptr);
  FUZZ_EXPECT(deform::DecodeLeafPose(*rounded, **basis).ok());
  return 0;
}
