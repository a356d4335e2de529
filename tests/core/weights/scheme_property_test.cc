// What every coordinate scheme promises: a scheme is tested as soon as it is
// named in builtin_schemes.cc.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "core/deform/affine_map.h"
#include "core/deform/columns.h"
#include "core/kernels/weight_tiles.h"
#include "core/weights/scheme.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using Similarity = AffineMap;

Positions Mapped(const Positions& points, const Similarity& map) {
  Positions mapped(points.rows(), 3);
  for (int64_t i = 0; i < points.rows(); ++i) {
    mapped.row(i) = map(points.row(i).transpose());
  }
  return mapped;
}

// A rig of either kind and dimension, points it can bind, and the map that a
// pose makes of them, all in double.
class SchemeProperty
    : public testing::TestWithParam<std::tuple<const CoordinateScheme*, int>> {
 protected:
  const CoordinateScheme& scheme() const { return *std::get<0>(GetParam()); }
  int dimension() const { return std::get<1>(GetParam()); }

  SchemeProperty() : rig_(RigAt({})), evaluator_(Prepare(rig_)) {}

  // Not convex, without symmetries, V = 42 or 9.
  static Shape Base(int dimension) {
    Shape shape = dimension == 2 ? RegularLoop2d(1, 9) : Icosphere(1, 1);
    for (int64_t i = 0; i < shape.positions.rows(); ++i) {
      shape.positions.row(i) *= 1 + 0.15 * std::sin(3.7 * i);
    }
    return shape;
  }

  Rig RigAt(const Similarity& map) const {
    Shape shape = Base(dimension());
    shape.positions = Mapped(shape.positions, map);
    if (scheme().rig_kind() == RigKind::kCage) return CageOf(shape);
    return *Handles::Create(dimension(), shape.positions);
  }

  std::unique_ptr<const WeightEvaluator> Prepare(const Rig& rig) const {
    return *scheme().Prepare(rig, {});
  }

  // Inside the cage and, all the more, the handles' hull.
  Positions InnerPoints(int count) const {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> coordinate(-0.45, 0.45);
    Positions points = Positions::Zero(count, 3);
    for (int i = 0; i < count; ++i) {
      for (int d = 0; d < dimension(); ++d) points(i, d) = coordinate(random);
    }
    return points;
  }

  WeightBlock Evaluate(const Positions& points) const {
    WeightBlock block;
    evaluator_->Evaluate(points, block);
    return block;
  }

  Similarity Motion() const {
    const Eigen::AngleAxisd turn(
        0.8, dimension() == 2 ? Vec3(0, 0, 1) : Vec3(1, 2, 3).normalized());
    return {turn.toRotationMatrix(), Vec3::Zero(),
            dimension() == 2 ? Vec3(5, -3, 0) : Vec3(5, -3, 2)};
  }

  // A pose without any similarity to the rest.
  Pose Bent() const {
    Pose pose = RestPose(rig_);
    for (int64_t i = 0; i < pose.vertices.rows(); ++i) {
      for (int d = 0; d < dimension(); ++d) {
        pose.vertices(i, d) += 0.2 * std::sin(1.3 * i + 2.1 * d);
      }
    }
    return pose;
  }

  void Extend(const Vec3& point, int64_t exit_face, int64_t row,
              WeightBlock& block) const {
    const int64_t vertices = block.vertex.cols();
    for (const WeightShare& share : evaluator_->Extend(point, exit_face)) {
      (share.column < vertices ? block.vertex(row, share.column)
                               : block.normal(row, share.column - vertices)) +=
          share.weight;
    }
  }

  // [L08] Eq. 9 in displacement form; outside points leave through exit_face.
  Positions Deform(const Positions& points, const Pose& pose,
                   int64_t exit_face = -1) const {
    const PosedColumns posed(rig_, scheme().uses_normals());
    Columns columns = posed.rest();
    posed.UpdateAll(pose, columns);
    columns -= posed.rest();
    WeightBlock block = Evaluate(points);
    Positions deformed = points;
    for (int64_t i = 0; i < points.rows(); ++i) {
      if (block.states[i] == PointState::kOutside) {
        Extend(points.row(i), exit_face, i, block);
      }
      deformed.row(i) +=
          block.vertex.row(i) * columns.topRows(block.vertex.cols());
      if (block.normal.cols() > 0) {
        deformed.row(i) +=
            block.normal.row(i) * columns.bottomRows(block.normal.cols());
      }
    }
    return deformed;
  }

  const Rig rig_;
  const std::unique_ptr<const WeightEvaluator> evaluator_;
};

