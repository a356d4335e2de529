// celestial_sweep [POINTS]: prints the table of SweepCelestial(), by default of
// 10^6 points a line, and fails if a promise is broken.
#include <chrono>
#include <cstdlib>
#include <iostream>

#include "absl/strings/str_format.h"
#include "tests/core/weights/celestial_sweep.h"

int main(int argc, char** argv) {
  const int64_t points = argc > 1 ? std::atoll(argv[1]) : 1'000'000;
  if (points <= 0) {
    std::cerr << "celestial_sweep [POINTS]\n";
    return 2;
  }
  deform::ThreadPool pool({});
  const auto begin = std::chrono::steady_clock::now();
  const auto rows = deform::SweepCelestial(points, &pool);
  std::cout
      << "Residuals by distance to the hull, in diagonals of the handles' "
         "box.\nOn hull are points taken for ones on the hull; depth is how "
         "far inside the\nfurthest of them lies, found from the hull's planes "
         "in more digits.\n";
  std::cout << absl::StrFormat(
      "%-11s %-11s %8s %8s %6s %5s %9s %9s %9s %8s %8s %8s\n", "handles",
      "scheme", "points", "failures", "steps", "most", ">= 1e-3", ">= 1e-6",
      "nearer", "(points)", "on hull", "depth");
  int broken = 0;
  for (const deform::SweepRow& row : rows) {
    const std::string promise = deform::BrokenPromise(row);
    broken += !promise.empty();
    std::cout << absl::StrFormat(
        "%-11s %-11s %8d %8d %6.2f %5d %9.1e %9.1e %9.1e %8d %8d %8.1e%s\n",
        row.configuration, row.scheme, row.points, row.failures,
        static_cast<double>(row.steps) / static_cast<double>(row.points),
        row.steps_max, row.residual_far, row.residual_near, row.residual_skin,
        row.in_skin, row.on_hull, row.on_hull_depth,
        promise.empty() ? "" : "  BROKEN: " + promise);
  }
  const std::chrono::duration<double> took =
      std::chrono::steady_clock::now() - begin;
  std::cout << absl::StrFormat("%.0f s\n", took.count());
  return broken == 0 ? 0 : 1;
}
