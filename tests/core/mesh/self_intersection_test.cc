#include "core/mesh/self_intersection.h"

#include <array>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/mesh/side.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using Corners = std::array<Vec3, 3>;

auto Find(const Shape& shape) {
  return FindSelfIntersection(shape.positions, shape.faces);
}

// The interval of `along` in which the triangle meets the plane through
// `origin`; its length is negative if it does not.
struct Interval {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  double length() const { return high - low; }
};

Interval Meet(const Corners& t, const Vec3& origin, const Vec3& normal,
              const Vec3& along) {
  Interval interval;
  for (int k = 0; k < 3; ++k) {
    const Vec3& a = t[k];
    const Vec3& b = t[(k + 1) % 3];
    const double from = normal.dot(a - origin);
    const double to = normal.dot(b - origin);
    if ((from > 0) == (to > 0)) continue;
    const double at = along.dot(a + from / (from - to) * (b - a));
    interval.low = std::min(interval.low, at);
    interval.high = std::max(interval.high, at);
  }
  return interval;
}

// By how much two triangles overlap along the common line of their planes; at
// most 0 if they do not cross.
double Overlap(const Corners& a, const Corners& b) {
  const Vec3 na = (a[1] - a[0]).cross(a[2] - a[0]).normalized();
  const Vec3 nb = (b[1] - b[0]).cross(b[2] - b[0]).normalized();
  const Vec3 along = na.cross(nb).normalized();
  const Interval of_a = Meet(a, b[0], nb, along);
  const Interval of_b = Meet(b, a[0], na, along);
  return std::min(of_a.high, of_b.high) - std::max(of_a.low, of_b.low);
}

Shape TwoTriangles(const Corners& a, const Corners& b) {
  Shape shape{Positions(6, 3), Faces(2, 3)};
  for (int k = 0; k < 3; ++k) {
    shape.positions.row(k) = a[k];
    shape.positions.row(3 + k) = b[k];
  }
  shape.faces << 0, 1, 2, 3, 4, 5;
  return shape;
}

class RandomTriangles {
 public:
  Corners Next() { return {Point(), Point(), Point()}; }

 private:
  Vec3 Point() {
    return {coordinate_(random_), coordinate_(random_), coordinate_(random_)};
  }

  std::mt19937 random_{7};
  std::uniform_real_distribution<double> coordinate_{-1, 1};
};

// Within this of touching, the plain computation cannot tell.
constexpr double kUndecided = 1e-9;

TEST(FindSelfIntersection, AgreesWithThePlainIntervalsOfTwoTriangles) {
  RandomTriangles triangles;
  int crossing = 0;
  for (int i = 0; i < 20000; ++i) {
    const Corners a = triangles.Next();
    const Corners b = triangles.Next();
    const double overlap = Overlap(a, b);
    if (std::abs(overlap) < kUndecided) continue;
    ASSERT_EQ(Find(TwoTriangles(a, b)).has_value(), overlap > 0) << i;
    crossing += overlap > 0;
  }
  EXPECT_GT(crossing, 2000);
  EXPECT_LT(crossing, 18000);
}

TEST(FindSelfIntersection, AgreesWithThemWhereTheTrianglesShareAVertex) {
  RandomTriangles triangles;
  int crossing = 0;
  for (int i = 0; i < 20000; ++i) {
    const Corners a = triangles.Next();
    Corners b = triangles.Next();
    const int at_a = i % 3;
    const int at_b = i / 3 % 3;
    b[at_b] = a[at_a];
    // Where they leave the vertex in opposite directions they only touch.
    const double overlap = Overlap(a, b);
    Shape shape = TwoTriangles(a, b);
    shape.faces(1, at_b) = at_a;
    if (std::abs(overlap) < kUndecided) {
      ASSERT_FALSE(Find(shape)) << i;
      continue;
    }
    ASSERT_EQ(Find(shape).has_value(), overlap > 0) << i;
    crossing += overlap > 0;
  }
  EXPECT_GT(crossing, 1000);
}

TEST(FindSelfIntersection, FindsSidesThatCrossEachOther) {
  // The diagonals of the two upright squares meet in the middle.
  const Corners a = {Vec3{-1, 0, -1}, {1, 0, -1}, {1, 0, 1}};
  const Corners b = {Vec3{0, -1, -1}, {0, 1, -1}, {0, 1, 1}};
  EXPECT_TRUE(Find(TwoTriangles(a, b)));
}

