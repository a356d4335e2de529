// Several ways to do the same, timed side by side.
#pragma once

#include <algorithm>
#include <chrono>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "tests/bench/timing.h"

namespace deform::bench {

// Runs its contestants in turn, round after round, so that what else the
// machine does hits all of them alike, and keeps the best time of each.
class Contest {
 public:
  // What `run` takes: this thread's time on its core, or, if it uses several,
  // the time that passes.
  enum class Clock { kCore, kWall };

  // `count` is how often `run` does the thing; run() is called once to warm up.
  void Add(std::string name, std::function<void()> run, double count = 1,
           Clock clock = Clock::kCore) {
    contestants_.push_back({std::move(name), std::move(run), count, clock});
  }

  // At least `rounds`, and until `seconds` have passed.
  void Run(int rounds, double seconds) {
    for (Contestant& c : contestants_) c.run();
    const double begin = Now(Clock::kWall);
    for (int r = 0; r < rounds || Now(Clock::kWall) - begin < seconds; ++r) {
      for (Contestant& c : contestants_) {
        const double start = Now(c.clock);
        c.run();
        c.best = std::min(c.best, (Now(c.clock) - start) / c.count);
      }
    }
  }

  // Seconds of one, the best of all rounds; 0 if there is none of this name.
  double Best(const std::string& name) const {
    const auto found =
        std::find_if(contestants_.begin(), contestants_.end(),
                     [&](const Contestant& c) { return c.name == name; });
    return found == contestants_.end() ? 0 : found->best;
  }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const Contestant& c : contestants_) names.push_back(c.name);
    return names;
  }

 private:
  struct Contestant {
    std::string name;
    std::function<void()> run;
    double count;
    Clock clock;
    double best = std::numeric_limits<double>::infinity();
  };
  static double Now(Clock clock) {
    if (clock == Clock::kCore) return CpuSeconds();
    return std::chrono::duration<double>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }

  std::vector<Contestant> contestants_;
};

}  // namespace deform::bench
