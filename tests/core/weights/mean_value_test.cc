#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/error.h"
#include "core/mesh/handles.h"
#include "core/weights/scheme.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::Each;
using testing::HasSubstr;

WeightBlock Weights(const Cage& cage, const Positions& points) {
  WeightBlock block;
  FindScheme("mean_value")
      .value()
      ->Prepare(cage, {})
      .value()
      ->Evaluate(points, block);
  return block;
}

Cage LShape() {
  const Eigen::Vector2d corners[] = {{0, 0}, {2, 0}, {2, 1},
                                     {1, 1}, {1, 2}, {0, 2}};
  return CageOf(Loop2d(corners));
}

Positions RandomPoints(int64_t n, double reach, int dimension) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-reach, reach);
  Positions points = Positions::Zero(n, 3);
  for (int64_t i = 0; i < n; ++i) {
    for (int d = 0; d < dimension; ++d) points(i, d) = uniform(random);
  }
  return points;
}

struct NamedCage {
  std::string name;
  Cage cage;
};

void PrintTo(const NamedCage& named, std::ostream* out) { *out << named.name; }

class MeanValue : public testing::TestWithParam<NamedCage> {
 protected:
  const Cage& cage() const { return GetParam().cage; }
  // A point of face f by its barycentrics, 0.2 and 0.3 and the rest.
  Vec3 OnFace(int64_t f) const {
    const double shares[] = {0.2, 0.3, 0.5};
    if (cage().dimension() == 2) {
      return 0.2 * Corner(f, 0) + 0.8 * Corner(f, 1);
    }
    Vec3 point = Vec3::Zero();
    for (int k = 0; k < 3; ++k) point += shares[k] * Corner(f, k);
    return point;
  }
  Vec3 Corner(int64_t f, int k) const {
    return cage().vertices().row(cage().faces()(f, k));
  }
  Vec3 Normal(int64_t f) const {
    const Vec3 edge = Corner(f, 1) - Corner(f, 0);
    if (cage().dimension() == 2) {
      return Vec3(edge.y(), -edge.x(), 0).normalized();
    }
    return edge.cross(Corner(f, 2) - Corner(f, 0)).normalized();
  }
};

INSTANTIATE_TEST_SUITE_P(
    , MeanValue,
    testing::Values(NamedCage{"Cube", CageOf(Cuboid({-1, -1, -1}, {1, 1, 1}))},
                    NamedCage{"Sphere", CageOf(Icosphere(1, 1))},
                    NamedCage{"Ring", CageOf(Torus(1, 0.4, 12, 8))},
                    NamedCage{"LShape", LShape()},
                    NamedCage{"Polygon", CageOf(RegularLoop2d(1, 7))}),
    [](const auto& test) { return test.param.name; });

TEST_P(MeanValue, SumsToOneAndReproducesThePointInsideAndOutside) {
  const Positions points = RandomPoints(300, 2.5, cage().dimension());
  const WeightBlock block = Weights(cage(), points);
  const Eigen::VectorXd sums = block.vertex.rowwise().sum();
  EXPECT_LT((sums.array() - 1).abs().maxCoeff(), 1e-12);
  // Outside, weights of either sign cancel.
  EXPECT_LT((block.vertex * cage().vertices() - points).cwiseAbs().maxCoeff(),
            1e-10);
}

TEST_P(MeanValue, TellsInsideFromOutside) {
  const Positions points = RandomPoints(300, 1.5, cage().dimension());
  const WeightBlock block = Weights(cage(), points);
  for (int64_t i = 0; i < points.rows(); ++i) {
    const bool inside = WindingNumber(cage(), points.row(i)) > 0.5;
    EXPECT_EQ(block.states[i],
              inside ? PointState::kInside : PointState::kBoundOutside)
        << points.row(i);
  }
}

TEST_P(MeanValue, AVertexHasItsOwnPlace) {
  const WeightBlock block = Weights(cage(), cage().vertices());
  EXPECT_THAT(block.states, Each(PointState::kBoundary));
  EXPECT_EQ(block.vertex,
            RowMatrix::Identity(cage().vertex_count(), cage().vertex_count()));
}

