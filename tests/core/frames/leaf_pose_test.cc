#include "core/frames/leaf_pose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "core/frames/basis_payload.h"
#include "tests/core/frames/leaf_bases.h"
#include "tests/support/detailed_model.h"
#include "tests/support/instruction_sets.h"

namespace deform {
namespace {

// A session on a server, and who receives its frames.
class Session {
 public:
  explicit Session(std::shared_ptr<const Binding> binding,
                   ThreadPool* pool = nullptr)
      : pool_(pool),
        deformer_(binding, pool),
        sent_(LeafBasis::Of(binding)),
        received_(LeafBasis::FromBytes(sent_->ToBytes(), sent_->byte_count())
                      .value()) {}

  void MoveTo(const Pose& pose) { report_ = deformer_.MoveTo(pose); }
  const DeformReport& report() const { return report_; }
  const LeafBasis& basis() const { return *received_; }

  std::vector<uint8_t> Frame(double tolerance) const {
    return EncodeLeafPose(LeafPoseOf(deformer_), *sent_, tolerance, pool_)
        .value();
  }
  std::vector<float> Received(const std::vector<uint8_t>& frame,
                              const Vec3& origin) const {
    std::vector<float> positions(received_->point_count() *
                                 received_->dimension());
    const auto pose = DecodeLeafPose(frame, *received_);
    EXPECT_TRUE(pose.ok()) << pose.status();
    EXPECT_TRUE(PlacePoints(*pose, *received_, origin, pool_, positions).ok());
    return positions;
  }
  std::vector<float> OfServer(const Vec3& origin) const {
    std::vector<float> positions(received_->point_count() *
                                 received_->dimension());
    deformer_.CopyRelative(0, received_->point_count(), origin,
                           positions.data());
    return positions;
  }
  // Largest distance of a point between both.
  double Error(const std::vector<uint8_t>& frame, const Vec3& origin) const {
    const std::vector<float> a = Received(frame, origin), b = OfServer(origin);
    const auto dimension = static_cast<size_t>(received_->dimension());
    double error = 0;
    for (size_t i = 0; i < a.size(); i += dimension) {
      double squares = 0;
      for (size_t d = 0; d < dimension; ++d) {
        squares += std::pow(double{a[i + d]} - b[i + d], 2);
      }
      error = std::max(error, std::sqrt(squares));
    }
    return error;
  }

