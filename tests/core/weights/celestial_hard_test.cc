// Celestial weights where searches are hard: every point is solved, exactly and
// in few steps.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "tests/core/weights/celestial_cases.h"

namespace deform {
namespace {

// |sum beta q| / sum beta, from the weights: alpha_i d_i is beta_i up to a
// factor.
double Residual(const WeightBlock& block, const Positions& handles,
                const Positions& points, int64_t i) {
  Vec3 sum = Vec3::Zero();
  double total = 0;
  for (int64_t k = 0; k < handles.rows(); ++k) {
    const Vec3 offset = (handles.row(k) - points.row(i)).transpose();
    sum += block.vertex(i, k) * offset;
    total += block.vertex(i, k) * offset.norm();
  }
  return sum.norm() / total;
}

// Handles and points inside that are hard in their own way.
struct Scene {
  Positions handles;
  Positions points;
};

Scene Random30(int64_t n, std::mt19937_64& random) {
  const Positions handles = RandomPositions(30, random);
  return {handles, RandomInside(handles, n, random)};
}

Scene Random200(int64_t n, std::mt19937_64& random) {
  const Positions handles = RandomPositions(200, random);
  return {handles, RandomInside(handles, n, random)};
}

// Four clusters of six handles, a thousandth wide.
Scene Clustered(int64_t n, std::mt19937_64& random) {
  const Positions corners = Tetrahedron().positions;
  Positions handles = 1e-3 * RandomPositions(24, random);
  for (int64_t k = 0; k < 24; ++k) handles.row(k) += corners.row(k / 6);
  return {handles, RandomInside(handles, n, random)};
}

// All handles but three on one side of most points.
Scene Skew(int64_t n, std::mt19937_64& random) {
  Positions handles = 0.2 * RandomPositions(24, random);
  handles.row(0) << 10, 0, 0;
  handles.row(1) << 0, 10, 0;
  handles.row(2) << 0, 0, 10;
  return {handles, RandomInside(handles, n, random)};
}

// 1e-6 of the diagonal inside a face of a turned cube.
Scene NearHull(int64_t n, std::mt19937_64& random) {
  const TurnedCube cube;
  std::uniform_real_distribution<double> uniform(-0.98, 0.98);
  Positions points(n, 3);
  for (int64_t i = 0; i < n; ++i) {
    points.row(i) = cube.At(1 - 3.5e-6, uniform(random), uniform(random));
  }
  return {cube.handles(), points};
}

struct NamedScene {
  std::string name;
  Scene (*draw)(int64_t, std::mt19937_64&);
};

void PrintTo(const NamedScene& scene, std::ostream* out) { *out << scene.name; }

class CelestialNeverFails : public testing::TestWithParam<NamedScene> {};

INSTANTIATE_TEST_SUITE_P(, CelestialNeverFails,
                         testing::Values(NamedScene{"Random", &Random30},
                                         NamedScene{"Clustered", &Clustered},
                                         NamedScene{"Skew", &Skew},
                                         NamedScene{"NearHull", &NearHull},
                                         NamedScene{"TwoHundredHandles",
                                                    &Random200}),
                         [](const auto& test) { return test.param.name; });

// 7000 points, a hundred for each of 70 sets of handles.
void ExpectSolved(const Variant& variant,
                  Scene (*scene)(int64_t, std::mt19937_64&),
                  double residual_bound, int iteration_bound) {
  std::mt19937_64 random(11);
  double residual = 0;
  int iterations = 0;
  int64_t failures = 0;
  for (int draw = 0; draw < 70; ++draw) {
    const Scene drawn = scene(100, random);
    const WeightBlock block = Weights(variant.id, drawn.handles, drawn.points,
                                      variant.OptionsFor(drawn.handles.rows()));
    for (int64_t i = 0; i < drawn.points.rows(); ++i) {
      if (block.states[i] != PointState::kInside) {
        ++failures;
        continue;
      }
      residual =
          std::max(residual, Residual(block, drawn.handles, drawn.points, i));
      iterations = std::max<int>(iterations, block.iterations[i]);
    }
  }
  EXPECT_EQ(failures, 0);
  EXPECT_LE(residual, residual_bound);
  EXPECT_LE(iterations, iteration_bound);
}

TEST_P(CelestialNeverFails, ByScaling) {
  ExpectSolved({"", "s_cc"}, GetParam().draw, 1e-12, 25);
}

TEST_P(CelestialNeverFails, ByTranslation) {
  ExpectSolved({"", "t_cc"}, GetParam().draw, 1e-12, 25);
}

TEST_P(CelestialNeverFails, ByTranslationWithUserWeights) {
  // Next to the hull the exponents are huge and cost digits.
  const bool near = GetParam().name == "NearHull";
  ExpectSolved({"", "t_cc", true}, GetParam().draw, near ? 1e-9 : 1e-12,
               near ? 200 : 60);
}

}  // namespace
}  // namespace deform
