// Time of celestial coordinates per point: the plain way and the lanes of every
// instruction set, in one run.
//
//   celestial_bench [handles]
//
// CPU time of one thread; the better of three passes over a sphere of 40962
// points among handles on and within a larger one, in blocks as Bind() cuts
// them.
#include <cstdio>
#include <cstdlib>
#include <random>

#include <hwy/targets.h>

#include "core/mesh/handles.h"
#include "core/weights/blocks.h"
#include "core/weights/schemes/celestial_evaluator.h"
#include "core/weights/schemes/celestial_lanes.h"
#include "tests/bench/timing.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

Handles SomeHandles(int count) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  Positions positions(count, 3);
  for (int k = 0; k < count; ++k) {
    const Vec3 v(normal(random), normal(random), normal(random));
    positions.row(k) = v.normalized() * (k % 3 == 0 ? 0.6 : 1.0);
  }
  return Handles::Create(3, positions).value();
}

// Microseconds per point.
double Measure(const WeightEvaluator& evaluator, const Positions& points,
               int64_t block_points) {
  WeightBlock block;
  const int64_t blocks = (points.rows() + block_points - 1) / block_points;
  const double best = bench::BestCpuSeconds(3, [&] {
    for (int64_t b = 0; b < blocks; ++b) {
      const Block at = BlockAt(b, block_points, points.rows());
      evaluator.Evaluate(points.middleRows(at.first, at.count), block);
    }
  });
  return 1e6 * best / static_cast<double>(points.rows());
}

void Run(const Handles& handles, CelestialKind kind) {
  Positions points = Icosphere(0.3, 6).positions;
  points.col(0) *= 1.2;
  const auto measure = [&](CelestialWay way) {
    return Measure(*MakeCelestialEvaluator(kind, handles, {}, way), points,
                   BlockPoints(handles.size()));
  };
  const char* scheme = kind == CelestialKind::kScaling ? "s_cc" : "t_cc";
  const double plain = measure(CelestialWay::kPlain);
  std::printf("%s plain   %7.3f us/point\n", scheme, plain);
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    const OnInstructionSet set(target);
    const double lanes = measure(CelestialWay::kLanes);
    std::printf("%s %-7s %7.3f us/point, %4.1f x\n", scheme,
                hwy::TargetName(target), lanes, plain / lanes);
  }
}

}  // namespace
}  // namespace deform

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 30;
  if (count < 8) {
    std::fprintf(stderr, "at least 8 handles\n");
    return 2;
  }
  const deform::Handles handles = deform::SomeHandles(count);
  deform::Run(handles, deform::CelestialKind::kScaling);
  deform::Run(handles, deform::CelestialKind::kTranslation);
}