 private:
  ThreadPool* const pool_;
  Deformer deformer_;
  DeformReport report_;
  const std::shared_ptr<const LeafBasis> sent_;
  const std::shared_ptr<const LeafBasis> received_;
};

// D of the rigs of InBall().
constexpr double kDiagonal = 3.4;
// Positions of up to 3, and the sums in them, are rounded to float on both
// sides: six times by 2^-24 of that or less.
constexpr double kRounding = 3 * 6 * 6e-8;

class LeafPoses
    : public testing::TestWithParam<std::tuple<const CoordinateScheme*, int>> {
 protected:
  std::shared_ptr<const Binding> Bound(
      double tolerance, const Vec3& center = Vec3::Zero()) const {
    const auto [scheme, dimension] = GetParam();
    auto binding =
        Bind(CompressedInBall(*scheme, dimension, 1500, tolerance, center), {});
    EXPECT_TRUE(binding.ok()) << binding.status();
    return *binding;
  }
};

TEST_P(LeafPoses, PlacesPointsWhereTheServerDoesIfAllIsTold) {
  const Vec3 origin(0.3, -0.2, std::get<1>(GetParam()) == 2 ? 0 : 5);
  for (const double tolerance : {1e-4, 1e-5, 1e-6}) {
    Session session(Bound(tolerance));
    EXPECT_EQ(session.Received(session.Frame(0), origin),
              session.OfServer(origin));
    for (unsigned seed = 1; seed <= 3; ++seed) {
      session.MoveTo(Shaken(*Bound(tolerance), seed, 0.2 * seed));
      EXPECT_EQ(session.Received(session.Frame(0), origin),
                session.OfServer(origin));
    }
  }
}

TEST_P(LeafPoses, KeepsItsTolerance) {
  for (const double tolerance : {1e-4, 1e-5, 1e-6}) {
    const auto binding = Bound(1e-5);
    Session session(binding);
    for (unsigned seed = 1; seed <= 3; ++seed) {
      session.MoveTo(Shaken(*binding, seed, 0.15 * seed));
      const auto frame = session.Frame(tolerance * kDiagonal);
      EXPECT_LT(std::ssize(frame), MaxLeafPoseBytes(session.basis()));
      const double error = session.Error(frame, Vec3::Zero());
      EXPECT_LE(error, tolerance * kDiagonal + kRounding);
      // It takes what it is given; less would be bytes for nothing.
      EXPECT_GE(error, 0.4 * tolerance * kDiagonal);
    }
  }
}

TEST_P(LeafPoses, KeepsItFarFromTheOriginAndAfterALongDrag) {
  const int dimension = std::get<1>(GetParam());
  const Vec3 center(3e6, -2e6, dimension == 2 ? 0 : 1e6);
  const auto binding = Bound(1e-5, center);
  Session session(binding);
  Pose pose = RestPose(binding->rig());
  int steps = 0;
  for (int step = 0; step < 300; ++step) {
    pose.vertices.row(step % 4) +=
        Eigen::RowVector3d(1e-3, -5e-4, dimension == 2 ? 0 : 1e-3);
    session.MoveTo(pose);
    steps += session.report().full ? 0 : 1;
  }
  EXPECT_GT(steps, 250);  // Sums of moved columns alone, most of them.
  EXPECT_EQ(session.Received(session.Frame(0), center),
            session.OfServer(center));
  const double tolerance = 1e-5 * kDiagonal;
  EXPECT_LE(session.Error(session.Frame(tolerance), center),
            tolerance + kRounding);
}

INSTANTIATE_TEST_SUITE_P(
    Schemes, LeafPoses,
    testing::Combine(testing::ValuesIn(AllSchemes().begin(),
                                       AllSchemes().end()),
                     testing::Values(2, 3)),
    [](const auto& test) {
      return std::string(std::get<0>(test.param)->id()) +
             (std::get<1>(test.param) == 2 ? "In2d" : "In3d");
    });

TEST(LeafPose, IsTheSameOnAllThreads) {
  ThreadPool pool({.threads = 3});
  const auto binding =
      Bind(CompressedInBall(**FindScheme("green"), 3, 12000, 1e-4),
           {.pool = &pool})
          .value();
  Session alone(binding), together(binding, &pool);
  const Pose pose = Shaken(*binding, 1, 0.2);
  alone.MoveTo(pose);
  together.MoveTo(pose);
  const auto frame = alone.Frame(1e-4);
  EXPECT_EQ(together.Frame(1e-4), frame);
  EXPECT_EQ(together.Received(frame, Vec3::Zero()),
            alone.Received(frame, Vec3::Zero()));
}

// Float sums of some thirty terms of up to D are made in another order, or
// multiplied and added in two steps.
constexpr double kOtherSums = 30 * 6e-8 * kDiagonal;

TEST(LeafPose, ComesOutNearlySoWithOtherVectorInstructions) {
  const auto binding =
      Bind(CompressedInBall(**FindScheme("green"), 3, 1500, 1e-5), {}).value();
  Session session(binding);
  session.MoveTo(Shaken(*binding, 1, 0.2));
  const auto frame = session.Frame(0);
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    const OnInstructionSet on(target);
    EXPECT_LE(session.Error(frame, Vec3::Zero()), kOtherSums)
        << hwy::TargetName(target);
  }
}

TEST(LeafPose, LeavesFixedPointsAtRest) {
  const auto binding =
      Bind(CompressedInBall(**FindScheme("green"), 3, 1000, 1e-4), {}).value();
  Session session(binding);
  Pose pose = Shaken(*binding, 1, 0.2);
  pose.vertices.rowwise() += Eigen::RowVector3d(10, 0, 0);
  session.MoveTo(pose);
  const auto positions = session.Received(session.Frame(1e-4), Vec3::Zero());
  for (const int64_t point : {3, 5}) {
    for (int d = 0; d < 3; ++d) {
      EXPECT_EQ(positions[point * 3 + d],
                static_cast<float>(binding->model()->positions()(point, d)));
    }
  }
  EXPECT_GT(positions[4 * 3], 8);
}

TEST(LeafPose, TakesAFractionOfTheBytesOfFloats) {
  const DetailedModel model = MakeDetailedModel(9, 12, 10);
  const auto binding =
      Bind({.model = std::make_shared<const Mesh>(MeshOf(model.model)),
            .rig = CageOf(model.cage),
            .scheme = "green",
            .weight_tolerance = 1e-5},
           {})
          .value();
  Session session(binding);
  Pose pose = RestPose(binding->rig());
  const double diagonal = DiagonalOf(binding->rig());
  pose.vertices.row(20) += Eigen::RowVector3d(0.1, 0.05, -0.05) * diagonal;
  session.MoveTo(pose);
  const auto floats = static_cast<double>(binding->point_count() * 12);
  const auto ratio = [&](double tolerance) {
    return floats /
           static_cast<double>(session.Frame(tolerance * diagonal).size());
  };
  // Leaves of the same number of points are larger than those of a model of
  // 173K points, and move by more numbers each: that takes less than 1/80.
  EXPECT_GT(ratio(1e-4), 90);
  EXPECT_GT(ratio(1e-5), 40);
  EXPECT_GT(ratio(0), 4);
}

}  // namespace
}  // namespace deform
