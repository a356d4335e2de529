#include "core/mesh/handles.h"

#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::HasSubstr;

Positions Corners() { return Cuboid({-1, -1, -1}, {1, 1, 1}).positions; }

// Corners of a grid in the plane z = 0.
Positions Plane() { return Grid2d(4).positions; }

void ExpectRefused(int dimension, const Positions& positions,
                   const std::string& reason, const std::string& message) {
  const auto handles = Handles::Create(dimension, positions);
  ASSERT_FALSE(handles.ok());
  EXPECT_EQ(handles.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(handles.status()).reason, reason);
  EXPECT_THAT(std::string(handles.status().message()), HasSubstr(message));
}

Eigen::Matrix3d SomeRotation() {
  return Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
}

TEST(Handles, KeepWhatTheyWereGiven) {
  const auto handles = Handles::Create(3, Corners());
  ASSERT_TRUE(handles.ok()) << handles.status();
  EXPECT_EQ(handles->dimension(), 3);
  EXPECT_EQ(handles->size(), 8);
  EXPECT_EQ(handles->positions(), Corners());
  EXPECT_DOUBLE_EQ(handles->diagonal(), 2 * std::sqrt(3));
}

TEST(Handles, SpanTheirSpaceWhereverItIs) {
  EXPECT_EQ(Handles::Create(2, Plane()).status(), absl::OkStatus());
  EXPECT_EQ(Handles::Create(3, Tetrahedron().positions).status(),
            absl::OkStatus());
  for (const double scale : {1e-90, 1e-6, 1e6, 1e99}) {
    EXPECT_EQ(Handles::Create(3, Corners() * scale).status(), absl::OkStatus())
        << scale;
  }
  EXPECT_EQ(
      Handles::Create(3, Scaled({Corners(), {}}, 1, {1e6, 0, 1e6}).positions)
          .status(),
      absl::OkStatus());
}

TEST(Handles, MayBeNearlyFlat) {
  Positions flat = Corners();
  flat.col(2) *= 1e-6;
  EXPECT_EQ(Handles::Create(3, flat * SomeRotation()).status(),
            absl::OkStatus());
  // One handle off a plane of many.
  Positions lifted = Grid2d(30).positions;
  lifted(17, 2) = 1e-3;
  EXPECT_EQ(Handles::Create(3, lifted).status(), absl::OkStatus());
}

TEST(Handles, AreRefusedInAnotherDimension) {
  ExpectRefused(1, Corners(), "BAD_DIMENSION",
                "dimension must be 2 or 3, not 1");
}

TEST(Handles, AreRefusedWhenNotFiniteOrTooLarge) {
  Positions positions = Corners();
  positions(4, 2) = std::numeric_limits<double>::quiet_NaN();
  ExpectRefused(3, positions, "NON_FINITE",
                "handle 4 has a coordinate that is not finite");
  positions(4, 2) = 1e101;
  ExpectRefused(3, positions, "COORDINATE_TOO_LARGE", "handle 4");
}

TEST(Handles, AreRefusedOffThePlaneIn2d) {
  ExpectRefused(2, Corners(), "NOT_PLANAR",
                "handle 0 of a 2D rig has z = -1, not 0");
}

TEST(Handles, AreRefusedWhenTooFew) {
  ExpectRefused(3, Corners().topRows(3), "DEGENERATE_HANDLES",
                "a 3D rig needs at least 4 handles, not 3");
  ExpectRefused(2, Plane().topRows(2), "DEGENERATE_HANDLES",
                "a 2D rig needs at least 3 handles, not 2");
  ExpectRefused(3, Positions(0, 3), "DEGENERATE_HANDLES", "not 0");
}

TEST(Handles, AreRefusedInOnePlane) {
  ExpectRefused(3, Plane(), "DEGENERATE_HANDLES",
                "all 25 handles lie in one plane");
  // A rotation lifts them off it by rounding alone, more so far from 0.
  for (const double offset : {0.0, 1e4, 1e8}) {
    Positions plane = Plane();
    plane.rowwise() += Eigen::RowVector3d(offset, 0, 0);
    ExpectRefused(3, plane * SomeRotation(), "DEGENERATE_HANDLES", "one plane");
  }
}

TEST(Handles, AreRefusedOnOneLineOrPoint) {
  Positions line = Plane();
  line.col(1) = 0.3 * line.col(0);
  ExpectRefused(2, line, "DEGENERATE_HANDLES", "lie on one line");
  ExpectRefused(3, line * SomeRotation(), "DEGENERATE_HANDLES",
                "lie on one line");
  ExpectRefused(3, Positions::Ones(5, 3), "DEGENERATE_HANDLES",
                "all 5 handles lie at one point");
}

}  // namespace
}  // namespace deform
