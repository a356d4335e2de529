// Handles, points among them and their celestial weights.
#pragma once

#include <cstdint>
#include <memory>
#include <ostream>
#include <random>
#include <string>

#include <Eigen/Geometry>

#include "core/mesh/handles.h"
#include "core/weights/scheme.h"
#include "tests/support/shapes.h"

namespace deform {

inline Handles HandlesOf(const Positions& positions, int dimension = 3) {
  return Handles::Create(dimension, positions).value();
}

inline std::unique_ptr<const WeightEvaluator> Prepared(
    const std::string& id, const Rig& rig, const SchemeOptions& options) {
  return FindScheme(id).value()->Prepare(rig, options).value();
}

inline WeightBlock Weights(const std::string& id, const Positions& handles,
                           const Positions& points,
                           const SchemeOptions& options = {},
                           int dimension = 3) {
  WeightBlock block;
  Prepared(id, HandlesOf(handles, dimension), options)->Evaluate(points, block);
  return block;
}

inline Positions OnePoint(double x, double y, double z) {
  Positions point(1, 3);
  point << x, y, z;
  return point;
}

inline Positions CubeCorners() {
  return Cuboid({-1, -1, -1}, {1, 1, 1}).positions;
}

inline Positions RandomPositions(int64_t n, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  Positions positions(n, 3);
  for (int64_t i = 0; i < n; ++i) {
    for (int d = 0; d < 3; ++d) positions(i, d) = uniform(random);
  }
  return positions;
}

// Points strictly inside the hull: mixtures of five handles each.
inline Positions RandomInside(const Positions& handles, int64_t n,
                              std::mt19937_64& random) {
  std::uniform_int_distribution<int64_t> index(0, handles.rows() - 1);
  std::exponential_distribution<double> share;
  Positions points(n, 3);
  for (int64_t i = 0; i < n; ++i) {
    const Vec3 centre = handles.colwise().mean();
    Vec3 sum = 0.05 * centre;
    double total = 0.05;
    for (int k = 0; k < 5; ++k) {
      const double s = share(random);
      sum += s * handles.row(index(random)).transpose();
      total += s;
    }
    points.row(i) = sum / total;
  }
  return points;
}

// A scheme with options, as the tests below go through all of them.
struct Variant {
  std::string name;
  std::string id;
  bool user_weights = false;

  SchemeOptions OptionsFor(int64_t handles) const {
    SchemeOptions options;
    for (int64_t k = 0; user_weights && k < handles; ++k) {
      options.handle_weights.push_back(k % 3 == 0 ? 0.0 : 0.5 * (k % 5));
    }
    return options;
  }
};

inline void PrintTo(const Variant& variant, std::ostream* out) {
  *out << variant.name;
}

// A cube turned out of the axes, with two handles inside.
struct TurnedCube {
  Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.9, Vec3(1, 2, -1).normalized()).toRotationMatrix();
  Vec3 At(double x, double y, double z) const {
    return turn * Vec3(x, y, z) + Vec3(0.3, 0.1, 5);
  }
  Positions handles() const {
    Positions p(10, 3);
    p << CubeCorners(), 0.1, 0.2, 0.3, -0.5, 0.4, 0.1;
    for (int64_t i = 0; i < p.rows(); ++i) {
      p.row(i) = At(p(i, 0), p(i, 1), p(i, 2)).transpose();
    }
    return p;
  }
};

}  // namespace deform