// Solvers stop at a residual of 1e-15; closed forms lose a few units.
constexpr double kDouble = 1e-13;

TEST_P(SchemeProperty, WeightsReproduceThePoint) {
  const Positions points = InnerPoints(200);
  const WeightBlock block = Evaluate(points);
  const Columns rest = PosedColumns(rig_, scheme().uses_normals()).rest();
  for (int64_t i = 0; i < points.rows(); ++i) {
    ASSERT_EQ(block.states[i], PointState::kInside);
    Eigen::RowVector3d x =
        block.vertex.row(i) * rest.topRows(block.vertex.cols());
    if (block.normal.cols() > 0) {
      x += block.normal.row(i) * rest.bottomRows(block.normal.cols());
    }
    EXPECT_LT((x - points.row(i)).norm(), kDouble);
  }
}

TEST_P(SchemeProperty, VertexWeightsSumToOne) {
  const WeightBlock block = Evaluate(InnerPoints(200));
  for (int64_t i = 0; i < block.vertex.rows(); ++i) {
    EXPECT_NEAR(block.vertex.row(i).sum(), 1, kDouble);
  }
}

TEST_P(SchemeProperty, NormalsHaveWeightsOnlyIfTheSchemeSaysSo) {
  const WeightBlock block = Evaluate(InnerPoints(3));
  const Cage* cage = std::get_if<Cage>(&rig_);
  EXPECT_EQ(block.normal.cols(),
            scheme().uses_normals() ? cage->face_count() : 0);
  EXPECT_EQ(block.vertex.cols(), RestVertices(rig_).rows());
}

TEST_P(SchemeProperty, APointDoesNotDependOnItsNeighbours) {
  const Positions points = InnerPoints(40);
  const WeightBlock together = Evaluate(points);
  for (int64_t i = 0; i < points.rows(); ++i) {
    const WeightBlock alone = Evaluate(points.row(i));
    EXPECT_LT((alone.vertex.row(0) - together.vertex.row(i)).norm(), kDouble);
  }
}

TEST_P(SchemeProperty, TilesHoldTheSameWeightsToThePrecisionOfFloat) {
  for (const int n : {0, 1, 15, 16, 17, 40}) {
    const Positions points = 1.2 * InnerPoints(n);  // Some are outside.
    const WeightBlock doubles = Evaluate(points);
    const int64_t vertices = doubles.vertex.cols();
    const int64_t columns = vertices + doubles.normal.cols();
    WeightTiles tiles(n, columns);
    TileBlock block{.tiles = tiles.tile(0)};
    std::fill(block.tiles, block.tiles + tiles.bytes() / sizeof(float), NAN);
    evaluator_->EvaluateTiles(points, block);
    EXPECT_EQ(block.states, doubles.states);
    EXPECT_EQ(block.iterations.size(), doubles.iterations.size());
    for (int64_t c = 0; c < columns; ++c) {
      for (int64_t i = 0; i < tiles.tiles() * kTilePoints; ++i) {
        const double expected = i >= n ? 0
                                : c < vertices
                                    ? doubles.vertex(i, c)
                                    : doubles.normal(i, c - vertices);
        ASSERT_NEAR(tiles.at(i, c), expected, i < n ? 1e-6 : 0)
            << "point " << i << " of " << n << ", column " << c;
      }
    }
  }
}