TEST_P(MeanValue, IsBarycentricOnEveryFaceAndContinuousThere) {
  for (int64_t f = 0; f < cage().face_count(); ++f) {
    RowMatrix expected = RowMatrix::Zero(1, cage().vertex_count());
    const bool flat = cage().dimension() == 2;
    const double shares[] = {0.2, flat ? 0.8 : 0.3, 0.5};
    for (int k = 0; k < cage().dimension(); ++k) {
      expected(0, cage().faces()(f, k)) = shares[k];
    }
    const WeightBlock on = Weights(cage(), OnFace(f).transpose());
    EXPECT_EQ(on.states[0], PointState::kBoundary) << f;
    EXPECT_LT((on.vertex - expected).norm(), 1e-14) << f;
    for (const double away : {1e-3, 1e-6, 1e-9, 1e-12}) {
      for (const double side : {-1.0, 1.0}) {
        const Vec3 near = OnFace(f) + side * away * Normal(f);
        const WeightBlock block = Weights(cage(), near.transpose());
        EXPECT_EQ(block.states[0],
                  side < 0 ? PointState::kInside : PointState::kBoundOutside)
            << f << " " << away;
        // Weights change by less than the distance over a tenth of a face.
        EXPECT_LT((block.vertex - expected).norm(), 30 * away + 1e-14)
            << f << " " << away;
      }
    }
  }
}

TEST_P(MeanValue, IsContinuousAcrossEveryEdgeLine) {
  // On the line of an edge, beyond its end, and a hair beside it.
  for (int64_t f = 0; f < cage().face_count(); ++f) {
    const Vec3 beyond = 1.4 * Corner(f, 1) - 0.4 * Corner(f, 0);
    const Vec3 beside = beyond + 1e-11 * Normal(f);
    const WeightBlock a = Weights(cage(), beyond.transpose());
    const WeightBlock b = Weights(cage(), beside.transpose());
    EXPECT_LT((a.vertex - b.vertex).norm(), 1e-8) << f;
    EXPECT_TRUE(a.vertex.allFinite()) << f;
  }
}

TEST_P(MeanValue, IgnoresSimilarities) {
  const Positions points = RandomPoints(100, 0.9, cage().dimension());
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.1, Vec3::UnitZ()).toRotationMatrix();
  const auto moved = [&](const Positions& p) -> Positions {
    return (40 * p * turn.transpose()).rowwise() + Eigen::RowVector3d(7, -3, 0);
  };
  const Cage other =
      Cage::Create(cage().dimension(), moved(cage().vertices()), cage().faces())
          .value();
  const RowMatrix before = Weights(cage(), points).vertex;
  const RowMatrix after = Weights(other, moved(points)).vertex;
  // Moving rounds the coordinates by 1e-15; near vertices weights are steep.
  EXPECT_LT((before - after).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(MeanValueOfATetrahedron, IsBarycentricInside) {
  const Cage cage = CageOf(Tetrahedron());
  const Eigen::RowVector4d shares(0.1, 0.2, 0.3, 0.4);
  const WeightBlock block = Weights(cage, shares * cage.vertices());
  EXPECT_LT((block.vertex - shares).norm(), 1e-15);
}

TEST(MeanValueScheme, RefusesHandlesAndOptionsOfOtherSchemes) {
  const CoordinateScheme* scheme = FindScheme("mean_value").value();
  const Handles handles = Handles::Create(3, Tetrahedron().positions).value();
  const absl::Status wrong_rig = scheme->Prepare(handles, {}).status();
  EXPECT_EQ(DetailOf(wrong_rig).reason, "WRONG_RIG");
  EXPECT_THAT(std::string(wrong_rig.message()),
              HasSubstr("needs a cage, but the rig is handles"));
  for (const SchemeOptions& options :
       {SchemeOptions{.lambda = 2}, SchemeOptions{.handle_weights = {1}}}) {
    const absl::Status status = scheme->Prepare(LShape(), options).status();
    EXPECT_EQ(DetailOf(status).reason, "INVALID_OPTION");
    EXPECT_THAT(std::string(status.message()),
                HasSubstr("scheme mean_value has no options"));
  }
}

}  // namespace
}  // namespace deform
