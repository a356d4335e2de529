#include "server/sessions/write_log.h"

#include <gtest/gtest.h>

#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

constexpr int64_t kAnna = 1;
constexpr int64_t kBert = 2;
constexpr int64_t kCleo = 3;

PoseUpdate Touch(std::vector<int32_t> vertices) {
  const auto rows = std::ssize(vertices);
  return {.vertices = std::move(vertices),
          .positions = Positions::Zero(rows, 3)};
}

class WriteLogTest : public testing::Test {
 protected:
  // Accepted and published as the next revision, which is returned.
  uint64_t Write(int64_t who, const PoseUpdate& update) {
    log_.Published(++revision_, log_.Wrote(who, update));
    return revision_;
  }
  std::optional<int32_t> Conflict(int64_t who, const PoseUpdate& update,
                                  uint64_t base) const {
    return log_.Conflict(who, update, base);
  }

  WriteLog log_{8};
  uint64_t revision_ = 0;
};

TEST_F(WriteLogTest, FindsWhatOthersWroteAfterTheBase) {
  const uint64_t first = Write(kAnna, Touch({2, 3}));
  const uint64_t second = Write(kBert, Touch({3}));
  EXPECT_EQ(Conflict(kAnna, Touch({2, 3}), first), 3);
  EXPECT_FALSE(Conflict(kAnna, Touch({2}), first));
  EXPECT_FALSE(Conflict(kAnna, Touch({3}), second));
  EXPECT_EQ(Conflict(kCleo, Touch({4, 2}), 0), 2);
  EXPECT_FALSE(Conflict(kCleo, Touch({4}), 0));
}

TEST_F(WriteLogTest, OnesOwnWritesAreNoConflict) {
  Write(kAnna, Touch({2}));
  Write(kAnna, Touch({2}));
  EXPECT_FALSE(Conflict(kAnna, Touch({2}), 0));
}

TEST_F(WriteLogTest, SeesOthersBehindOnesOwnNewestWrite) {
  Write(kBert, Touch({2}));
  Write(kAnna, Touch({2}));
  const uint64_t base = Write(kAnna, Touch({2}));
  EXPECT_EQ(Conflict(kAnna, Touch({2}), 0), 2);
  EXPECT_FALSE(Conflict(kAnna, Touch({2}), base));
  Write(kCleo, Touch({2}));
  Write(kAnna, Touch({2}));
  EXPECT_EQ(Conflict(kAnna, Touch({2}), base), 2);
}

TEST_F(WriteLogTest, NobodyKnowsOfWhatIsNotPublished) {
  const uint64_t base = Write(kAnna, Touch({1}));
  const uint64_t accepted = log_.Wrote(kBert, Touch({2}));
  EXPECT_EQ(Conflict(kAnna, Touch({2}), base), 2);
  EXPECT_EQ(Conflict(kAnna, Touch({2}), base + 5), 2);
  log_.Published(base + 1, accepted);
  EXPECT_EQ(Conflict(kAnna, Touch({2}), base), 2);
  EXPECT_FALSE(Conflict(kAnna, Touch({2}), base + 1));
}

TEST_F(WriteLogTest, AWholePoseIsAllVertices) {
  Write(kBert, Touch({5}));
  EXPECT_EQ(Conflict(kAnna, {.positions = Positions::Zero(8, 3)}, 0), 5);
  const uint64_t base = revision_;
  Write(kBert, {.positions = Positions::Zero(8, 3)});
  EXPECT_EQ(Conflict(kAnna, Touch({7}), base), 7);
}

TEST_F(WriteLogTest, TheStretchBlendIsOneMore) {
  Write(kBert, {.stretch_blend = 0.5});
  EXPECT_FALSE(Conflict(kAnna, {.positions = Positions::Zero(8, 3)}, 0));
  EXPECT_EQ(Conflict(kAnna, {.stretch_blend = 0.2}, 0), -1);
}

TEST_F(WriteLogTest, ABaseTooOldKnowsOfNothing) {
  const uint64_t first = Write(kBert, Touch({2}));
  EXPECT_FALSE(Conflict(kAnna, Touch({2}), first));
  for (size_t i = 0; i < WriteLog::kMaxRevisions; ++i) {
    Write(kAnna, Touch({1}));
  }
  EXPECT_EQ(Conflict(kAnna, Touch({2}), first), 2);
  EXPECT_FALSE(Conflict(kAnna, Touch({2}), revision_));
}

TEST_F(WriteLogTest, FollowsHandlesWhenTheRigChanges) {
  Write(kBert, Touch({2, 7}));
  log_.Renumber(std::vector<int32_t>{2, -1, 1});
  EXPECT_EQ(Conflict(kAnna, Touch({1, 2, 0}), 0), 0);
  EXPECT_FALSE(Conflict(kAnna, Touch({1, 2}), 0));
}

}  // namespace
}  // namespace deform::server
