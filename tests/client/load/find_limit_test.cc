#include "client/load/find_limit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace deform {
namespace {

using testing::ElementsAre;

// The trials made on a server that carries `limit` sessions.
struct Search {
  FoundLimit found;
  std::vector<int64_t> trials;
};
Search SearchFor(int64_t limit, const LimitSearch& options) {
  Search search;
  search.found =
      FindLimit(options, [&](int64_t sessions) -> absl::StatusOr<bool> {
        search.trials.push_back(sessions);
        return sessions <= limit;
      }).value();
  return search;
}

TEST(FindLimit, DoublesThenHalvesWhatIsLeft) {
  const Search search = SearchFor(11, {.first = 2, .resolution = 0.01});
  EXPECT_THAT(search.trials, ElementsAre(2, 4, 8, 16, 12, 10, 11));
  EXPECT_EQ(search.found.holds, 11);
  EXPECT_EQ(search.found.fails, 12);
}

TEST(FindLimit, GoesDownIfTheFirstFails) {
  const Search search = SearchFor(3, {.first = 10, .resolution = 0.01});
  EXPECT_EQ(search.trials.front(), 10);
  EXPECT_EQ(search.found.holds, 3);
  EXPECT_EQ(search.found.fails, 4);
}

TEST(FindLimit, SaysSoIfNotEvenOneHolds) {
  const Search search = SearchFor(0, {.first = 8});
  EXPECT_EQ(search.found.holds, 0);
  EXPECT_EQ(search.found.fails, 1);
}

TEST(FindLimit, StopsAtTheMost) {
  const Search search = SearchFor(1 << 30, {.first = 3, .most = 20});
  EXPECT_THAT(search.trials, ElementsAre(3, 6, 12, 20));
  EXPECT_EQ(search.found.holds, 20);
  EXPECT_EQ(search.found.fails, 0);
}

TEST(FindLimit, FindsEveryLimitToItsResolutionInFewTrials) {
  for (int64_t limit = 1; limit <= 3000; limit += 7) {
    const Search search =
        SearchFor(limit, {.first = 5, .most = 4096, .resolution = 0.05});
    EXPECT_LE(search.found.holds, limit);
    EXPECT_GT(search.found.fails, limit);
    EXPECT_LE(search.found.fails - search.found.holds,
              std::max<double>(1, 0.05 * search.found.holds));
    EXPECT_LE(search.trials.size(), 20u);
  }
}

TEST(FindLimit, EndsWithTheErrorOfATrial) {
  EXPECT_EQ(FindLimit({},
                      [](int64_t) -> absl::StatusOr<bool> {
                        return absl::CancelledError("interrupted");
                      })
                .status(),
            absl::CancelledError("interrupted"));
}

}  // namespace
}  // namespace deform
