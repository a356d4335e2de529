#include "core/weights/binding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "tests/core/weights/bind_requests.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// What cached weights may be off by, in a cage of about this size.
constexpr double kFloat = 1e-6;

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

TEST(Bind, RefusesExitFacesForHandles) {
  BindRequest request = SphereInCube();
  request.rig = *Handles::Create(3, Cube().vertices());
  request.scheme = "s_cc";
  request.exits.kind = ExitRegions::Kind::kAutomatic;
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(DetailOf(status).reason, "WRONG_RIG");
  EXPECT_EQ(status.message(), "exit faces belong to a cage; handles have none");
}

TEST(Bind, SaysThatLambdaIsInert) {
  BindRequest request = SphereInCube();
  request.rig = *Handles::Create(3, Cube().vertices());
  request.scheme = "s_cc";
  const auto without = Bind(request, {});
  ASSERT_TRUE(without.ok()) << without.status();
  EXPECT_TRUE((*without)->warnings().empty());
  request.options.lambda = 3;
  const auto with = Bind(request, {});
  ASSERT_TRUE(with.ok()) << with.status();
  EXPECT_THAT((*with)->warnings(),
              ElementsAre("lambda is inert: it cancels out of the weights"));
  EXPECT_TRUE(SameBits((*with)->weights(), (*without)->weights()));
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