TEST_P(SchemeProperty, AMovedRigMovesTheModelLikewise) {
  Similarity map = Motion();
  map.linear *= 1.7;
  const Positions points = InnerPoints(100);
  const Positions moved =
      Deform(points, {Mapped(RestVertices(rig_), map), /*stretch_blend=*/1});
  const Positions expected = Mapped(points, map);
  EXPECT_LT((moved - expected).rowwise().norm().maxCoeff(), 10 * kDouble);
}

TEST_P(SchemeProperty, ATranslatedRigTranslatesTheModelForAnyStretch) {
  const Similarity map{.to = Vec3(3, 1, 0)};
  const Positions points = InnerPoints(100);
  for (const double blend : {0.0, 0.5}) {
    const Positions moved =
        Deform(points, {Mapped(RestVertices(rig_), map), blend});
    EXPECT_LT((moved - Mapped(points, map)).rowwise().norm().maxCoeff(),
              10 * kDouble);
  }
}

TEST_P(SchemeProperty, WeightsDoNotDependOnWhereTheRigStands) {
  const Similarity map = Motion();
  const Positions points = InnerPoints(100);
  const WeightBlock here = Evaluate(points);
  WeightBlock there;
  Prepare(RigAt(map))->Evaluate(Mapped(points, map), there);
  // Rounding of the moved rig, about 5 from the origin.
  EXPECT_LT((here.vertex - there.vertex).cwiseAbs().maxCoeff(), 10 * kDouble);
  if (here.normal.cols() == 0) return;
  EXPECT_LT((here.normal - there.normal).cwiseAbs().maxCoeff(), 10 * kDouble);
}

TEST_P(SchemeProperty, TheMapIsSmoothInside) {
  const Positions points = InnerPoints(30);
  const Pose pose = Bent();
  const double h = 1e-4;
  Positions step = Positions::Zero(points.rows(), 3);
  step.col(0).setConstant(h);
  step.col(1).setConstant(0.5 * h);
  const Positions second = Deform(points + step, pose) -
                           2 * Deform(points, pose) +
                           Deform(points - step, pose);
  // Second differences of a smooth map are h^2 times its curvature, which is
  // moderate away from the rig.
  EXPECT_LT(second.rowwise().norm().maxCoeff(), 100 * h * h);
}

std::string Name(
    const testing::TestParamInfo<std::tuple<const CoordinateScheme*, int>>&
        test) {
  return std::string(std::get<0>(test.param)->id()) +
         (std::get<1>(test.param) == 2 ? "_2d" : "_3d");
}

INSTANTIATE_TEST_SUITE_P(
    AllSchemes, SchemeProperty,
    testing::Combine(testing::ValuesIn(AllSchemes().begin(),
                                       AllSchemes().end()),
                     testing::Values(2, 3)),
    Name);

// Schemes that reach outside points through an exit face.
class ExitProperty : public SchemeProperty {
 protected:
  // A point of face f, and the same a little inside and outside of it.
  Vec3 OnFace(int64_t f, const Vec3& barycentric) const {
    const Cage& cage = std::get<Cage>(rig_);
    Vec3 x = Vec3::Zero();
    for (int k = 0; k < dimension(); ++k) {
      x += barycentric[k] * cage.vertices().row(cage.faces()(f, k)).transpose();
    }
    return x;
  }
  Vec3 Normal(int64_t f) const {
    const int64_t column = RestVertices(rig_).rows() + f;
    return PosedColumns(rig_, true).rest().row(column);
  }
};

