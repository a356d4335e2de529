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

// The planes of the hull's faces: inward . x >= offset for all handles. Found
// by trying all triples; planes within rounding of a handle are all kept.
struct Plane {
  Vec3 inward;
  double offset;
  int64_t corner[3];
};

std::vector<Plane> HullOf(const Positions& handles) {
  std::vector<Plane> hull;
  const int64_t n = handles.rows();
  const double slack = 1e-13 * BoxOf(handles).diagonal();
  for (int64_t a = 0; a < n; ++a) {
    for (int64_t b = a + 1; b < n; ++b) {
      const Vec3 ab = (handles.row(b) - handles.row(a)).transpose();
      for (int64_t c = b + 1; c < n; ++c) {
        Vec3 normal =
            ab.cross((handles.row(c) - handles.row(a)).transpose().head<3>());
        if (!(normal.norm() > 0)) continue;
        normal.normalize();
        double least = 0, most = 0;
        for (int64_t i = 0; i < n && (least >= -slack || most <= slack); ++i) {
          const double side = (handles.row(i) - handles.row(a)).dot(normal);
          least = std::min(least, side);
          most = std::max(most, side);
        }
        if (least < -slack && most > slack) continue;
        if (most <= slack) normal = -normal;
        hull.push_back({normal, handles.row(a).dot(normal), {a, b, c}});
      }
    }
  }
  return hull;
}

double DistanceTo(const std::vector<Plane>& hull, const Vec3& point) {
  double distance = std::numeric_limits<double>::infinity();
  for (const Plane& plane : hull) {
    distance = std::min(distance, plane.inward.dot(point) - plane.offset);
  }
  return distance;
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
Positions PointsAmong(const Positions& handles, const std::vector<Plane>& hull,
                      const Configuration& configuration, int64_t count,
                      Random& random) {
  const double diagonal = BoxOf(handles).diagonal();
  const Vec3 middle = handles.colwise().mean().transpose();
  Positions points(count, 3);
  for (int64_t i = 0; i < count; ++i) {
    Positions corners(4, 3);
    for (int k = 0; k < 4; ++k) {
      corners.row(k) = handles.row(Below(random, handles.rows()));
    }
    points.row(i) = Within(corners, random).transpose();
    if (!configuration.near_hull) continue;
    const Plane& face = hull[Below(random, std::ssize(hull))];
    for (int k = 0; k < 3; ++k) corners.row(k) = handles.row(face.corner[k]);
    const Vec3 on_face = Within(corners.topRows(3), random);
    const double depth = std::pow(10, Uniform(random, -6, -1)) * diagonal;
    const double whole = face.inward.dot(middle) - face.offset;
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

void Count(const Positions& handles, const Positions& points,
           const std::vector<double>& distances, bool weighted,
           const WeightBlock& block, SweepRow& row) {
  for (int64_t i = 0; i < points.rows(); ++i) {
    // Closer than rounding, in or out is a matter of luck.
    if (!(distances[i] > 1e-13)) continue;
    ++row.points;
    row.steps += block.iterations[i];
    // The planes of faces within a cluster are known to some 1e-10 only. On the
    // hull T-CC with user weights has no solution and says so.
    const bool on_hull =
        distances[i] < 1e-8 &&
        (block.states[i] == PointState::kBoundary ||
         (weighted && block.states[i] == PointState::kOutsideHull));
    if (block.states[i] != PointState::kInside && !on_hull) {
      ++row.failures;
      continue;
    }
    if (block.states[i] == PointState::kOutsideHull) continue;
    const double residual =
        ResidualOf(handles, points.row(i), block.vertex.row(i));
    if (distances[i] >= 1e-6) {
      row.steps_max = std::max<int>(row.steps_max, block.iterations[i]);
    } else {
      ++row.in_skin;
    }
    double& worst = distances[i] >= 1e-3   ? row.residual_far
                    : distances[i] >= 1e-6 ? row.residual_near
                                           : row.residual_skin;
    worst = std::max(worst, residual);
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
  const std::vector<Plane> hull = HullOf(handles);
  if (!rig.ok() || hull.empty()) return;
  const Positions points =
      PointsAmong(handles, hull, configuration, count, random);
  std::vector<double> distances;
  for (int64_t i = 0; i < count; ++i) {
    distances.push_back(DistanceTo(hull, points.row(i)) / rig->diagonal());
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
    Count(handles, points, distances, kCases[k].weighted, block, rows[k]);
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
