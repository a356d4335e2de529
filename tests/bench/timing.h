// Time as measurements count it.
#pragma once

#include <ctime>

#include <algorithm>
#include <limits>

namespace deform::bench {

// Of this thread on its core, in seconds: what other programs do counts little.
inline double CpuSeconds() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * now.tv_nsec;
}

// The best of `passes` runs of body(), in seconds.
template <typename Body>
double BestCpuSeconds(int passes, Body body) {
  double best = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < passes; ++pass) {
    const double begin = CpuSeconds();
    body();
    best = std::min(best, CpuSeconds() - begin);
  }
  return best;
}

}  // namespace deform::bench
