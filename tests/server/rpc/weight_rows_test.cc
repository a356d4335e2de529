#include "server/rpc/weight_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform::server {
namespace {

// 42 points, 8 vertices and 12 faces.
std::shared_ptr<const Binding> BindBall() {
  return Bind({.model = std::make_shared<const Mesh>(MeshOf(Icosphere(0.5, 1))),
               .rig = CageOf(Cuboid(Vec3::Constant(-1), Vec3::Constant(1))),
               .scheme = "green"},
              {})
      .value();
}

template <typename Number>
std::vector<Number> Numbers(const v1::GetWeightsResponse& rows) {
  std::vector<Number> numbers(rows.data().size() / sizeof(Number));
  std::memcpy(numbers.data(), rows.data().data(), rows.data().size());
  return numbers;
}

TEST(WeightRows, AreTheCachedOnesRowByRow) {
  const auto binding = BindBall();
  const auto rows = CachedRows(*binding, {.first = 15, .count = 3});
  EXPECT_EQ(rows.first_point(), 15u);
  EXPECT_EQ(rows.point_count(), 3u);
  EXPECT_EQ(rows.vertex_count(), 8u);
  EXPECT_EQ(rows.normal_count(), 12u);
  const auto numbers = Numbers<float>(rows);
  ASSERT_EQ(numbers.size(), 60u);
  EXPECT_EQ(numbers[0], binding->weights().at(15, 0));
  EXPECT_EQ(numbers[59], binding->weights().at(17, 19));
}

TEST(WeightRows, AreComputedAgainInDouble) {
  const auto binding = BindBall();
  const auto rows = RecomputedRows(*binding, {.first = 4, .count = 2}).value();
  EXPECT_EQ(rows.precision(), v1::WEIGHT_PRECISION_RECOMPUTED_FLOAT64);
  const auto numbers = Numbers<double>(rows);
  ASSERT_EQ(numbers.size(), 40u);
  // What is cached is within the precision of float.
  EXPECT_NEAR(numbers[0], binding->weights().at(4, 0), 1e-6);
  EXPECT_NEAR(numbers[39], binding->weights().at(5, 19), 1e-6);
}

TEST(WeightRows, FitOneMessage) {
  const auto binding = BindBall();
  EXPECT_EQ(PointsPerMessage(*binding, v1::WEIGHT_PRECISION_CACHED_FLOAT32),
            (1 << 20) / 80);
  EXPECT_EQ(PointsPerMessage(*binding, v1::WEIGHT_PRECISION_RECOMPUTED_FLOAT64),
            (1 << 20) / 160);
}

TEST(WantedPoints, AreAllUnlessSaidOtherwise) {
  const auto binding = BindBall();
  v1::GetWeightsRequest request;
  EXPECT_EQ(WantedPoints(request, *binding)->count, 42);
  request.set_first_point(40);
  EXPECT_EQ(WantedPoints(request, *binding)->count, 2);
  request.set_point_count(1);
  EXPECT_EQ(WantedPoints(request, *binding)->first, 40);
  EXPECT_EQ(WantedPoints(request, *binding)->count, 1);
}

TEST(WantedPoints, RefuseWhatIsNotThere) {
  const auto binding = BindBall();
  v1::GetWeightsRequest request;
  request.set_first_point(42);
  absl::Status status = WantedPoints(request, *binding).status();
  EXPECT_EQ(status.message(), "first_point is 42; the binding has 42 points");
  EXPECT_EQ(DetailOf(status).reason, "POINT_OUT_OF_RANGE");
  request.set_first_point(40);
  request.set_point_count(~uint64_t{0});
  status = WantedPoints(request, *binding).status();
  EXPECT_EQ(DetailOf(status).field, "point_count");
  EXPECT_THAT(std::string(status.message()),
              testing::EndsWith("after point 40 the binding has 2"));
  request.set_precision(static_cast<v1::WeightPrecision>(7));
  status = WantedPoints(request, *binding).status();
  EXPECT_EQ(status.message(), "precision 7 is not known");
}

}  // namespace
}  // namespace deform::server
