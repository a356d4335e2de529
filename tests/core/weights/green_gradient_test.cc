#include "core/weights/schemes/green_gradient.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <span>

#include "core/weights/scheme.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

Shape Blob(int dimension) {
  Shape shape = dimension == 3 ? Icosphere(1, 1) : RegularLoop2d(1, 13);
  for (int64_t i = 0; i < shape.positions.rows(); ++i) {
    shape.positions.row(i) *= 1 + 0.3 * std::sin(2.9 * i);
  }
  return shape;
}

class GreenGradientsIn : public testing::TestWithParam<int> {
 protected:
  GreenGradientsIn()
      : cage_(CageOf(Blob(dimension()))),
        faces_(cage_),
        evaluator_((*FindScheme("green"))->Prepare(cage_, {}).value()),
        phi_(cage_.vertex_count(), 3),
        psi_(cage_.face_count(), 3) {}

  static int dimension() { return GetParam(); }

  Vec3 RandomPoint(double reach) {
    std::uniform_real_distribution<double> coordinate(-reach, reach);
    Vec3 point = Vec3::Zero();
    for (int d = 0; d < dimension(); ++d) point[d] = coordinate(random_);
    return point;
  }

  // The weights of a point, extended through `exit_face` if that is one.
  Eigen::VectorXd WeightsAt(const Vec3& point, int exit_face) const {
    WeightBlock block;
    evaluator_->Evaluate(point.transpose(), block);
    Eigen::VectorXd all(phi_.rows() + psi_.rows());
    all << block.vertex.row(0).transpose(), block.normal.row(0).transpose();
    if (exit_face < 0) return all;
    for (const WeightShare& share : evaluator_->Extend(point, exit_face)) {
      all[share.column] += share.weight;
    }
    return all;
  }

  // Central differences of fourth order.
  Eigen::MatrixXd Differences(const Vec3& point, int exit_face,
                              double step) const {
    Eigen::MatrixXd gradients =
        Eigen::MatrixXd::Zero(phi_.rows() + psi_.rows(), 3);
    for (int d = 0; d < dimension(); ++d) {
      const auto at = [&](double steps) {
        return WeightsAt(point + steps * step * Vec3::Unit(d), exit_face);
      };
      gradients.col(d) =
          (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step);
    }
    return gradients;
  }

  Eigen::MatrixXd ClosedForm(const Vec3& point, int exit_face) {
    EXPECT_TRUE(evaluator_->Differentiate(point, exit_face, phi_, psi_));
    Eigen::MatrixXd gradients(phi_.rows() + psi_.rows(), 3);
    gradients << phi_, psi_;
    return gradients;
  }

  const Cage cage_;
  const CageFaces faces_;
  const std::unique_ptr<const WeightEvaluator> evaluator_;
  Positions phi_, psi_;
  std::mt19937_64 random_{17};
};

TEST_P(GreenGradientsIn, AgreeWithDifferencesInside) {
  int inside = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3 point = RandomPoint(0.9);
    const double distance = faces_.NearestOf(point).distance;
    if (distance < 1e-3 || WindingNumber(cage_, point) < 0.5) continue;
    ++inside;
    const double step = 2e-3 * distance;
    const double error = (ClosedForm(point, -1) - Differences(point, -1, step))
                             .cwiseAbs()
                             .maxCoeff();
    // Differences: rounding of 1e-15 over the step, and (step / distance)^4.
    EXPECT_LT(error, 1e-14 / step + 1e-9 / distance) << point.transpose();
  }
  EXPECT_GT(inside, 50);
}

TEST_P(GreenGradientsIn, AgreeWithDifferencesOfTheExtension) {
  int outside = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3 point = RandomPoint(2);
    const CageFaces::Nearest nearest = faces_.NearestOf(point);
    if (nearest.distance < 1e-2 || WindingNumber(cage_, point) > 0.5) continue;
    ++outside;
    const int exit = static_cast<int>(nearest.face);
    const double step = 2e-3 * nearest.distance;
    const double error =
        (ClosedForm(point, exit) - Differences(point, exit, step))
            .cwiseAbs()
            .maxCoeff();
    EXPECT_LT(error, 1e-14 / step + 1e-9 / nearest.distance);
  }
  EXPECT_GT(outside, 50);
}

// x = sum phi v + sum psi n and sum phi = 1, differentiated: exact wherever
// the point is.
TEST_P(GreenGradientsIn, ReproduceTheIdentityNextToFacesEdgesAndVertices) {
  Eigen::Matrix3d identity = Eigen::Matrix3d::Zero();
  for (int d = 0; d < dimension(); ++d) identity(d, d) = 1;
  for (int64_t f = 0; f < faces_.size(); f += 3) {
    const CageFaces::Face& face = faces_[f];
    const Vec3 middle = 0.5 * (face.position[0] + face.position[1]);
    const Vec3 inner =
        dimension() == 3 ? Vec3((2 * middle + face.position[2]) / 3) : middle;
    for (const Vec3& place : {inner, middle, face.position[0]}) {
      for (const double distance : {1e-2, 1e-5, 1e-8}) {
        // Towards the middle, which lies inside of the star-shaped cage.
        const Vec3 point = place - distance * place.normalized();
        ClosedForm(point, -1);
        Eigen::Matrix3d jacobian = cage_.vertices().transpose() * phi_;
        for (int64_t k = 0; k < faces_.size(); ++k) {
          jacobian += faces_[k].normal * psi_.row(k);
        }
        // Gradients are as large as 1 / distance next to an edge, and lose
        // that many digits.
        EXPECT_LT((jacobian - identity).norm(), 1e-13 / distance) << f;
        EXPECT_LT(phi_.colwise().sum().norm(), 1e-13 / distance) << f;
      }
    }
  }
}

TEST_P(GreenGradientsIn, StayInThePlaneIn2D) {
  if (dimension() == 3) return;
  ClosedForm(RandomPoint(0.5), -1);
  EXPECT_EQ(phi_.col(2).cwiseAbs().maxCoeff(), 0);
  EXPECT_EQ(psi_.col(2).cwiseAbs().maxCoeff(), 0);
}

INSTANTIATE_TEST_SUITE_P(, GreenGradientsIn, testing::Values(2, 3),
                         [](const auto& test) {
                           return test.param == 2 ? "Plane" : "Space";
                         });

}  // namespace
}  // namespace deform
