#include "core/deform/columns.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <random>

#include "tests/core/deform/test_cages.h"

namespace deform {
namespace {

Positions Noisy(const Positions& rest, int dimension, double size) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> uniform(-size, size);
  Positions noisy = rest;
  for (int64_t i = 0; i < rest.rows(); ++i) {
    for (int d = 0; d < dimension; ++d) noisy(i, d) += uniform(random);
  }
  return noisy;
}

// [L08]: s^2 = (sigma_1^2 + sigma_2^2) / 2 of the face's linear map.
double StretchBySvd(const Cage& cage, const Positions& posed, int64_t face) {
  const auto edges = [&](const Positions& x) {
    Eigen::Matrix<double, 3, 2> e;
    for (int k = 0; k < 2; ++k) {
      e.col(k) =
          (x.row(cage.faces()(face, k + 1)) - x.row(cage.faces()(face, 0)))
              .transpose();
    }
    return e;
  };
  const Eigen::Matrix<double, 3, 2> rest = edges(cage.vertices());
  // An orthonormal basis of the face, by QR.
  const Eigen::HouseholderQR<Eigen::Matrix<double, 3, 2>> qr(rest);
  const Eigen::Matrix2d r =
      qr.matrixQR().topRows<2>().triangularView<Eigen::Upper>();
  const Eigen::Matrix<double, 3, 2> map = edges(posed) * r.inverse();
  const Eigen::Vector2d sigma =
      Eigen::JacobiSVD<Eigen::Matrix<double, 3, 2>>(map).singularValues();
  return std::sqrt(sigma.squaredNorm() / 2);
}

TEST(Stretch, IsTheMeanOfTheSquaredSingularValues) {
  const Cage cage = BoxCage(2);
  const PosedColumns columns(cage, true);
  const Positions posed = Noisy(cage.vertices(), 3, 0.5);
  for (int64_t f = 0; f < cage.face_count(); ++f) {
    EXPECT_NEAR(columns.Stretch(posed, f), StretchBySvd(cage, posed, f), 1e-13);
  }
}

TEST(Stretch, OfAnEdgeIsItsRelativeLength) {
  const Cage cage = SquareCage();
  const PosedColumns columns(cage, true);
  Positions posed = cage.vertices();
  posed.col(0) *= 3;
  for (int64_t f = 0; f < cage.face_count(); ++f) {
    const auto length = [&](const Positions& x) {
      return (x.row(cage.faces()(f, 1)) - x.row(cage.faces()(f, 0))).norm();
    };
    EXPECT_DOUBLE_EQ(columns.Stretch(posed, f),
                     length(posed) / length(cage.vertices()));
  }
}

TEST(PosedColumns, AtRestAreVerticesAndUnitNormals) {
  for (const Cage& cage : {BoxCage(2), SquareCage()}) {
    const PosedColumns columns(cage, true);
    Columns posed;
    columns.UpdateAll({.vertices = cage.vertices()}, posed);
    EXPECT_TRUE(posed.isApprox(columns.rest(), 1e-15));
    for (int64_t c = cage.vertex_count(); c < posed.rows(); ++c) {
      EXPECT_NEAR(posed.row(c).norm(), 1, 1e-15);
      // The box is centred: outward is away from the origin.
      const int64_t f = c - cage.vertex_count();
      EXPECT_GT(posed.row(c).dot(cage.vertices().row(cage.faces()(f, 0))), 0);
    }
  }
}

TEST(PosedColumns, BlendBetweenStretchAndOne) {
  const Cage cage = BoxCage();
  const PosedColumns columns(cage, true);
  Pose pose{.vertices = 3 * cage.vertices()};
  Columns posed;
  for (const auto& [blend, length] :
       {std::pair{1.0, 3.0}, {0.0, 1.0}, {0.5, 2.0}}) {
    pose.stretch_blend = blend;
    columns.UpdateAll(pose, posed);
    for (int64_t c = cage.vertex_count(); c < posed.rows(); ++c) {
      EXPECT_NEAR(posed.row(c).norm(), length, 1e-14);
    }
  }
}

TEST(PosedColumns, UpdatedByMovedVerticesEqualThoseOfAll) {
  const Cage cage = BoxCage(3);
  const PosedColumns columns(cage, true);
  Pose pose{.vertices = cage.vertices()};
  Columns stepwise = columns.rest();
  const Positions target = Noisy(cage.vertices(), 3, 0.3);
  for (const int32_t v : {3, 7, 11}) {
    pose.vertices.row(v) = target.row(v);
    columns.Update(pose, std::vector<int32_t>{v}, stepwise);
  }
  Columns all;
  columns.UpdateAll(pose, all);
  EXPECT_TRUE(stepwise.isApprox(all, 1e-15));
}

TEST(PosedColumns, TurnACollapsedFacesNormalWithWhatIsLeftOfIt) {
  const Cage cage = BoxCage();
  const PosedColumns columns(cage, true);
  Pose pose{.vertices = cage.vertices()};
  const auto face = cage.faces().row(0);
  pose.vertices.row(face(1)) = pose.vertices.row(face(0));
  Columns posed;
  columns.UpdateAll(pose, posed);
  const Eigen::RowVector3d normal = posed.row(cage.vertex_count());
  const Eigen::RowVector3d left =
      pose.vertices.row(face(2)) - pose.vertices.row(face(0));
  EXPECT_NEAR(normal.dot(left), 0, 1e-15);
  EXPECT_NEAR(normal.norm(), columns.Stretch(pose.vertices, 0), 1e-15);
}

TEST(ExitMismatch, IsZeroWhenCrossedFacesMoveAlike) {
  const Cage cage = BoxCage();
  const PosedColumns columns(cage, true);
  const std::vector<ExitPart> parts = {
      {.exit_face = 0, .points = {0}, .crossed_faces = {1, 2}}};
  const Eigen::Matrix3d linear =
      2 * Eigen::AngleAxisd(0.7, Vec3(1, 1, 0).normalized()).toRotationMatrix();
  Positions moved = cage.vertices() * linear.transpose();
  moved.rowwise() += Eigen::RowVector3d(1, 2, 3);
  Columns posed;
  columns.UpdateAll({.vertices = moved}, posed);
  EXPECT_NEAR(ExitMismatch(cage, parts, columns, posed), 0, 1e-14);
}

TEST(ExitMismatch, GrowsWithTheDeviationOfCrossedFaces) {
  const Cage cage = BoxCage();
  const PosedColumns columns(cage, true);
  const std::vector<ExitPart> parts = {
      {.exit_face = 0, .points = {0}, .crossed_faces = {5}}};
  double before = 0;
  for (const double push : {0.01, 0.1, 1.0}) {
    Pose pose{.vertices = cage.vertices()};
    // A corner of face 5 that face 0 does not share.
    for (int k = 0; k < 3; ++k) {
      const int32_t v = cage.faces()(5, k);
      if ((cage.faces().row(0).array() == v).any()) continue;
      pose.vertices.row(v).array() += push;
    }
    Columns posed;
    columns.UpdateAll(pose, posed);
    const double mismatch = ExitMismatch(cage, parts, columns, posed);
    EXPECT_GT(mismatch, before);
    before = mismatch;
  }
}

}  // namespace
}  // namespace deform
