#include "core/base/thread_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <vector>

namespace deform {
namespace {

TEST(ThreadPool, CallsTheBodyOncePerIndex) {
  ThreadPool pool({.threads = 3});
  for (int64_t count : {0, 1, 2, 1000}) {
    std::vector<std::atomic<int>> calls(count);
    EXPECT_TRUE(
        pool.ParallelFor(count, nullptr, [&](int64_t i) { ++calls[i]; }));
    for (const auto& c : calls) EXPECT_EQ(c, 1);
  }
}

TEST(ThreadPool, LoopsMayBeNested) {
  ThreadPool pool({.threads = 2});
  std::atomic<int> calls{0};
  pool.ParallelFor(8, nullptr, [&](int64_t) {
    pool.ParallelFor(8, nullptr, [&](int64_t) { ++calls; });
  });
  EXPECT_EQ(calls, 64);
}

TEST(ThreadPool, CancellingStopsBeforeTheNextBody) {
  ThreadPool pool({.threads = 2});
  Cancellation cancellation;
  std::atomic<int> calls{0};
  EXPECT_FALSE(pool.ParallelFor(1000000, &cancellation, [&](int64_t) {
    if (++calls == 10) cancellation.Cancel();
  }));
  // Three threads take part; each may have been within a body.
  EXPECT_LE(calls, 10 + 3);
}

TEST(ThreadPool, IsNotCancelledByWhatComesAfterTheLastBody) {
  ThreadPool pool({.threads = 1});
  Cancellation cancellation;
  EXPECT_TRUE(pool.ParallelFor(1, &cancellation,
                               [&](int64_t) { cancellation.Cancel(); }));
}

TEST(ThreadPool, FinishesWhatWasSubmitted) {
  std::atomic<int> calls{0};
  {
    ThreadPool pool({.threads = 2, .niceness = 5});
    for (int i = 0; i < 100; ++i) pool.Submit([&] { ++calls; });
  }
  EXPECT_EQ(calls, 100);
}

}  // namespace
}  // namespace deform
