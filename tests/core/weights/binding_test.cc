#include "core/weights/binding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;
using testing::StartsWith;

std::shared_ptr<const Mesh> Shared(Mesh mesh) {
  return std::make_shared<const Mesh>(std::move(mesh));
}

Cage Cube() { return CageOf(Cuboid({-1, -1, -1}, {1, 1, 1})); }

BindRequest SphereInCube() {
  return {.model = Shared(MeshOf(Icosphere(0.9, 3))),
          .rig = Cube(),
          .scheme = "green"};
}

// Points along x with no edges: point i at x = i / 4, inside the cube up to 3,
// on its boundary at 4.
BindRequest RowOfPoints(int count) {
  Shape points{Positions::Zero(count, 3), Faces(0, 3)};
  for (int i = 0; i < count; ++i) points.positions(i, 0) = 0.25 * i;
  return {.model = Shared(MeshOf(points)), .rig = Cube(), .scheme = "green"};
}

// What cached weights may be off by, in a cage of about this size.
constexpr double kFloat = 1e-6;

bool SameBits(const WeightTiles& a, const WeightTiles& b) {
  return a.bytes() == b.bytes() &&
         std::memcmp(a.tile(0), b.tile(0), a.bytes()) == 0;
}

TEST(Bind, ReproducesThePointsAtRest) {
  const auto binding = Bind(SphereInCube(), {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  EXPECT_EQ((*binding)->point_count(), 642);
  EXPECT_EQ((*binding)->vertex_count(), 8);
  EXPECT_EQ((*binding)->normal_count(), 12);
  EXPECT_EQ((*binding)->unbound_count(), 0);
  // Float weights: at most half a unit in the last place of each.
  EXPECT_LT((*binding)->quality().reproduction_error, 1e-7);
  EXPECT_GT((*binding)->quality().reproduction_error, 1e-10);
  EXPECT_GE((*binding)->quality().weight_sum_max, 1);
  EXPECT_GT((*binding)->compute_seconds(), 0);
}

TEST(Bind, SaysThatAnUnknownSchemeIsNotFound) {
  BindRequest request = SphereInCube();
  request.scheme = "blue";
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("\"blue\""));
}

TEST(Bind, RefusesARigOfTheOtherKind) {
  BindRequest request = SphereInCube();
  request.rig = *Handles::Create(3, Cube().vertices());
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, "WRONG_RIG");
  EXPECT_EQ(status.message(), "Green coordinates need a cage");
}

TEST(Bind, RefusesARigOfAnotherDimension) {
  BindRequest request = SphereInCube();
  request.rig = CageOf(RegularLoop2d(1, 5));
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(DetailOf(status).reason, "DIMENSION_MISMATCH");
  EXPECT_EQ(status.message(), "the model is 3D and its rig 2D");
}

TEST(Bind, RefusesOptionsOfAnotherScheme) {
  BindRequest request = SphereInCube();
  request.options.lambda = 2;
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(DetailOf(status).reason, "INVALID_OPTION");
  EXPECT_EQ(status.message(), "Green coordinates take no options");
}

TEST(Bind, RefusesExitFacesThatDoNotExist) {
  BindRequest request = SphereInCube();
  request.exits = {.kind = ExitRegions::Kind::kFaces, .faces = {12}};
  EXPECT_EQ(DetailOf(Bind(request, {}).status()).reason,
            "EXIT_FACE_OUT_OF_RANGE");
}

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

