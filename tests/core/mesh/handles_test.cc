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

TEST(Handles, HaveTheFixedOnesLast) {
  Positions fixed(2, 3);
  fixed << 3, 3, 3, -3, -3, -3;
  const Handles handles = Handles::Create(3, Corners(), fixed).value();
  EXPECT_EQ(handles.size(), 10);
  EXPECT_EQ(handles.free_count(), 8);
  EXPECT_EQ(handles.fixed_count(), 2);
  EXPECT_EQ(handles.positions().topRows(8), Corners());
  EXPECT_EQ(handles.positions().bottomRows(2), fixed);
  EXPECT_DOUBLE_EQ(handles.diagonal(), 6 * std::sqrt(3));
}

TEST(Handles, MayBeFewWhereFixedOnesSpanTheSpace) {
  EXPECT_EQ(Handles::Create(3, Positions::Zero(1, 3), Corners()).status(),
            absl::OkStatus());
}

TEST(Handles, AreRefusedWhenNoneIsFree) {
  const auto handles = Handles::Create(3, Positions(0, 3), Corners());
  EXPECT_EQ(DetailOf(handles.status()).reason, "DEGENERATE_HANDLES");
  EXPECT_EQ(handles.status().message(),
            "all handles are fixed: at least one must be free to be posed");
}

TEST(Handles, AreRefusedForAFixedOneThatIsWrong) {
  Positions fixed = Positions::Zero(2, 3);
  fixed(1, 2) = std::numeric_limits<double>::infinity();
  absl::Status status = Handles::Create(3, Corners(), fixed).status();
  EXPECT_EQ(DetailOf(status).field, "rig.handles.fixed_positions");
  EXPECT_EQ(status.message(),
            "fixed handle 1 has a coordinate that is not finite");
  fixed(1, 2) = 1;
  status = Handles::Create(2, Plane(), fixed).status();
  EXPECT_EQ(status.message(), "fixed handle 1 of a 2D rig has z = 1, not 0");
}

TEST(BoxHandles, AreTheCornersOfABoxOnePointSixTimesAsLarge) {
  const Mesh model = MeshOf(Cuboid({1, 2, 3}, {2, 4, 6}));
  const Positions corners = BoxHandles(model);
  ASSERT_EQ(corners.rows(), 8);
  const Box box = BoxOf(corners);
  EXPECT_TRUE(box.center().isApprox(model.box().center(), 1e-15));
  EXPECT_TRUE((box.max - box.min).isApprox(1.6 * Vec3(1, 2, 3), 1e-15));
  // All of them, each once.
  const Mesh square = MeshOf(Grid2d(2), 2);
  const Positions flat = BoxHandles(square);
  ASSERT_EQ(flat.rows(), 4);
  EXPECT_EQ(flat.col(2), Eigen::VectorXd::Zero(4));
  EXPECT_EQ(Handles::Create(2, flat).status(), absl::OkStatus());
}

TEST(BoxHandles, ContainStrictlyWhateverTheModel) {
  Shape flat{Grid2d(3).positions, Faces(0, 3)};
  Shape far = flat;
  far.positions.rowwise() += Eigen::RowVector3d(1e12, -1e12, 5);
  const Shape point{Positions::Zero(1, 3), Faces(0, 3)};
  const Shape far_point{Positions::Constant(1, 3, 1e9), Faces(0, 3)};
  for (const Shape& shape : {flat, far, point, far_point}) {
    const Mesh model = MeshOf(shape);
    const Positions corners = BoxHandles(model);
    const Box box = BoxOf(corners);
    for (int d = 0; d < 3; ++d) {
      EXPECT_LT(box.min[d], model.box().min[d]);
      EXPECT_GT(box.max[d], model.box().max[d]);
    }
    EXPECT_EQ(Handles::Create(3, corners).status(), absl::OkStatus());
  }
}

}  // namespace
}  // namespace deform