TEST(FindSelfIntersection, LetsPassWhatOnlyTouches) {
  const Corners floor = {Vec3{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}};
  const Corners corner_on_it = {Vec3{0, 0, 0}, {1, 0, 1}, {0, 1, 1}};
  const Corners side_on_it = {Vec3{-0.1, 0, 0}, {0.1, 0, 0}, {0, 0, 1}};
  const Corners on_its_side = {Vec3{-2, -1, -1}, {2, -1, -1}, {0, -1, 1}};
  for (const Corners& other : {corner_on_it, side_on_it, on_its_side, floor}) {
    EXPECT_FALSE(Find(TwoTriangles(floor, other)));
    EXPECT_FALSE(Find(TwoTriangles(other, floor)));
  }
}

TEST(FindSelfIntersection, FindsFacesThatPierceEachOther) {
  const Shape box = Cuboid({0, 0, 0}, {1, 1, 1});
  EXPECT_FALSE(FindSelfIntersection(box.positions, box.faces));
  const Shape apart = Joined(box, Scaled(box, 1, {1.5, 0, 0}));
  EXPECT_FALSE(FindSelfIntersection(apart.positions, apart.faces));
  const Shape nested = Joined(box, Scaled(box, 0.5));
  EXPECT_FALSE(FindSelfIntersection(nested.positions, nested.faces));
  const Shape crossing = Joined(box, Scaled(box, 1, {0.6, 0.3, 0.2}));
  const auto pair = FindSelfIntersection(crossing.positions, crossing.faces);
  ASSERT_TRUE(pair);
  EXPECT_LT(pair->first, 12);
  EXPECT_GE(pair->second, 12);
}

TEST(FindSelfIntersection, FindsASpikeThroughAFace) {
  Shape sphere = Icosphere(1, 1);
  EXPECT_FALSE(FindSelfIntersection(sphere.positions, sphere.faces));
  sphere.positions.row(0) *= -2;
  EXPECT_TRUE(FindSelfIntersection(sphere.positions, sphere.faces));
}

TEST(FindSelfIntersection, FindsEdgesOfLoopsThatCross) {
  using Points = std::array<Eigen::Vector2d, 4>;
  EXPECT_FALSE(Find(Loop2d(Points{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}})));
  EXPECT_EQ(Find(Loop2d(Points{{{0, 0}, {1, 1}, {1, 0}, {0, 1}}})),
            (std::pair<int64_t, int64_t>(0, 2)));
  // A corner on a side only touches it.
  EXPECT_FALSE(Find(Loop2d(Points{{{0, 0}, {1, 0}, {0.5, 0}, {0, 1}}})));
}

TEST(FindSelfIntersection, KeepsToTheTruthFarAwayAndWhateverTheScale) {
  const Shape box = Cuboid({0, 0, 0}, {1, 1, 1});
  const Shape crossing = Joined(box, Scaled(box, 1, {0.6, 0.3, 0.2}));
  for (const double scale : {1e-90, 1e-6, 1e6, 1e99}) {
    Shape scaled = crossing;
    scaled.positions *= scale;
    EXPECT_TRUE(Find(scaled)) << scale;
  }
  for (const Shape& shape : {Torus(2, 0.5, 24, 16), Icosphere(1, 3)}) {
    Shape far = Scaled(shape, 1e-2);
    far.positions.rowwise() += Eigen::RowVector3d(1e6, -1e6, 1e6);
    EXPECT_FALSE(Find(far));
  }
}

TEST(SideOf, IsNoSideWhereRoundingCannotTell) {
  const Vec3 a(0.1, 0.1, 0.1), b(0.7, 0.2, 0.3), c(0.2, 0.9, 0.5);
  const Vec3 normal = (b - a).cross(c - a);
  const Vec3 inside = 0.2 * a + 0.3 * b + 0.5 * c;
  EXPECT_EQ(SideOfPlane(a, b, c, inside), 0);
  EXPECT_EQ(SideOfPlane(a, b, c, inside + 1e-12 * normal), 1);
  EXPECT_EQ(SideOfPlane(a, b, c, inside - 1e-12 * normal), -1);
  const Vec3 from(0.1, 0.1, 0), to(0.7, 0.4, 0);
  EXPECT_EQ(SideOfLine(from, to, 0.3 * from + 0.7 * to), 0);
  EXPECT_EQ(SideOfLine(from, to, {0.3, 0.3, 0}), 1);
  EXPECT_EQ(SideOfLine(from, to, {0.3, 0.1, 0}), -1);
}

}  // namespace
}  // namespace deform
