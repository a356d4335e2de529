#include "core/files/polygons.h"

#include <algorithm>
#include <limits>

#include <Eigen/Geometry>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform {
namespace {

using Corners = std::vector<int32_t>;

// Normal of the polygon, of length twice its area ([Newell]: the sum of the
// cross products of its sides), about its first corner.
Vec3 NewellNormal(const Positions& positions,
                  std::span<const int32_t> polygon) {
  const Vec3 origin = positions.row(polygon[0]);
  Vec3 sum = Vec3::Zero();
  for (size_t i = 1; i + 1 < polygon.size(); ++i) {
    const Vec3 a = positions.row(polygon[i]).transpose() - origin;
    const Vec3 b = positions.row(polygon[i + 1]).transpose() - origin;
    sum += a.cross(b);
  }
  return sum;
}

void Add(Corners& triangles, int32_t a, int32_t b, int32_t c) {
  triangles.insert(triangles.end(), {a, b, c});
}

void SplitQuad(const Positions& positions, std::span<const int32_t> q,
               Corners& triangles) {
  const Vec3 normal = NewellNormal(positions, q);
  const auto agrees = [&](int a, int b, int c) {
    const int32_t corners[] = {q[a], q[b], q[c]};
    return NewellNormal(positions, corners).dot(normal) > 0;
  };
  const auto length = [&](int a, int b) {
    return (positions.row(q[a]) - positions.row(q[b])).squaredNorm();
  };
  const bool ac = agrees(0, 1, 2) && agrees(0, 2, 3);
  const bool bd = agrees(0, 1, 3) && agrees(1, 2, 3);
  const bool take_ac = ac != bd ? ac : length(0, 2) <= length(1, 3);
  if (take_ac) {
    Add(triangles, q[0], q[1], q[2]);
    Add(triangles, q[0], q[2], q[3]);
  } else {
    Add(triangles, q[0], q[1], q[3]);
    Add(triangles, q[1], q[2], q[3]);
  }
}

// Clips ears of one polygon, seen along an axis from the side where it runs
// counter-clockwise.
class EarClipper {
 public:
  EarClipper(const Positions& positions, std::span<const int32_t> polygon)
      : positions_(positions), left_(polygon.begin(), polygon.end()) {
    const Vec3 normal = NewellNormal(positions, polygon);
    int axis = 0;
    normal.cwiseAbs().maxCoeff(&axis);
    u_ = (axis + 1) % 3;
    v_ = (axis + 2) % 3;
    if (normal[axis] < 0) std::swap(u_, v_);
  }

  void Clip(Corners& triangles) {
    while (left_.size() >= 3) {
      const size_t ear = FindEar();
      Add(triangles, left_[Before(ear)], left_[ear], left_[After(ear)]);
      left_.erase(left_.begin() + static_cast<std::ptrdiff_t>(ear));
    }
  }

 private:
  size_t Before(size_t i) const { return (i == 0 ? left_.size() : i) - 1; }
  size_t After(size_t i) const { return i + 1 == left_.size() ? 0 : i + 1; }

  // Twice the signed area of a triangle as seen.
  double Area(int32_t a, int32_t b, int32_t c) const {
    const auto& p = positions_;
    return (p(b, u_) - p(a, u_)) * (p(c, v_) - p(a, v_)) -
           (p(b, v_) - p(a, v_)) * (p(c, u_) - p(a, u_));
  }

  bool HoldsNoOther(int32_t a, int32_t b, int32_t c) const {
    return std::none_of(left_.begin(), left_.end(), [&](int32_t p) {
      return p != a && p != b && p != c && Area(a, b, p) >= 0 &&
             Area(b, c, p) >= 0 && Area(c, a, p) >= 0;
    });
  }

  size_t FindEar() const {
    size_t best = 0;
    double shortest = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < left_.size(); ++i) {
      const int32_t a = left_[Before(i)];
      const int32_t b = left_[i];
      const int32_t c = left_[After(i)];
      if (!(Area(a, b, c) > 0)) continue;
      const double cut = (positions_.row(a) - positions_.row(c)).squaredNorm();
      if (cut < shortest && HoldsNoOther(a, b, c)) {
        shortest = cut;
        best = i;
      }
    }
    return best;
  }

  const Positions& positions_;
  Corners left_;
  int u_ = 0;
  int v_ = 1;
};

}  // namespace

absl::StatusOr<Faces> Triangulate(const Polygons& polygons,
                                  const Positions& positions) {
  Corners triangles;
  triangles.reserve(polygons.corners.size());
  std::span<const int32_t> rest = polygons.corners;
  for (size_t p = 0; p < polygons.sizes.size(); ++p) {
    const auto polygon = rest.first(polygons.sizes[p]);
    rest = rest.subspan(polygons.sizes[p]);
    if (polygon.size() > kMaxPolygonCorners) {
      return InvalidInput(
          "BAD_MESH_FILE", "",
          absl::StrCat("polygon ", p, " has ", polygon.size(),
                       " corners; at most ", kMaxPolygonCorners, " are read"));
    }
    if (polygon.size() == 3) {
      Add(triangles, polygon[0], polygon[1], polygon[2]);
    } else if (polygon.size() == 4) {
      SplitQuad(positions, polygon, triangles);
    } else {
      EarClipper(positions, polygon).Clip(triangles);
    }
  }
  return Faces(Eigen::Map<const Faces>(
      triangles.data(), static_cast<Eigen::Index>(triangles.size() / 3), 3));
}

}  // namespace deform
