// Points outside of a cage or of the hull of handles, and points that are
// clamped.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/weights/binding.h"
#include "tests/core/weights/bind_requests.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;
using testing::StartsWith;

TEST(UnbindablePoints, FailTheCallWithTheirNumberAndTheFirstTen) {
  const absl::Status status = Bind(RowOfPoints(20), {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(status).reason, "EXTERIOR_NO_EXIT_FACE");
  EXPECT_EQ(status.message(),
            "15 points lie outside the cage and have no exit face: 5, 6, 7, 8, "
            "9, 10, 11, 12, 13, 14, ...; name exit faces or choose them "
            "automatically");
}

TEST(UnbindablePoints, AreNamedAllWhereTheyAreFew) {
  EXPECT_THAT(
      std::string(Bind(RowOfPoints(7), {}).status().message()),
      StartsWith("2 points lie outside the cage and have no exit face: 5, 6;"));
  EXPECT_THAT(
      std::string(Bind(RowOfPoints(6), {}).status().message()),
      StartsWith("1 point lies outside the cage and has no exit face: 5;"));
}

TEST(UnbindablePoints, AreListedOnRequestAndTheRestIsBound) {
  BindRequest request = RowOfPoints(7);
  request.unbindable = Unbindable::kReport;
  const auto binding = Bind(request, {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  EXPECT_EQ((*binding)->unbound_count(), 2);
  EXPECT_THAT((*binding)->fixed_points(), ElementsAre(5, 6));
  ASSERT_THAT((*binding)->unbound(), SizeIs(1));
  EXPECT_EQ((*binding)->unbound()[0].reason, "EXTERIOR_NO_EXIT_FACE");
  for (int64_t c = 0; c < (*binding)->weights().columns(); ++c) {
    EXPECT_EQ((*binding)->weights().at(5, c), 0);
  }
  EXPECT_NE((*binding)->weights().at(4, 0), 0);
}

TEST(UnbindablePoints, IncludeThoseWhoseWeightsFloatCannotHold) {
  BindRequest request = RowOfPoints(1);
  Shape far{Positions(2, 3), Faces(0, 3)};
  far.positions << 0, 0, 0, 1e60, 0, 0;
  request.model = Shared(MeshOf(far));
  request.exits.kind = ExitRegions::Kind::kAutomatic;
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(status).reason, "WEIGHT_TOO_LARGE");
  EXPECT_EQ(status.message(),
            "1 point is so far outside that float cannot hold its weights: 1; "
            "move the model closer to the cage");
  request.unbindable = Unbindable::kReport;
  const auto binding = Bind(request, {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  EXPECT_THAT((*binding)->fixed_points(), ElementsAre(1));
  const auto weights = RecomputeWeights(**binding, 0, 2);
  EXPECT_EQ(weights->vertex.row(1).norm(), 0);
}

TEST(UnbindablePoints, AreToldByEveryReason) {
  BindRequest request = RowOfPoints(1);
  Shape far{Positions(3, 3), Faces(0, 3)};
  far.positions << 0, 0, 2, 1e60, 0, 0, 0, 3, 0;
  request.model = Shared(MeshOf(far));
  request.exits = {.kind = ExitRegions::Kind::kPerPoint,
                   .face_of_point = {-1, 0, -1}};
  request.unbindable = Unbindable::kReport;
  const auto binding = Bind(request, {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  EXPECT_THAT((*binding)->unbound(), SizeIs(2));
  EXPECT_THAT((*binding)->fixed_points(), ElementsAre(0, 1, 2));
}

TEST(Bind, ExtendsOutsidePointsThroughTheirExitFaces) {
  BindRequest request = RowOfPoints(20);
  request.exits.kind = ExitRegions::Kind::kAutomatic;
  const auto binding = Bind(request, {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  EXPECT_EQ((*binding)->unbound_count(), 0);
  ASSERT_THAT((*binding)->exit_parts(), SizeIs(1));
  EXPECT_THAT((*binding)->exit_parts()[0].points, SizeIs(15));
  // Float weights, here of up to 5.
  EXPECT_LT((*binding)->quality().reproduction_error, 1e-6);
}

TEST(Bind, WarnsWhereAPartCrossesSeveralFaces) {
  BindRequest request = SphereInCube();
  request.model = Shared(
      MeshOf(Bar({-0.5, -0.1, -0.1}, {2, 0.1, 0.1}, std::array{10, 4, 4})));
  request.exits.kind = ExitRegions::Kind::kAutomatic;
  const auto binding = Bind(request, {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  ASSERT_THAT((*binding)->warnings(), SizeIs(1));
  EXPECT_THAT((*binding)->warnings()[0],
              HasSubstr("and cross 1 more, such as face"));
}

TEST(Bind, ExtendsToTheSameBitsOnAnyNumberOfThreads) {
  BindRequest request = RowOfPoints(3000);
  request.exits.kind = ExitRegions::Kind::kAutomatic;
  ThreadPool pool({.threads = 7});
  const auto serial = Bind(request, {});
  const auto parallel = Bind(request, {.pool = &pool});
  ASSERT_TRUE(parallel.ok()) << parallel.status();
  EXPECT_TRUE(SameBits((*serial)->weights(), (*parallel)->weights()));
}

TEST(Bind, WarnsOfOutsidePointsThatNeedNoExitFace) {
  BindRequest request = RowOfPoints(7);
  request.scheme = "mean_value";
  const auto binding = Bind(request, {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  ASSERT_THAT((*binding)->warnings(), SizeIs(1));
  EXPECT_THAT((*binding)->warnings()[0],
              StartsWith("2 points lie outside the cage"));
}

TEST(Bind, NamesPointsOutsideTheHullOfTheHandles) {
  BindRequest request = RowOfPoints(7);
  request.rig = *Handles::Create(3, Cube().vertices());
  request.scheme = "s_cc";
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(status).reason, "OUTSIDE_HULL");
  EXPECT_THAT(
      std::string(status.message()),
      StartsWith("2 points lie outside the convex hull of the handles: 5, 6; "
                 "add handles around them, or the corners of the model's box "
                 "as fixed handles (add_box_handles, --add-box)"));
}

// Handles that none of the points lies among: in the middle of the model.
Positions SmallHandles(int dimension) {
  Positions handles = Positions::Zero(2, 3);
  handles(1, 0) = 0.1;
  handles.leftCols(dimension).array() += 0.05;
  return handles;
}

TEST(Bind, ReachesTheWholeModelByHandlesAtItsBox) {
  const Mesh flat = MeshOf(Grid2d(9), 2);
  const Mesh ball = MeshOf(Icosphere(0.9, 2));
  for (const Mesh& model : {flat, ball}) {
    for (const char* scheme : {"s_cc", "t_cc"}) {
      BindRequest request{.model = Shared(model), .rig = Cube()};
      request.rig =
          Handles::Create(model.dimension(), SmallHandles(model.dimension()),
                          BoxHandles(model))
              .value();
      request.scheme = scheme;
      if (request.scheme == "t_cc") request.options.handle_weights = {0.5, 2};
      const auto binding = Bind(request, {});
      ASSERT_TRUE(binding.ok()) << binding.status();
      // Of float weights.
      EXPECT_LT((*binding)->quality().reproduction_error, 1e-7);
      EXPECT_EQ((*binding)->vertex_count(), model.dimension() == 2 ? 6 : 10);
      EXPECT_THAT((*binding)->warnings(),
                  ElementsAre(HasSubstr("handles, from 2 on, are fixed: no "
                                        "pose moves them")));
    }
  }
}

TEST(Bind, TakesWeightsOfFreeHandlesOnly) {
  BindRequest request = SphereInCube();
  request.rig = Handles::Create(3, SmallHandles(3), Cube().vertices()).value();
  request.scheme = "t_cc";
  request.options.handle_weights = std::vector<double>(10, 1.0);
  EXPECT_EQ(Bind(request, {}).status().message(),
            "there are 10 handle weights for 2 handles; give one for each or "
            "none");
}

TEST(Bind, NeedsNoWeightsForClampedPoints) {
  BindRequest request = RowOfPoints(7);
  request.clamped = {2, 5, 6};
  for (const char* scheme : {"green", "s_cc"}) {
    request.scheme = scheme;
    if (request.scheme == "s_cc") {
      request.rig = *Handles::Create(3, Cube().vertices());
    }
    const auto binding = Bind(request, {});
    ASSERT_TRUE(binding.ok()) << binding.status();
    EXPECT_EQ((*binding)->clamped(), request.clamped);
    EXPECT_EQ((*binding)->fixed_points(), request.clamped);
    EXPECT_EQ((*binding)->unbound_count(), 0);
    for (int64_t c = 0; c < (*binding)->weights().columns(); ++c) {
      EXPECT_EQ((*binding)->weights().at(2, c), 0);
    }
    const WeightBlock again = RecomputeWeights(**binding, 0, 7).value();
    EXPECT_TRUE(again.vertex.row(2).isZero(0));
    EXPECT_FALSE(again.vertex.row(1).isZero(0));
  }
}

TEST(Bind, StillNamesThePointsOutsideThatAreNotClamped) {
  BindRequest request = RowOfPoints(7);
  request.clamped = {5};
  const absl::Status status = Bind(request, {}).status();
  EXPECT_THAT(std::string(status.message()), StartsWith("1 point lies"));
  EXPECT_THAT(std::string(status.message()), HasSubstr(": 6"));
  request.unbindable = Unbindable::kReport;
  const auto binding = Bind(request, {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  EXPECT_EQ((*binding)->unbound_count(), 1);
  EXPECT_THAT((*binding)->fixed_points(), ElementsAre(5, 6));
}

TEST(Bind, HoldsAPartTogetherByItsClampedPoints) {
  // The half of a ball that sticks out of the cube, with its rim clamped.
  Shape ball = Icosphere(0.9, 2);
  ball.positions.rowwise() += Eigen::RowVector3d(1, 0, 0);
  BindRequest request{
      .model = Shared(MeshOf(ball)), .rig = Cube(), .scheme = "green"};
  request.exits.kind = ExitRegions::Kind::kAutomatic;
  const auto whole = Bind(request, {});
  ASSERT_TRUE(whole.ok()) << whole.status();
  ASSERT_THAT((*whole)->exit_parts(), SizeIs(1));
  for (int64_t i = 0; i < ball.positions.rows(); ++i) {
    const double x = ball.positions(i, 0);
    if (x > 1.2 && x < 1.5) request.clamped.push_back(i);
  }
  ASSERT_FALSE(request.clamped.empty());
  const auto clamped = Bind(request, {});
  ASSERT_TRUE(clamped.ok()) << clamped.status();
  ASSERT_THAT((*clamped)->exit_parts(), SizeIs(1));
  EXPECT_EQ((*clamped)->exit_parts()[0].points.size() + request.clamped.size(),
            (*whole)->exit_parts()[0].points.size());
}

TEST(Bind, RefusesToClampPointsThatAreNotThere) {
  BindRequest request = RowOfPoints(3);
  request.clamped = {0, 3};
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(DetailOf(status).reason, "INDEX_OUT_OF_RANGE");
  EXPECT_EQ(DetailOf(status).field, "clamped_points");
  EXPECT_EQ(status.message(),
            "clamped_points names point 3; the model has 3 points");
}

}  // namespace
}  // namespace deform
