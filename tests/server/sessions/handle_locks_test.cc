#include "server/sessions/handle_locks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace deform::server {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr int64_t kAnna = 1;
constexpr int64_t kBert = 2;

class HandleLocksTest : public testing::Test {
 protected:
  std::optional<HandleLocks::Held> Acquire(int64_t who,
                                           std::vector<int32_t> handles,
                                           int lease = 5) {
    return locks_.Acquire(who, handles, now_ + seconds(lease), now_);
  }
  bool IsFree(int64_t who, std::vector<int32_t> handles) const {
    return !locks_.HeldByOther(who, handles, now_);
  }
  std::vector<int32_t> HandlesOf(int64_t who) const {
    std::vector<int32_t> handles;
    for (const auto& held : locks_.LocksOf(who, now_)) {
      handles.push_back(held.handle);
    }
    return handles;
  }

  HandleLocks locks_;
  HandleLocks::TimePoint now_{seconds(100)};
};

TEST_F(HandleLocksTest, KeepsOthersOut) {
  EXPECT_FALSE(Acquire(kAnna, {3, 5}));
  EXPECT_TRUE(IsFree(kAnna, {3, 4, 5}));
  EXPECT_TRUE(IsFree(kBert, {4}));
  EXPECT_EQ(locks_.HeldByOther(kBert, std::vector<int32_t>{4, 5, 3}, now_),
            (HandleLocks::Held{5, kAnna, now_ + seconds(5)}));
  EXPECT_EQ(locks_.HeldByOther(kBert, now_),
            (HandleLocks::Held{3, kAnna, now_ + seconds(5)}));
  EXPECT_FALSE(locks_.HeldByOther(kAnna, now_));
}

TEST_F(HandleLocksTest, TakesAllOrNone) {
  Acquire(kAnna, {3});
  EXPECT_EQ(Acquire(kBert, {2, 3, 4}),
            (HandleLocks::Held{3, kAnna, now_ + seconds(5)}));
  EXPECT_THAT(HandlesOf(kBert), IsEmpty());
  EXPECT_FALSE(Acquire(kBert, {2, 4}));
  EXPECT_THAT(HandlesOf(kBert), ElementsAre(2, 4));
}

TEST_F(HandleLocksTest, EndWithTheirLease) {
  Acquire(kAnna, {3}, 5);
  now_ += seconds(4);
  EXPECT_FALSE(IsFree(kBert, {3}));
  now_ += seconds(1);
  EXPECT_TRUE(IsFree(kBert, {3}));
  EXPECT_THAT(HandlesOf(kAnna), IsEmpty());
  EXPECT_FALSE(Acquire(kBert, {3}));
  EXPECT_FALSE(IsFree(kAnna, {3}));
}

TEST_F(HandleLocksTest, AreExtendedByTheirOwner) {
  Acquire(kAnna, {3}, 5);
  now_ += seconds(4);
  EXPECT_FALSE(Acquire(kAnna, {3}, 5));
  now_ += seconds(4);
  EXPECT_FALSE(IsFree(kBert, {3}));
}

TEST_F(HandleLocksTest, AreReleasedByTheirOwnerAlone) {
  Acquire(kAnna, {3, 4, 5});
  locks_.Release(kBert, std::vector<int32_t>{3});
  EXPECT_THAT(HandlesOf(kAnna), ElementsAre(3, 4, 5));
  locks_.Release(kAnna, std::vector<int32_t>{3, 9});
  EXPECT_THAT(HandlesOf(kAnna), ElementsAre(4, 5));
  Acquire(kBert, {3});
  locks_.ReleaseAll(kAnna);
  EXPECT_THAT(HandlesOf(kAnna), IsEmpty());
  EXPECT_THAT(HandlesOf(kBert), ElementsAre(3));
}

TEST_F(HandleLocksTest, FollowTheirHandlesWhenTheRigChanges) {
  Acquire(kAnna, {0, 2});
  Acquire(kBert, {3});
  // The first was removed, a new one came second.
  locks_.Renumber(std::vector<int32_t>{1, -1, 2, 3});
  EXPECT_THAT(HandlesOf(kAnna), ElementsAre(2));
  EXPECT_THAT(HandlesOf(kBert), ElementsAre(3));
}

}  // namespace
}  // namespace deform::server
