// Compares frames beside a run, on a thread of its own that yields to others.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <thread>

#include "client/load/frame_judge.h"
#include "client/load/load_session.h"
#include "core/base/mutex.h"

namespace deform {

// A frame that is not what its pose makes of the model.
struct WrongFrame {
  int64_t session = 0;  // By number.
  uint64_t revision = 0;
  int64_t vertex = 0;
  double error = 0;  // As FrameJudge tells it.
};

// Thread-safe.
class FrameChecker {
 public:
  struct Findings {
    int64_t frames = 0;
    int64_t points = 0;   // Of these frames together.
    int64_t dropped = 0;  // Frames that came faster than they are compared.
    double worst = 0;     // Error of the frames that are right.
    std::optional<WrongFrame> wrong;  // The first.
  };

  // `judge` compares; it runs on the checker's thread. `wrong` is told once.
  FrameChecker(std::function<FrameJudge::Verdict(const FrameToCheck&)> judge,
               std::function<void()> wrong);
  // What waits is compared first.
  ~FrameChecker();

  // Never waits.
  void Check(FrameToCheck frame, int64_t points);
  // Returns when what waits is compared.
  Findings Finish();

 private:
  static constexpr size_t kMaxWaiting = 32;
  struct Item {
    FrameToCheck frame;
    int64_t points;
  };

  void Work();

  const std::function<FrameJudge::Verdict(const FrameToCheck&)> judge_;
  const std::function<void()> wrong_;
  Mutex mutex_;
  CondVar changed_;
  std::deque<Item> waiting_ ABSL_GUARDED_BY(mutex_);
  bool busy_ ABSL_GUARDED_BY(mutex_) = false;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  Findings findings_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace deform
