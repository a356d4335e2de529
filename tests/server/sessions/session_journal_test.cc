#include "server/sessions/session_journal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"

namespace deform::server {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

absl::Status Error(absl::StatusCode code, const std::string& reason) {
  return MakeError(code, reason, {.reason = reason});
}

// Takes appends, and tells how they ended when told.
class AppendStore : public Store {
 public:
  bool survives_restart() const override { return survives; }
  absl::Status Append(PoseAppend append, Done done) override {
    if (!refusals.empty()) {
      const absl::Status refusal = refusals.front();
      refusals.pop_front();
      if (!refusal.ok()) return refusal;
    }
    appends.push_back(std::move(append));
    waiting.push_back(std::move(done));
    return absl::OkStatus();
  }
  void EndAll(const absl::Status& status) {
    for (const Done& done : std::exchange(waiting, {})) done(status);
  }

  bool survives = true;
  std::deque<absl::Status> refusals;  // Of the next appends, or OK.
  std::vector<PoseAppend> appends;
  std::vector<Done> waiting;

  // Nobody calls these.
  absl::StatusOr<StoreContents> Load() override { return Unused(); }
  absl::Status PutModel(const StoredModel&, const StoredArrays&) override {
    return Unused();
  }
  absl::StatusOr<StoredArrays> ModelArrays(const StoreKey&) override {
    return Unused();
  }
  absl::Status DeleteModel(const StoreKey&) override { return Unused(); }
  absl::Status PutBinding(const StoredBinding&) override { return Unused(); }
  absl::Status PutWeights(const StoreKey&, const WeightsForm&,
                          const StoredArrays&) override {
    return Unused();
  }
  absl::StatusOr<StoredWeights> Weights(const StoreKey&) override {
    return Unused();
  }
  absl::Status DeleteBinding(const StoreKey&) override { return Unused(); }
  absl::Status PutSession(const StoredSession&) override { return Unused(); }
  absl::StatusOr<SessionPose> LoadSession(const StoreKey&) override {
    return Unused();
  }
  absl::StatusOr<std::vector<uint64_t>> TakeOver(
      std::span<const StoreKey>) override {
    return Unused();
  }
  absl::Status DeleteSession(const StoreKey&) override { return Unused(); }
  uint64_t DurableRevision(const StoreKey&) override { return 0; }
  absl::Status Sync() override { return Unused(); }
  absl::StatusOr<int64_t> CollectOrphans() override { return Unused(); }
  absl::Status Backup(const std::string&) override { return Unused(); }

 private:
  static absl::Status Unused() {
    ADD_FAILURE() << "a journal only appends";
    return absl::InternalError("unused");
  }
};

class SessionJournalTest : public testing::Test {
 protected:
  SessionJournal Journal() {
    return SessionJournal(
        &store_, {"t", "s"}, 3, 10,
        [this](const absl::Status& status) { reported_.push_back(status); });
  }

  // The next revision, with these rows of eight moved.
  absl::Status Move(SessionJournal& journal, const std::vector<int32_t>& rows,
                    bool rig_changed = false) {
    const Pose before = pose_;
    for (const int32_t row : rows) pose_.vertices.row(row).array() += 1;
    return journal.Append({.number = ++revision_,
                           .before = &before,
                           .now = &pose_,
                           .binding_id = "b",
                           .rig_changed = rig_changed});
  }

