#include "client/load/pose_schedule.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "client/load/recorder.h"

namespace deform {
namespace {

using std::chrono::milliseconds;
using TimePoint = PoseSchedule::TimePoint;

constexpr TimePoint kStart{std::chrono::seconds(1000)};

// A thread's time, without a thread: sleeping sets it.
struct FakeTime {
  TimePoint now = kStart;
  bool stopped = false;

  template <typename Send>
  void Run(const PoseSchedule& schedule, int64_t first, int64_t step,
           Send send) {
    Pace(schedule, first, step,
         {[this] { return now; },
          [this](TimePoint time) {
            now = time;
            return !stopped;
          }},
         send);
  }
};

TEST(PoseSchedule, SpreadsEditorsEvenlyOverThePeriod) {
  const PoseSchedule schedule(kStart, milliseconds(20), 4, 2);
  EXPECT_EQ(schedule.size(), 8);
  for (int i = 0; i < 8; ++i) {
    const PoseSchedule::Due due = schedule.At(i);
    EXPECT_EQ(due.time, kStart + i * milliseconds(5));
    EXPECT_EQ(due.editor, i % 4);
    EXPECT_EQ(due.sequence, i / 4 + 1u);
    EXPECT_EQ(schedule.TimeOf(due.editor, due.sequence), due.time);
  }
  EXPECT_EQ(schedule.end(), kStart + milliseconds(40));
}

TEST(PoseSchedule, SendsEachPoseWhenItIsDue) {
  const PoseSchedule schedule(kStart, milliseconds(10), 2, 3);
  FakeTime time;
  std::vector<int64_t> at;
  time.Run(schedule, 0, 1,
           [&](const PoseSchedule::Due&, std::chrono::nanoseconds lateness) {
             EXPECT_EQ(lateness.count(), 0);
             at.push_back((time.now - kStart) / milliseconds(1));
             return true;
           });
  EXPECT_THAT(at, testing::ElementsAre(0, 5, 10, 15, 20, 25));
}

TEST(PoseSchedule, SendsWhatAStallHeldUpAtOnceAndSaysHowLate) {
  const PoseSchedule schedule(kStart, milliseconds(10), 1, 6);
  FakeTime time;
  std::vector<int64_t> at, late;
  time.Run(schedule, 0, 1,
           [&](const PoseSchedule::Due& due, std::chrono::nanoseconds by) {
             at.push_back((time.now - kStart) / milliseconds(1));
             late.push_back(by / milliseconds(1));
             // Sending the second takes 25 ms.
             if (due.sequence == 2) time.now += milliseconds(25);
             return true;
           });
  EXPECT_THAT(at, testing::ElementsAre(0, 10, 35, 35, 40, 50));
  EXPECT_THAT(late, testing::ElementsAre(0, 0, 15, 5, 0, 0));
}

TEST(PoseSchedule, IsSharedOutAmongThreads) {
  const PoseSchedule schedule(kStart, milliseconds(10), 3, 2);
  std::vector<std::pair<int64_t, uint64_t>> sent;
  for (int64_t thread : {0, 1}) {
    FakeTime time;
    time.Run(schedule, thread, 2,
             [&](const PoseSchedule::Due& due, std::chrono::nanoseconds) {
               sent.emplace_back(due.editor, due.sequence);
               return true;
             });
  }
  EXPECT_THAT(
      sent, testing::UnorderedElementsAre(
                testing::Pair(0, 1), testing::Pair(1, 1), testing::Pair(2, 1),
                testing::Pair(0, 2), testing::Pair(1, 2), testing::Pair(2, 2)));
}

TEST(PoseSchedule, EndsWhenToldTo) {
  const PoseSchedule schedule(kStart, milliseconds(10), 1, 5);
  FakeTime sending, sleeping;
  int sent = 0, slept = 0;
  sending.Run(schedule, 0, 1,
              [&](const PoseSchedule::Due&, std::chrono::nanoseconds) {
                return ++sent < 2;
              });
  EXPECT_EQ(sent, 2);
  sleeping.stopped = true;
  sleeping.Run(schedule, 0, 1,
               [&](const PoseSchedule::Due&, std::chrono::nanoseconds) {
                 ++slept;
                 return true;
               });
  EXPECT_EQ(slept, 1);  // Due at once; the next is slept for.
}

TEST(LoadRecorder, CountsAStallForEveryPoseThatWasDueDuringIt) {
  const PoseSchedule schedule(kStart, milliseconds(10), 1, 100);
  LoadRecorder recorder(kStart, schedule.end(), std::chrono::seconds(1));
  // Answers come after 1 ms, but for a stall from 500 to 700 ms: a client that
  // waited for its answers would count one of 200 ms.
  for (uint64_t s = 1; s <= 100; ++s) {
    const TimePoint due = schedule.TimeOf(0, s);
    const bool stalled =
        due >= kStart + milliseconds(500) && due < kStart + milliseconds(700);
    recorder.Answered(
        due, stalled ? kStart + milliseconds(700) : due + milliseconds(1));
  }
  const LatencyHistogram latency = recorder.figures().Latency();
  EXPECT_EQ(latency.count(), 100);
  EXPECT_EQ(latency.max(), milliseconds(200));
  EXPECT_EQ(latency.CountAbove(milliseconds(9)), 20);
  EXPECT_GE(latency.Percentile(0.9), milliseconds(100));
}

TEST(LoadRecorder, LeavesOutWhatIsNotOfTheWindow) {
  const TimePoint begin = kStart + milliseconds(100);
  const TimePoint end = kStart + milliseconds(200);
  LoadRecorder recorder(begin, end, std::chrono::seconds(1));
  // Due before, within, and after; answered whenever.
  for (const TimePoint due : {begin - milliseconds(1), begin, end}) {
    recorder.Answered(due, end + milliseconds(5));
    recorder.Sent(due, milliseconds(2), true);
  }
  for (const TimePoint now : {begin - milliseconds(1), begin, end}) {
    recorder.Arrived(now, 1000, 3, true, 40);
  }
  const LoadFigures figures = recorder.figures();
  EXPECT_EQ(figures.Latency().count(), 1);
  EXPECT_EQ(figures.lateness.count(), 1);
  EXPECT_EQ(figures.held_back, 1);
  EXPECT_EQ(figures.frames, 1);
  EXPECT_EQ(figures.bytes, 1000);
  EXPECT_EQ(figures.skipped, 3);
  EXPECT_EQ(figures.deform_us, 40);
}

TEST(LoadRecorder, CountsByTheTimeThatPosesWereDue) {
  LoadRecorder recorder(kStart, kStart + milliseconds(2500),
                        std::chrono::seconds(1));
  recorder.Answered(kStart + milliseconds(999), kStart + milliseconds(2000));
  recorder.Answered(kStart + milliseconds(2400), kStart + milliseconds(9000));
  const LoadFigures figures = recorder.figures();
  ASSERT_EQ(figures.intervals.size(), 3u);
  EXPECT_EQ(figures.intervals[0].latency.count(), 1);
  EXPECT_EQ(figures.intervals[1].latency.count(), 0);
  EXPECT_EQ(figures.intervals[2].latency.count(), 1);
}

}  // namespace
}  // namespace deform
