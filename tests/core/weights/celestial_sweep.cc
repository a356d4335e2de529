#include "tests/core/weights/celestial_sweep.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "absl/strings/str_format.h"
#include "core/base/mutex.h"
#include "core/mesh/mesh.h"
#include "core/weights/scheme.h"
#include "tests/core/weights/hull_planes.h"

namespace deform {
namespace {

using Random = std::mt19937_64;

// Standard distributions differ between libraries; this does not.
double Uniform(Random& random) {
  return static_cast<double>(random() >> 11) * 0x1p-53;
}
double Uniform(Random& random, double from, double to) {
  return from + (to - from) * Uniform(random);
}
int64_t Below(Random& random, int64_t count) {
  return static_cast<int64_t>(Uniform(random) * static_cast<double>(count));
}
Vec3 InCube(Random& random) {
  return {Uniform(random, -1, 1), Uniform(random, -1, 1),
          Uniform(random, -1, 1)};
}
Eigen::Matrix3d Rotation(Random& random) {
  const Eigen::Quaterniond q(Uniform(random, -1, 1), Uniform(random, -1, 1),
                             Uniform(random, -1, 1), Uniform(random, -1, 1));
  return q.normalized().toRotationMatrix();
}

// A place in the simplex of some corners, uniformly.
Vec3 Within(const Positions& corners, Random& random) {
  Eigen::VectorXd share(corners.rows());
  for (double& s : share) s = -std::log(1 - Uniform(random));
  return (share.transpose() * corners / share.sum()).transpose();
}

struct Configuration {
  const char* name;
  Positions (*handles)(Random& random);
  bool near_hull;
  int64_t points;  // Per set of handles.
};

Positions RandomHandles(Random& random) {
  Positions handles(8 + Below(random, 23), 3);
  for (int64_t i = 0; i < handles.rows(); ++i) {
    handles.row(i) = InCube(random).transpose();
  }
  return handles;
}

// Five places, each with handles up to 1e-6 to 1e-1 away from it.
Positions ClusteredHandles(Random& random) {
  Positions handles(25, 3);
  for (int64_t i = 0; i < 25; i += 5) {
    const Vec3 center = InCube(random);
    const double radius = std::pow(10, Uniform(random, -6, -1));
    for (int64_t k = i; k < i + 5; ++k) {
      handles.row(k) = (center + radius * InCube(random)).transpose();
    }
  }
  return handles;
}

// Few handles, pressed flat and thin.
Positions SkewHandles(Random& random) {
  Positions handles(4 + Below(random, 5), 3);
  const Vec3 scale(1, std::pow(10, Uniform(random, -2, 0)),
                   std::pow(10, Uniform(random, -3, -1)));
  const Eigen::Matrix3d map =
      Rotation(random) * scale.asDiagonal() * Rotation(random);
  for (int64_t i = 0; i < handles.rows(); ++i) {
    handles.row(i) = (map * InCube(random)).transpose();
  }
  return handles;
}

// A cube, somehow turned, with some handles in it and on it.
Positions HandlesOfABox(Random& random) {
  Positions handles(20, 3);
  const Eigen::Matrix3d turn = Rotation(random);
  for (int64_t i = 0; i < 20; ++i) {
    const Vec3 corner(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    handles.row(i) = (turn * (i < 8 ? corner : InCube(random))).transpose();
  }
  return handles;
}

Positions ManyHandles(Random& random) {
  Positions handles(200, 3);
  for (int64_t i = 0; i < 200; ++i) handles.row(i) = InCube(random).transpose();
  return handles;
}

constexpr Configuration kConfigurations[] = {
    {"random", RandomHandles, false, 1000},
    {"clustered", ClusteredHandles, false, 1000},
    {"skew", SkewHandles, false, 1000},
    {"near-hull", HandlesOfABox, true, 1000},
    {"200-handle", ManyHandles, false, 50'000},
};

// Strictly inside: in the simplex of four handles, or a step from a face of the
// hull towards the middle.
Positions PointsAmong(const Positions& handles,
                      const std::vector<HullPlane>& hull,
                      const Configuration& configuration, int64_t count,
                      Random& random) {
  const double diagonal = BoxOf(handles).diagonal();
  const Vec3 middle = handles.colwise().mean().transpose();
  Positions points(count, 3);
  for (int64_t i = 0; i < count; ++i) {
    Positions corners(4, 3);
    int64_t chosen[4];
    for (int k = 0; k < 4; ++k) {
      do {
        chosen[k] = Below(random, handles.rows());
      } while (std::find(chosen, chosen + k, chosen[k]) != chosen + k);
      corners.row(k) = handles.row(chosen[k]);
    }
    points.row(i) = Within(corners, random).transpose();
    if (!configuration.near_hull) continue;
    const HullPlane& face = hull[Below(random, std::ssize(hull))];
    for (int k = 0; k < 3; ++k) corners.row(k) = handles.row(face.corner[k]);
    const Vec3 on_face = Within(corners.topRows(3), random);
    const double depth = std::pow(10, Uniform(random, -6, -1)) * diagonal;
    const double whole = DepthInHull(handles, {face}, middle);
    points.row(i) =
        (on_face + std::min(0.9, depth / whole) * (middle - on_face))
            .transpose();
  }
  return points;
}

double ResidualOf(const Positions& handles, const Vec3& point,
                  const Eigen::RowVectorXd& weights) {
  Vec3 sum = Vec3::Zero();
  double total = 0;
  for (int64_t k = 0; k < handles.rows(); ++k) {
    const Vec3 offset = handles.row(k).transpose() - point;
    sum += weights[k] * offset;
    total += weights[k] * offset.norm();
  }
  return total > 0 ? sum.norm() / total : 0;
}

struct Case {
  const char* name;
  const char* scheme;
  bool weighted;
};
constexpr Case kCases[] = {{"S-CC", "s_cc", false},
                           {"T-CC", "t_cc", false},
                           {"T-CC s > 0", "t_cc", true}};

// Not further inside than this, whether a point is inside or on the hull is for
// rounding to say.
constexpr double kRounding = 1e-15;

// Inside by no more than this a point may be taken for one on the hull.
constexpr double kHullDepth = 1e-13;

// Adds the residual of a bound point to those of its distance to the hull.
void AddResidual(double depth, double residual, int steps, SweepRow& row) {
  if (depth >= 1e-6) {
    row.steps_max = std::max(row.steps_max, steps);
  } else {
    ++row.in_skin;
  }
  double& worst = depth >= 1e-3   ? row.residual_far
                  : depth >= 1e-6 ? row.residual_near
                                  : row.residual_skin;
  worst = std::max(worst, residual);
}

void Count(const Positions& handles, const Positions& points,
           const std::vector<double>& depths, bool weighted,
           const WeightBlock& block, SweepRow& row) {
  for (int64_t i = 0; i < points.rows(); ++i) {
    if (!(depths[i] > kRounding)) continue;
    ++row.points;
    row.steps += block.iterations[i];
    const PointState state = block.states[i];
    // On the hull T-CC with user weights has no solution and says so.
    const bool refused = weighted && state == PointState::kOutsideHull;
    if (state == PointState::kBoundary || refused) {
      ++row.on_hull;
      row.on_hull_depth = std::max(row.on_hull_depth, depths[i]);
    } else if (state != PointState::kInside) {
      ++row.failures;
      continue;
    }
    if (refused) continue;
    AddResidual(depths[i],
                ResidualOf(handles, points.row(i), block.vertex.row(i)),
                block.iterations[i], row);
  }
}

void Merge(const SweepRow& from, SweepRow& to) {
  to.points += from.points;
  to.failures += from.failures;
  to.steps += from.steps;
  to.steps_max = std::max(to.steps_max, from.steps_max);
  to.residual_far = std::max(to.residual_far, from.residual_far);
  to.residual_near = std::max(to.residual_near, from.residual_near);
  to.residual_skin = std::max(to.residual_skin, from.residual_skin);
  to.in_skin += from.in_skin;
  to.on_hull += from.on_hull;
  to.on_hull_depth = std::max(to.on_hull_depth, from.on_hull_depth);
}

// User weights of all sizes, and none for some.
std::vector<double> SomeWeights(int64_t handles, Random& random) {
  std::vector<double> weights(handles);
  for (double& s : weights) {
    const double kind = Uniform(random);
    s = kind < 0.3   ? 0
        : kind < 0.6 ? 1e-3 * Uniform(random)
                     : 2 * Uniform(random);
  }
  weights[0] = 0.5;
  return weights;
}

// One set of handles, and its points.
void SweepSet(const Configuration& configuration, uint64_t seed, int64_t count,
              SweepRow (&rows)[std::size(kCases)]) {
  Random random(seed);
  const Positions handles = configuration.handles(random);
  const auto rig = Handles::Create(3, handles);
  const std::vector<HullPlane> hull = HullPlanesOf(handles);
  if (!rig.ok() || hull.empty()) return;
  const Positions points =
      PointsAmong(handles, hull, configuration, count, random);
  std::vector<double> depths;
  for (int64_t i = 0; i < count; ++i) {
    depths.push_back(DepthInHull(handles, hull, points.row(i)) /
                     rig->diagonal());
  }
  for (size_t k = 0; k < std::size(kCases); ++k) {
    SchemeOptions options;
    if (kCases[k].weighted) {
      options.handle_weights = SomeWeights(handles.rows(), random);
    }
    const auto evaluator =
        (*FindScheme(kCases[k].scheme))->Prepare(Rig(*rig), options).value();
    WeightBlock block;
    evaluator->Evaluate(points, block);
    Count(handles, points, depths, kCases[k].weighted, block, rows[k]);
  }
}

}  // namespace

std::vector<SweepRow> SweepCelestial(int64_t points, ThreadPool* pool) {
  std::vector<SweepRow> all;
  uint64_t seed = 1;
  for (const Configuration& configuration : kConfigurations) {
    const int64_t per_set = std::min(configuration.points, points);
    const int64_t sets = (points + per_set - 1) / per_set;
    SweepRow total[std::size(kCases)];
    Mutex mutex;
    const auto sweep = [&](int64_t set) {
      SweepRow rows[std::size(kCases)];
      SweepSet(configuration, seed + static_cast<uint64_t>(set), per_set, rows);
      MutexLock lock(mutex);
      for (size_t k = 0; k < std::size(kCases); ++k) Merge(rows[k], total[k]);
    };
    if (pool != nullptr) {
      pool->ParallelFor(sets, nullptr, sweep);
    } else {
      for (int64_t set = 0; set < sets; ++set) sweep(set);
    }
    for (size_t k = 0; k < std::size(kCases); ++k) {
      total[k].configuration = configuration.name;
      total[k].scheme = kCases[k].name;
      all.push_back(total[k]);
    }
    seed += 1'000'000;
  }
  return all;
}

std::string BrokenPromise(const SweepRow& row) {
  const bool weighted = row.scheme == "T-CC s > 0";
  if (row.points == 0) return "no points";
  if (row.failures > 0) return absl::StrFormat("%d failures", row.failures);
  if (!(row.on_hull_depth <= kHullDepth)) {
    return absl::StrFormat("taken for on the hull at %.1e D inside",
                           row.on_hull_depth);
  }
  if (!(row.residual_far <= 1e-12)) {
    return absl::StrFormat("residual %.1e", row.residual_far);
  }
  if (!(row.residual_near <= (weighted ? 1e-9 : 1e-12))) {
    return absl::StrFormat("residual %.1e next to the hull", row.residual_near);
  }
  if (!weighted && row.steps_max > 25) {
    return absl::StrFormat("%d steps", row.steps_max);
  }
  return "";
}

}  // namespace deform
