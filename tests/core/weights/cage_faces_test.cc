#include "core/weights/cage_faces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "tests/support/shapes.h"

namespace deform {
namespace {

// One corner at the origin, the others at 1 on the axes.
const int64_t kSlanted = 2;

Cage CornerOfTheUnitCube() {
  Shape shape{Positions(4, 3), Faces(4, 3)};
  shape.positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  shape.faces << 0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2;
  return CageOf(shape);
}

Vec3 PointAt(const CageFaces& faces, int64_t f, const Vec3& barycentric) {
  Vec3 x = Vec3::Zero();
  for (int k = 0; k < faces.corners(); ++k) {
    x += barycentric[k] * faces[f].position[k];
  }
  return x;
}

TEST(CageFaces, HeightIsTheSignedDistanceFromThePlane) {
  const CageFaces faces(CornerOfTheUnitCube());
  EXPECT_NEAR(faces.Height(0, {5, 5, -2}), 2, 1e-15);
  EXPECT_NEAR(faces.Height(0, {5, 5, 3}), -3, 1e-15);
  EXPECT_NEAR(faces.Height(kSlanted, {1, 1, 1}), 2 / std::sqrt(3), 1e-15);
}

TEST(CageFaces, BarycentricsReproduceTheProjection) {
  const CageFaces faces(CornerOfTheUnitCube());
  const Vec3 x(0.3, -2, 5);
  for (int64_t f = 0; f < faces.size(); ++f) {
    const Vec3 lambda = faces.Barycentric(f, x);
    EXPECT_NEAR(lambda.sum(), 1, 1e-14);
    const Vec3 projected = x - faces.Height(f, x) * faces[f].normal;
    EXPECT_LT((PointAt(faces, f, lambda) - projected).norm(), 1e-14);
  }
}

TEST(CageFaces, BarycentricsReproduceTheProjectionInThePlane) {
  const CageFaces faces(CageOf(RegularLoop2d(1, 5)));
  const Vec3 x(0.3, -2, 0);
  for (int64_t f = 0; f < faces.size(); ++f) {
    const Vec3 lambda = faces.Barycentric(f, x);
    EXPECT_EQ(lambda[2], 0);
    const Vec3 projected = x - faces.Height(f, x) * faces[f].normal;
    EXPECT_LT((PointAt(faces, f, lambda) - projected).norm(), 1e-14);
  }
}

TEST(CageFaces, NearestPointIsWithinAnEdgeOrACornerBesideTheFace) {
  const CageFaces faces(CornerOfTheUnitCube());
  const CageFaces::Nearest within = faces.NearestOn(0, {0.25, 0.25, -2});
  EXPECT_EQ(within.distance, 2);
  EXPECT_LT((within.barycentric - Vec3(0.5, 0.25, 0.25)).norm(), 1e-15);
  const CageFaces::Nearest edge = faces.NearestOn(0, {0.25, -3, 4});
  EXPECT_EQ(edge.distance, 5);
  EXPECT_LT((PointAt(faces, 0, edge.barycentric) - Vec3(0.25, 0, 0)).norm(),
            1e-15);
  const CageFaces::Nearest corner = faces.NearestOn(0, {4, -4, 0});
  EXPECT_EQ(corner.distance, 5);
  EXPECT_EQ(PointAt(faces, 0, corner.barycentric), Vec3(1, 0, 0));
}

TEST(CageFaces, NearestFaceIsTheBestOfAll) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> coordinate(-2, 2);
  for (const Cage& cage :
       {CageOf(Torus(1, 0.4, 9, 5)), CageOf(RegularLoop2d(1, 9))}) {
    const CageFaces faces(cage);
    for (int i = 0; i < 200; ++i) {
      Vec3 x(coordinate(random), coordinate(random), 0);
      if (cage.dimension() == 3) x.z() = coordinate(random);
      CageFaces::Nearest best;
      for (int64_t f = 0; f < faces.size(); ++f) {
        const CageFaces::Nearest nearest = faces.NearestOn(f, x);
        if (nearest.distance < best.distance) best = nearest;
      }
      EXPECT_EQ(faces.NearestOf(x).face, best.face);
      EXPECT_EQ(faces.NearestOf(x).distance, best.distance);
    }
  }
}

TEST(CageFaces, OnlyAllowedFacesAreNearest) {
  const CageFaces faces(CornerOfTheUnitCube());
  const std::vector<char> allowed = {0, 1, 0, 0};
  EXPECT_EQ(faces.NearestOf({0.2, 0.2, -1}).face, 0);
  EXPECT_EQ(faces.NearestOf({0.2, 0.2, -1}, allowed).face, 1);
}

}  // namespace
}  // namespace deform
