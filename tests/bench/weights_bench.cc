// Time of cage coordinates per point and face: the plain closed form, the lanes
// of the best instruction set (or of every one), Bind() as a whole, and
// Algorithm 2 of [L08], in one run.
//
//   weights_bench [points] [--every-instruction-set]
//
// CPU time of one core, the best of several passes in turns.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <hwy/targets.h>

#include "tests/bench/weights_measure.h"
#include "tests/support/instruction_sets.h"

namespace deform::bench {
namespace {

void Print(const WeightsScene& scene, int64_t target) {
  const OnInstructionSet set(target);
  std::printf("\n%s: %lld points, V = %lld, F = %lld, %s\n", scene.name.c_str(),
              static_cast<long long>(scene.points.rows()),
              static_cast<long long>(scene.cage.vertex_count()),
              static_cast<long long>(scene.cage.face_count()),
              hwy::TargetName(target));
  const auto results = MeasureWeights(scene);
  for (const WeightsResult& result : results) {
    std::printf("  %-18s %9.2f ns  %7.2f x plain  error %.1e\n",
                result.way.c_str(), 1e9 * result.seconds_per_point_and_face,
                results[0].seconds_per_point_and_face /
                    result.seconds_per_point_and_face,
                result.error);
  }
}

}  // namespace
}  // namespace deform::bench

int main(int argc, char** argv) {
  int64_t points = 3000;
  bool every = false;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--every-instruction-set") == 0) {
      every = true;
    } else if ((points = std::atoll(argv[i])) < 2) {
      std::fprintf(stderr,
                   "weights_bench [points] [--every-instruction-set]\n");
      return 2;
    }
  }
  const auto targets = hwy::SupportedAndGeneratedTargets();
  for (const auto& scene : deform::bench::WeightsScenes(points)) {
    for (const int64_t target : targets) {
      deform::bench::Print(scene, target);
      if (!every) break;  // The best comes first.
    }
  }
}
