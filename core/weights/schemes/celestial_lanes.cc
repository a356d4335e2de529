#include "core/weights/schemes/celestial_lanes.h"

namespace deform {

LaneSolver PortableLanes(const char* name);
#ifdef DEFORM_X86_LANES
LaneSolver Avx2Lanes(const char* name);
LaneSolver Avx512Lanes(const char* name);
#endif

LaneSolvers RunnableLaneSolvers() {
  LaneSolvers solvers = {};
  const auto add = [&](const LaneSolver& solver) {
    solvers.entries[solvers.count++] = solver;
  };
#ifdef DEFORM_X86_LANES
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    add(Avx512Lanes("avx512"));
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    add(Avx2Lanes("avx2"));
  }
#endif
  add(PortableLanes("portable"));
  return solvers;
}

}  // namespace deform
