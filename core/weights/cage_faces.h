// The faces of a cage one by one: planes, barycentrics, nearest points.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/mesh/cage.h"
#include "core/mesh/types.h"

namespace deform {

// Precomputed geometry of triangles (3D) or directed segments (2D). Immutable.
//
// All methods take differences of the inputs first, which is exact for close
// points, so that a cage far from the origin loses nothing.
class CageFaces {
 public:
  // A face seen from outside: corners counter-clockwise, n unit and outward.
  // Edge q lies opposite corner q; m_q is its unit outward normal within the
  // plane. In 2D corner 0 is the start; m_0 points from start to end.
  struct Face {
    int32_t corner[3];  // 2D: the third is not used.
    Vec3 position[3];
    Vec3 normal;
    Vec3 m[3];
    double height[3];  // Of corner q above edge q. 2D: the length, twice.
    Vec3 center;       // Of a ball around the face, relative to corner 0.
    double radius;
  };
  struct Nearest {
    int64_t face = -1;
    double distance = std::numeric_limits<double>::infinity();
    Vec3 barycentric = Vec3::Zero();  // Of the closest point; 2D: third is 0.
  };

  explicit CageFaces(const Cage& cage);

  // Corners of a face, 2 or 3.
  int corners() const { return corners_; }
  int64_t size() const { return static_cast<int64_t>(faces_.size()); }
  const Face& operator[](int64_t f) const { return faces_[f]; }

  // Signed distance from the plane of face f, positive outside.
  double Height(int64_t f, const Vec3& x) const;
  // Barycentrics of the projection of x onto the plane of face f.
  Vec3 Barycentric(int64_t f, const Vec3& x) const;
  // Closest point of face f.
  Nearest NearestOn(int64_t f, const Vec3& x) const;
  // Closest point of the faces whose entry in `allowed` is not 0 (empty: of
  // all faces); of several the face with the lowest index.
  Nearest NearestOf(const Vec3& x, std::span<const char> allowed = {}) const;
  // Closest point of all faces if it is nearer than `distance`; else face -1
  // and that distance. The smaller it is, the fewer faces are looked at.
  Nearest NearestWithin(const Vec3& x, double distance) const;

 private:
  // False only if face f is farther from x than `distance`.
  bool MayBeWithin(double distance, int64_t f, const Vec3& x) const;

  int corners_;
  std::vector<Face> faces_;
};

}  // namespace deform