TEST(Bind, WarnsOfHandlesAtTheSamePlace) {
  BindRequest request = SphereInCube();
  Positions handles(9, 3);
  handles << Cube().vertices(), Cube().vertices().row(2);
  request.rig = *Handles::Create(3, handles);
  request.scheme = "s_cc";
  const auto binding = Bind(request, {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  EXPECT_THAT((*binding)->warnings(),
              ElementsAre("handles 2 and 8 coincide and share their weight"));
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

TEST(Bind, RefusesExitFacesForHandles) {
  BindRequest request = SphereInCube();
  request.rig = *Handles::Create(3, Cube().vertices());
  request.scheme = "s_cc";
  request.exits.kind = ExitRegions::Kind::kAutomatic;
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(DetailOf(status).reason, "WRONG_RIG");
  EXPECT_EQ(status.message(), "exit faces belong to a cage; handles have none");
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

TEST(Bind, ReportsProgressUpToTheLastPoint) {
  std::atomic<int64_t> done{0};
  ThreadPool pool({.threads = 2});
  ASSERT_TRUE(Bind(SphereInCube(), {.pool = &pool, .points_done = &done}).ok());
  EXPECT_EQ(done, 642);

  BindRequest outside = RowOfPoints(1000);
  outside.exits.kind = ExitRegions::Kind::kAutomatic;
  done = 0;
  ASSERT_TRUE(Bind(outside, {.points_done = &done}).ok());
  EXPECT_EQ(done, 1000);

  outside.exits.kind = ExitRegions::Kind::kNone;
  outside.unbindable = Unbindable::kReport;
  done = 0;
  ASSERT_TRUE(Bind(outside, {.points_done = &done}).ok());
  EXPECT_EQ(done, 1000);
}

TEST(Bind, DoesNotBeginWhenCancelled) {
  Cancellation cancellation;
  cancellation.Cancel();
  std::atomic<int64_t> done{0};
  ThreadPool pool({.threads = 2});
  for (ThreadPool* threads : {static_cast<ThreadPool*>(nullptr), &pool}) {
    const absl::Status status =
        Bind(SphereInCube(), {.pool = threads,
                              .cancellation = &cancellation,
                              .points_done = &done})
            .status();
    EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
    EXPECT_EQ(done, 0);
  }
}

TEST(Bind, StopsWithinABlockWhenCancelled) {
  // A second of work, of which a few blocks are done.
  BindRequest request = SphereInCube();
  request.model = Shared(MeshOf(Icosphere(0.4, 6)));
  request.rig = CageOf(Icosphere(1, 2));
  Cancellation cancellation;
  std::atomic<int64_t> done{0};
  ThreadPool pool({.threads = 2});
  std::thread canceller([&] {
    while (done == 0) std::this_thread::yield();
    cancellation.Cancel();
  });
  const absl::Status status =
      Bind(request,
           {.pool = &pool, .cancellation = &cancellation, .points_done = &done})
          .status();
  canceller.join();
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
  EXPECT_LT(done, request.model->size() / 2);
}

// Every scheme, in 3D: a ball of points within a cube, or its corners.
class BindEvery : public testing::TestWithParam<const CoordinateScheme*> {
 protected:
  static BindRequest Request() {
    BindRequest request = SphereInCube();
    request.scheme = std::string(GetParam()->id());
    if (GetParam()->rig_kind() == RigKind::kHandles) {
      request.rig = *Handles::Create(3, Cube().vertices());
    }
    return request;
  }
};

TEST_P(BindEvery, SchemeGivesTheSameBitsOnAnyNumberOfThreads) {
  ThreadPool one({.threads = 1}), many({.threads = 7});
  const auto serial = Bind(Request(), {});
  ASSERT_TRUE(serial.ok()) << serial.status();
  for (ThreadPool* pool : {&one, &many}) {
    const auto parallel = Bind(Request(), {.pool = pool});
    ASSERT_TRUE(parallel.ok()) << parallel.status();
    EXPECT_TRUE(SameBits((*serial)->weights(), (*parallel)->weights()));
    EXPECT_EQ((*serial)->quality().reproduction_error,
              (*parallel)->quality().reproduction_error);
    EXPECT_EQ((*serial)->quality().iterations_total,
              (*parallel)->quality().iterations_total);
    EXPECT_EQ((*serial)->quality().residual_max,
              (*parallel)->quality().residual_max);
  }
}

TEST_P(BindEvery, SchemeRecomputesInDoubleWhatIsCachedInFloat) {
  const auto binding = Bind(Request(), {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  const int64_t vertices = (*binding)->vertex_count();
  const auto all = RecomputeWeights(**binding, 0, 642);
  // Ranges that begin and end within, before and after blocks.
  for (const auto& [first, count] :
       {std::pair{0, 642}, {3, 1}, {250, 300}, {641, 1}, {642, 0}}) {
    SCOPED_TRACE(first);
    const auto block = RecomputeWeights(**binding, first, count);
    ASSERT_TRUE(block.ok()) << block.status();
    ASSERT_EQ(block->vertex.rows(), count);
    ASSERT_EQ(block->normal.cols(), (*binding)->normal_count());
    EXPECT_EQ(block->vertex, all->vertex.middleRows(first, count));
    for (int i = 0; i < count; ++i) {
      for (int k = 0; k < vertices; ++k) {
        EXPECT_NEAR((*binding)->weights().at(first + i, k), block->vertex(i, k),
                    kFloat);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AllSchemes, BindEvery,
                         testing::ValuesIn(AllSchemes().begin(),
                                           AllSchemes().end()),
                         [](const auto& test) {
                           return std::string(test.param->id());
                         });

class Recompute : public testing::Test {
 protected:
  static std::shared_ptr<const Binding> RowLeavingTheCube() {
    BindRequest request = RowOfPoints(900);
    request.exits.kind = ExitRegions::Kind::kAutomatic;
    return *Bind(request, {});
  }
};

TEST_F(Recompute, GivesExtendedPointsTheirExitFaceAgain) {
  const auto binding = RowLeavingTheCube();
  for (const auto& [first, count] :
       {std::pair{0, 900}, {3, 1}, {250, 20}, {899, 1}, {900, 0}}) {
    SCOPED_TRACE(first);
    const auto block = RecomputeWeights(*binding, first, count);
    ASSERT_TRUE(block.ok()) << block.status();
    ASSERT_EQ(block->vertex.rows(), count);
    ASSERT_EQ(block->normal.rows(), count);
    for (int i = 0; i < count; ++i) {
      for (int k = 0; k < 8; ++k) {
        const double weight = block->vertex(i, k);
        EXPECT_NEAR(binding->weights().at(first + i, k), weight,
                    kFloat * std::max(1.0, std::abs(weight)));
      }
      for (int j = 0; j < 12; ++j) {
        const double weight = block->normal(i, j);
        EXPECT_NEAR(binding->weights().at(first + i, 8 + j), weight,
                    kFloat * std::max(1.0, std::abs(weight)));
      }
    }
  }
}

TEST_F(Recompute, RefusesPointsBeyondTheLast) {
  const auto binding = RowLeavingTheCube();
  for (const auto& [first, count] :
       {std::pair{-1, 1}, {0, 901}, {901, 0}, {5, -1}}) {
    const absl::Status status =
        RecomputeWeights(*binding, first, count).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(DetailOf(status).reason, "RANGE_OUT_OF_BOUNDS");
    EXPECT_EQ(status.message(),
              absl::StrCat("there are no ", count, " points from point ", first,
                           " on; the model has 900"));
  }
}

}  // namespace
}  // namespace deform