  AppendStore store_;
  std::vector<absl::Status> reported_;
  Pose pose_{.vertices = Positions::Zero(8, 3)};
  uint64_t revision_ = 10;
};

TEST_F(SessionJournalTest, WritesAllAtFirstThenWhatMoved) {
  SessionJournal journal = Journal();
  EXPECT_TRUE(Move(journal, {2}).ok());
  EXPECT_TRUE(Move(journal, {5, 7}).ok());
  ASSERT_EQ(store_.appends.size(), 2u);
  const PoseAppend& first = store_.appends[0];
  EXPECT_TRUE(first.whole);
  EXPECT_EQ(first.revision, 11u);
  EXPECT_EQ(first.epoch, 3u);
  EXPECT_EQ(first.binding_id, "b");
  EXPECT_EQ(first.positions.rows(), 8);
  const PoseAppend& second = store_.appends[1];
  EXPECT_FALSE(second.whole);
  EXPECT_THAT(second.rows, ElementsAre(5, 7));
  EXPECT_EQ(second.positions, Positions::Ones(2, 3));
  EXPECT_EQ(second.binding_id, "");
}

TEST_F(SessionJournalTest, WritesAllWhereThatIsHardlyMore) {
  SessionJournal journal = Journal();
  EXPECT_TRUE(Move(journal, {0}).ok());
  EXPECT_TRUE(Move(journal, {0, 1, 2, 3, 4}).ok());
  EXPECT_TRUE(store_.appends[1].whole);
  EXPECT_THAT(store_.appends[1].rows, IsEmpty());
}

TEST_F(SessionJournalTest, WritesAllOfAnotherRig) {
  SessionJournal journal = Journal();
  EXPECT_TRUE(Move(journal, {0}).ok());
  EXPECT_TRUE(Move(journal, {1}, true).ok());
  EXPECT_TRUE(store_.appends[1].whole);
}

TEST_F(SessionJournalTest, IsDurableOnceTheStoreSaysSo) {
  SessionJournal journal = Journal();
  EXPECT_EQ(journal.durable_revision(), 10u);
  EXPECT_TRUE(Move(journal, {0}).ok());
  EXPECT_EQ(journal.durable_revision(), 10u);
  store_.EndAll(absl::OkStatus());
  EXPECT_EQ(journal.durable_revision(), 11u);
}

TEST_F(SessionJournalTest, IsNeverDurableInAStoreThatKeepsNothing) {
  store_.survives = false;
  SessionJournal journal = Journal();
  EXPECT_TRUE(Move(journal, {0}).ok());
  store_.EndAll(absl::OkStatus());
  EXPECT_EQ(journal.durable_revision(), 0u);
}

TEST_F(SessionJournalTest, WritesAllAfterAFailureAndTellsItOnce) {
  SessionJournal journal = Journal();
  EXPECT_TRUE(Move(journal, {0}).ok());
  EXPECT_TRUE(Move(journal, {1}).ok());
  store_.EndAll(Error(absl::StatusCode::kResourceExhausted, "DISK_FULL"));
  EXPECT_EQ(reported_.size(), 1u);
  EXPECT_EQ(journal.durable_revision(), 10u);
  EXPECT_TRUE(Move(journal, {2}).ok());
  EXPECT_TRUE(store_.appends[2].whole);
  store_.EndAll(absl::OkStatus());
  EXPECT_EQ(journal.durable_revision(), 13u);
  EXPECT_TRUE(Move(journal, {3}).ok());
  EXPECT_FALSE(store_.appends[3].whole);
}

TEST_F(SessionJournalTest, WritesAllAtOnceWhenTheOneBeforeHasJustFailed) {
  SessionJournal journal = Journal();
  EXPECT_TRUE(Move(journal, {0}).ok());
  store_.refusals = {
      Error(absl::StatusCode::kFailedPrecondition, "REVISION_GAP"),
      absl::OkStatus()};
  EXPECT_TRUE(Move(journal, {1}).ok());
  ASSERT_EQ(store_.appends.size(), 2u);
  EXPECT_TRUE(store_.appends[1].whole);
  EXPECT_THAT(reported_, IsEmpty());
}

TEST_F(SessionJournalTest, GoesOnWhenMoreWaitsThanMay) {
  SessionJournal journal = Journal();
  store_.refusals = {
      Error(absl::StatusCode::kResourceExhausted, "JOURNAL_BEHIND")};
  EXPECT_TRUE(Move(journal, {0}).ok());
  EXPECT_EQ(reported_.size(), 1u);
  EXPECT_TRUE(Move(journal, {1}).ok());
  EXPECT_TRUE(store_.appends[0].whole);
}

TEST_F(SessionJournalTest, SaysWhenTheSessionIsNoLongerOurs) {
  for (const std::string reason : {"STALE_EPOCH", "SESSION_NOT_FOUND"}) {
    SessionJournal journal = Journal();
    store_.refusals = {Error(absl::StatusCode::kFailedPrecondition, reason)};
    EXPECT_EQ(DetailOf(Move(journal, {0})).reason, reason);
  }
}

}  // namespace
}  // namespace deform::server
