// An order of a model's points in which neighbours in space are neighbours.
//
// Encodings on a grid send points in this order. It is Morton's: coordinates of
// the rest positions are scaled to integers of 20 bits,
//
//   u_d = floor((x_d - min_d) * (1048575 / longest side of the box))
//
// in double, the bits are interleaved, x's before y's before z's from the
// highest on, and points are sorted by the result, equal ones by index.
//
// Who does not have the rest positions is sent the order, once a model: 32 bits
// a point, little-endian, the index of the point in the model.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/types.h"

namespace deform {

class PointOrder {
 public:
  // By the places of points at rest.
  explicit PointOrder(const Positions& rest);

  // As it came over the wire, for `points` points. InvalidArgument
  // BAD_POINT_ORDER unless it names each point once.
  static absl::StatusOr<PointOrder> FromBytes(std::span<const uint8_t> bytes,
                                              int64_t points);
  std::vector<uint8_t> ToBytes() const;

  // points()[i] is the index, in the model, of the i-th point.
  const std::vector<int32_t>& points() const { return points_; }
  int64_t size() const { return static_cast<int64_t>(points_.size()); }

 private:
  explicit PointOrder(std::vector<int32_t> points)
      : points_(std::move(points)) {}

  std::vector<int32_t> points_;
};

}  // namespace deform