TEST_P(ExitProperty, TheMapIsSmoothAcrossTheExitFace) {
  const Pose pose = Bent();
  const double h = 1e-4;
  for (int64_t f = 0; f < 5; ++f) {
    const Vec3 at =
        OnFace(f, dimension() == 2 ? Vec3(0.4, 0.6, 0) : Vec3(0.3, 0.3, 0.4));
    Positions across(5, 3);
    for (int i = 0; i < 5; ++i) {
      across.row(i) = at + (i - 2) * h * Normal(f);
    }
    const Positions x = Deform(across, pose, f);
    // Neither a step nor a kink: second differences are h^2 times a curvature,
    // which one edge length from the next vertex is moderate.
    for (int i = 1; i < 4; ++i) {
      EXPECT_LT((x.row(i - 1) - 2 * x.row(i) + x.row(i + 1)).norm(),
                100 * h * h)
          << "face " << f << ", step " << i;
    }
  }
}

TEST_P(ExitProperty, OutsidePointsAreReproducedThroughAnyFace) {
  Positions outside(3, 3);
  outside << 3, 0, 0, -2, 4, 0, 0.5, -6, 0;
  for (const PointState state : Evaluate(outside).states) {
    EXPECT_EQ(state, PointState::kOutside);
  }
  const Similarity map = Motion();
  for (int64_t f = 0; f < 5; ++f) {
    const Positions moved =
        Deform(outside, {Mapped(RestVertices(rig_), map), 1}, f);
    // Weights grow with the distance, here about 100-fold.
    EXPECT_LT((moved - Mapped(outside, map)).rowwise().norm().maxCoeff(),
              100 * kDouble);
  }
}

TEST_P(ExitProperty, RowsOfOutsidePointsVanishUntilExtended) {
  Positions outside(1, 3);
  outside << 3, 0, 0;
  WeightBlock block = Evaluate(outside);
  const Columns rest = PosedColumns(rig_, true).rest();
  const auto x = [&]() -> Eigen::RowVector3d {
    return block.vertex.row(0) * rest.topRows(block.vertex.cols()) +
           block.normal.row(0) * rest.bottomRows(block.normal.cols());
  };
  // Without the extension all such points would lie in the origin ([L08]
  // section 4.2).
  EXPECT_NEAR(block.vertex.sum(), 0, kDouble);
  EXPECT_LT(x().norm(), kDouble);
  Extend(outside.row(0), 0, 0, block);
  EXPECT_NEAR(block.vertex.sum(), 1, kDouble);
  EXPECT_LT((x() - outside.row(0)).norm(), 10 * kDouble);
}

std::vector<const CoordinateScheme*> SchemesWithNormals() {
  std::vector<const CoordinateScheme*> schemes;
  for (const CoordinateScheme* scheme : AllSchemes()) {
    if (scheme->uses_normals()) schemes.push_back(scheme);
  }
  return schemes;
}

INSTANTIATE_TEST_SUITE_P(
    SchemesWithNormals, ExitProperty,
    testing::Combine(testing::ValuesIn(SchemesWithNormals()),
                     testing::Values(2, 3)),
    Name);

// Green coordinates are conformal in the plane ([L08] section 3).
class Conformality : public SchemeProperty {};

TEST_P(Conformality, StretchIsTheSameInAllDirections) {
  const Positions points = InnerPoints(50);
  const Pose pose = Bent();
  // Central differences: h^2 of curvature against eps / h of rounding.
  const double h = 1e-5;
  Positions dx = Positions::Zero(points.rows(), 3), dy = dx;
  dx.col(0).setConstant(h);
  dy.col(1).setConstant(h);
  const Positions by_x = Deform(points + dx, pose) - Deform(points - dx, pose);
  const Positions by_y = Deform(points + dy, pose) - Deform(points - dy, pose);
  for (int64_t i = 0; i < points.rows(); ++i) {
    Eigen::Matrix2d jacobian;
    jacobian << by_x(i, 0), by_y(i, 0), by_x(i, 1), by_y(i, 1);
    const Eigen::Vector2d sigma = jacobian.jacobiSvd().singularValues();
    EXPECT_LT(sigma[0] / sigma[1] - 1, 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(Green, Conformality,
                         testing::Combine(testing::Values(*FindScheme("green")),
                                          testing::Values(2)),
                         Name);

}  // namespace
}  // namespace deform
