#include "core/frames/point_order.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

static_assert(std::endian::native == std::endian::little,
              "orders are copied as they lie in memory");

constexpr int kBits = 20;
constexpr double kLargest = (1 << kBits) - 1;

// The bits of `u`, two places apart.
uint64_t Spread(uint64_t u) {
  uint64_t spread = 0;
  for (int bit = 0; bit < kBits; ++bit) {
    spread |= (u >> bit & 1) << (3 * bit);
  }
  return spread;
}

absl::Status BadOrder(absl::string_view message) {
  return InvalidInput("BAD_POINT_ORDER", "point_order", message);
}

}  // namespace

PointOrder::PointOrder(const Positions& rest) : points_(rest.rows()) {
  const Box box = BoxOf(rest);
  const double side = (box.max - box.min).maxCoeff();
  const double scale = side > 0 ? kLargest / side : 0;
  std::vector<uint64_t> codes(rest.rows());
  for (int64_t i = 0; i < rest.rows(); ++i) {
    for (int d = 0; d < 3; ++d) {
      const auto u = static_cast<uint64_t>((rest(i, d) - box.min(d)) * scale);
      codes[i] |= Spread(u) << (2 - d);
    }
  }
  std::iota(points_.begin(), points_.end(), 0);
  std::sort(points_.begin(), points_.end(), [&](int32_t a, int32_t b) {
    return std::pair(codes[a], a) < std::pair(codes[b], b);
  });
}

absl::StatusOr<PointOrder> PointOrder::FromBytes(std::span<const uint8_t> bytes,
                                                 int64_t points) {
  if (bytes.size() % 4 != 0 ||
      static_cast<int64_t>(bytes.size() / 4) != points) {
    return BadOrder(absl::StrCat("the order has ", bytes.size(), " bytes, ",
                                 points, " points need ", points * 4));
  }
  std::vector<int32_t> order(points);
  if (points > 0) std::memcpy(order.data(), bytes.data(), bytes.size());
  std::vector<bool> named(points);
  for (const int32_t point : order) {
    if (point < 0 || point >= points) {
      return BadOrder(absl::StrCat("the order names point ",
                                   static_cast<uint32_t>(point), " of ",
                                   points));
    }
    if (named[point]) {
      return BadOrder(absl::StrCat("the order names point ", point, " twice"));
    }
    named[point] = true;
  }
  return PointOrder(std::move(order));
}

std::vector<uint8_t> PointOrder::ToBytes() const {
  std::vector<uint8_t> bytes(points_.size() * 4);
  if (!bytes.empty()) std::memcpy(bytes.data(), points_.data(), bytes.size());
  return bytes;
}

}  // namespace deform
