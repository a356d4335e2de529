#include <algorithm>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/thread_pool.h"
#include "core/kernels/zeroed_array.h"
#include "tests/bench/baselines/baselines.h"
#include "tests/bench/benches.h"
#include "tests/bench/contest.h"

namespace deform::bench {
namespace {

constexpr int64_t kLine = 16;  // Floats.

}  // namespace

ReadLimit MeasureMemory(const Settings& settings, const AddRow& add) {
  // As large as the weights of a large model: 225 MB.
  const int64_t count = settings.Points(173'000) * 326 / kLine * kLine;
  ZeroedArray<float> buffer(count);
  std::fill_n(buffer.data(), count, 1.0F);
  ThreadPool pool({});
  const int threads = pool.threads();
  const int64_t part = count / threads / kLine * kLine;
  std::vector<float> kept(threads);
  Contest contest;
  for (const int walks : {1, 4, 8}) {
    contest.Add(absl::StrCat(walks, " walks, 1 core"), [&, walks] {
      kept[0] += ReadAll(buffer.data(), count, walks);
    });
    contest.Add(
        absl::StrCat(walks, " walks, all cores"),
        [&, walks] {
          pool.ParallelFor(threads, nullptr, [&](int64_t t) {
            kept[t] += ReadAll(buffer.data() + t * part, part, walks);
          });
        },
        1, Contest::Clock::kWall);
  }
  contest.Run(5, settings.Seconds(5));
  ReadLimit limit;
  const double bytes = static_cast<double>(count) * sizeof(float);
  for (const std::string& name : contest.Names()) {
    const double rate = bytes / contest.Best(name);
    double& best =
        absl::EndsWith(name, "1 core") ? limit.one_core : limit.all_cores;
    best = std::max(best, rate);
    add({.name = absl::StrCat("memory read/", name),
         .seconds = contest.Best(name),
         .rate = rate / 1e9,
         .unit = "GB/s",
         .megabytes = bytes / 1e6});
  }
  return limit;
}

}  // namespace deform::bench
