#include "server/sessions/timer.h"

#include <gtest/gtest.h>

#include <future>
#include <string>

namespace deform::server {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

TEST(Timer, CallsInTheOrderOfTimeAndNeverBefore) {
  Timer timer;
  const auto now = Clock::now();
  std::string called;
  std::promise<void> last;
  timer.At(now + milliseconds(20), [&] {
    called += 'b';
    EXPECT_GE(Clock::now(), now + milliseconds(20));
    last.set_value();
  });
  timer.At(now + milliseconds(10), [&] {
    called += 'a';
    EXPECT_GE(Clock::now(), now + milliseconds(10));
  });
  last.get_future().wait();
  EXPECT_EQ(called, "ab");
}

TEST(Timer, CallsAtOnceWhatIsOverdue) {
  Timer timer;
  std::promise<void> called;
  timer.At(Clock::now() - hours(1), [&] { called.set_value(); });
  called.get_future().wait();
}

TEST(Timer, ATaskMayAskForTheNext) {
  Timer timer;
  std::promise<void> called;
  timer.At(Clock::now(),
           [&] { timer.At(Clock::now(), [&] { called.set_value(); }); });
  called.get_future().wait();
}

TEST(Timer, StoppingDropsWhatIsNotDueAndWaitsForNone) {
  bool called = false;
  Timer timer;
  timer.At(Clock::now() + hours(1), [&] { called = true; });
  timer.Stop();
  timer.At(Clock::now(), [&] { called = true; });
  timer.Stop();
  EXPECT_FALSE(called);
}

}  // namespace
}  // namespace deform::server
