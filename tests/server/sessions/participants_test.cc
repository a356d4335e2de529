// Several participants on one session: what they may do, see of each other and
// undo, and how they come back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "server/sessions/session.h"
#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

using Direction = EditHistory::Direction;
using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class ParticipantsTest : public testing::Test {
 protected:
  struct Guest : FakeStream {
    int64_t id = 0;
    std::string token;
    bool resumed = false;
    uint64_t last_sequence = 0;
  };

  absl::StatusOr<Session::Joined> TryJoin(const Guest& guest,
                                          const Introduction& who,
                                          Delivery delivery) {
    return session_->Join(delivery, FrameWishes{}, guest.receiver, who);
  }
  Guest Join(const Introduction& who, Delivery delivery = Delivery::kLatest) {
    Guest guest;
    auto joined = TryJoin(guest, who, delivery);
    EXPECT_TRUE(joined.ok()) << joined.status();
    guest.participant = std::move(joined->participant);
    guest.joined = joined->state;
    guest.pose = joined->pose;
    guest.id = joined->participant_id;
    guest.token = joined->token;
    guest.resumed = joined->resumed;
    guest.last_sequence = joined->last_sequence;
    return guest;
  }
  // Joins and takes the first frame.
  Guest JoinAndSee(const Introduction& who) {
    Guest guest = Join(who);
    rooms_.executor.RunAll();
    guest.TakeFrame();
    return guest;
  }
  // The next of its kind; what comes before is dropped.
  template <typename Kind>
  static Kind Take(Guest& guest) {
    while (auto next = guest.participant->Take()) {
      if (auto* wanted = std::get_if<Kind>(&*next)) return std::move(*wanted);
    }
    ADD_FAILURE() << "nothing of that kind";
    return {};
  }
  static Rejection Refused(Guest& guest) { return Take<Rejection>(guest); }
  static bool Put(Guest& guest, uint64_t sequence, int32_t vertex, double x,
                  const PoseTerms& terms = {}) {
    return guest.participant->Submit(sequence, MoveVertex(vertex, {x, 0, 0}),
                                     terms);
  }
  double X(int32_t vertex) const {
    return session_->posed().pose.vertices(vertex, 0);
  }

  SessionRooms rooms_;
  std::shared_ptr<Session> session_ = Session::Create(
      "s", rooms_.bindings().Use("t", rooms_.binding_id, "session s").value(),
      {}, rooms_.Environment());
};

TEST_F(ParticipantsTest, AViewerSendsNoPose) {
  Guest viewer = JoinAndSee({.role = Role::kViewer});
  EXPECT_FALSE(Put(viewer, 1, 0, 2));
  const Rejection refused = Refused(viewer);
  EXPECT_EQ(refused.sequence, 1u);
  EXPECT_EQ(refused.status.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(DetailOf(refused.status).reason, "VIEWER");
  EXPECT_THAT(std::string(refused.status.message()),
              HasSubstr("join with the role of an editor"));
  EXPECT_FALSE(viewer.participant->Lock(2, std::vector<int32_t>{1}, {}, 0));
  EXPECT_EQ(DetailOf(Refused(viewer).status).reason, "VIEWER");
  EXPECT_FALSE(viewer.participant->Reverse(3, Direction::kUndo));
  EXPECT_EQ(DetailOf(Refused(viewer).status).reason, "VIEWER");
  Guest editor = JoinAndSee({});
  Put(editor, 1, 0, 2);
  rooms_.executor.RunAll();
  EXPECT_EQ(viewer.TakeFrame().frame->info.revision, 1u);
}

TEST_F(ParticipantsTest, ALockedHandleMovesForItsOwnerAlone) {
  Guest anna = JoinAndSee({.name = "Anna"});
  Guest bert = JoinAndSee({.name = "Bert"});
  EXPECT_TRUE(anna.participant->Lock(1, std::vector<int32_t>{3, 4},
                                     milliseconds(2000), 0));
  EXPECT_EQ(Take<Acknowledgement>(anna).sequence, 1u);
  EXPECT_TRUE(Put(anna, 2, 3, 2));
  EXPECT_TRUE(Put(bert, 1, 5, 2));
  EXPECT_FALSE(Put(bert, 2, 4, 2));
  const Rejection refused = Refused(bert);
  EXPECT_EQ(refused.status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(refused.status).reason, "HANDLE_LOCKED");
  EXPECT_EQ(DetailOf(refused.status).resource_name, "4");
  EXPECT_THAT(std::string(refused.status.message()),
              HasSubstr("handle 4 is locked by participant 1 (\"Anna\") for "
                        "2.0 s more"));
  // All vertices: one of them is locked.
  EXPECT_FALSE(bert.participant->Submit(3, MovedBy({1, 0, 0})));
  EXPECT_EQ(DetailOf(Refused(bert).status).resource_name, "3");
  EXPECT_FALSE(bert.participant->Lock(4, std::vector<int32_t>{2, 3}, {}, 0));
  EXPECT_EQ(DetailOf(Refused(bert).status).reason, "HANDLE_LOCKED");
  EXPECT_TRUE(anna.participant->Unlock(3, std::vector<int32_t>{4}, 0));
  EXPECT_TRUE(Put(bert, 5, 4, 2));
  rooms_.clock.Advance(milliseconds(2000));
  EXPECT_TRUE(Put(bert, 6, 3, 2));
}

TEST_F(ParticipantsTest, BoundsWhatIsLocked) {
  Guest anna = JoinAndSee({});
  const auto refused = [&](std::vector<int32_t> handles, int64_t lease_ms,
                           uint64_t rig_changes = 0) {
    EXPECT_FALSE(anna.participant->Lock(1, std::move(handles),
                                        milliseconds(lease_ms), rig_changes));
    return Refused(anna).status;
  };
  EXPECT_THAT(std::string(refused({}, 0).message()),
              HasSubstr("name the handles"));
  EXPECT_THAT(std::string(refused({8}, 0).message()),
              HasSubstr("lock refers to vertex 8 of 8"));
  EXPECT_THAT(std::string(refused({1}, 60'001).message()),
              HasSubstr("a lease of 60001 ms; at most 60000"));
  EXPECT_THAT(std::string(refused(std::vector<int32_t>(257, 1), 0).message()),
              HasSubstr("257 handles; at most 256"));
  EXPECT_THAT(std::string(refused({1}, 0, 2).message()),
              HasSubstr("meant for the rig after 2 changes, but there were 0"));
}

TEST_F(ParticipantsTest, TellsOfAConflictWhatThereIsNow) {
  Guest anna = JoinAndSee({});
  Guest bert = JoinAndSee({});
  Put(anna, 1, 3, 5);
  rooms_.executor.RunAll();
  EXPECT_FALSE(Put(bert, 1, 3, 6, {.base_revision = 0}));
  const Rejection refused = Refused(bert);
  EXPECT_EQ(refused.status.code(), absl::StatusCode::kAborted);
  EXPECT_EQ(DetailOf(refused.status).reason, "REVISION_CONFLICT");
  EXPECT_THAT(std::string(refused.status.message()),
              HasSubstr("vertex 3 was written by another participant after "
                        "revision 0"));
  ASSERT_TRUE(refused.current);
  EXPECT_EQ(refused.current->revision, 1u);
  EXPECT_EQ(refused.current->pose.vertices(3, 0), 5);
  EXPECT_EQ(refused.current->pose.vertices.rows(), 8);
  EXPECT_TRUE(Put(bert, 2, 3, 6, {.base_revision = 1}));
  EXPECT_TRUE(Put(bert, 3, 4, 6, {.base_revision = 0}));
}

TEST_F(ParticipantsTest, UndoesOnesOwnEditsAndNobodyElses) {
  Guest anna = JoinAndSee({});
  Guest bert = JoinAndSee({});
  const double rest3 = X(3);
  const double rest4 = X(4);
  Put(anna, 1, 3, 5, {.edit = 1});
  Put(anna, 2, 4, 5, {.edit = 1});
  rooms_.executor.RunAll();
  Put(bert, 1, 4, 7, {.edit = 1});
  rooms_.executor.RunAll();
  EXPECT_TRUE(anna.participant->Reverse(3, Direction::kUndo));
  rooms_.executor.RunAll();
  EXPECT_EQ(X(3), rest3);
  EXPECT_EQ(X(4), 7);
  const auto done = Take<Acknowledgement>(anna);
  EXPECT_EQ(done.sequence, 3u);
  EXPECT_EQ(done.edit, 1u);
  EXPECT_THAT(done.left_out, ElementsAre(4));
  EXPECT_EQ(anna.TakeFrame().answers_sequence, 3u);
  EXPECT_TRUE(bert.participant->Reverse(2, Direction::kUndo));
  EXPECT_TRUE(anna.participant->Reverse(4, Direction::kRedo));
  rooms_.executor.RunAll();
  EXPECT_EQ(X(3), 5);
  EXPECT_EQ(X(4), 5);
  EXPECT_NE(rest4, 5);
}

TEST_F(ParticipantsTest, SaysWhyNothingIsUndone) {
  Guest anna = JoinAndSee({.name = "Anna"});
  Guest bert = JoinAndSee({});
  Put(anna, 1, 3, 5);
  EXPECT_FALSE(anna.participant->Reverse(2, Direction::kUndo));
  absl::Status status = Refused(anna).status;
  EXPECT_EQ(DetailOf(status).reason, "NOTHING_TO_UNDO");
  EXPECT_THAT(std::string(status.message()), HasSubstr("pose.edit"));
  EXPECT_FALSE(anna.participant->Reverse(2, Direction::kRedo));
  status = Refused(anna).status;
  EXPECT_EQ(DetailOf(status).reason, "NOTHING_TO_REDO");
  EXPECT_THAT(std::string(status.message()), HasSubstr("undone nothing"));
  Put(anna, 3, 3, 5, {.edit = 9});
  Put(bert, 1, 3, 6);
  EXPECT_FALSE(anna.participant->Reverse(4, Direction::kUndo));
  status = Refused(anna).status;
  EXPECT_EQ(DetailOf(status).reason, "EDIT_OVERWRITTEN");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("nothing is left of edit 9 to undo"));
  EXPECT_FALSE(anna.participant->Reverse(4, Direction::kUndo));
  EXPECT_EQ(DetailOf(Refused(anna).status).reason, "NOTHING_TO_UNDO");
  Put(bert, 2, 5, 1, {.edit = 1});
  anna.participant->Lock(5, std::vector<int32_t>{5}, {}, 0);
  EXPECT_FALSE(bert.participant->Reverse(3, Direction::kUndo));
  EXPECT_EQ(DetailOf(Refused(bert).status).reason, "HANDLE_LOCKED");
  anna.participant->Unlock(6, std::vector<int32_t>{}, 0);
  EXPECT_TRUE(bert.participant->Reverse(3, Direction::kUndo));
}

TEST_F(ParticipantsTest, SeeEachOther) {
  Guest anna = Join({.name = "Anna", .wants_presence = true});
  const auto first = Take<PresenceChange>(anna);
  EXPECT_TRUE(first.complete);
  ASSERT_EQ(first.present.size(), 1u);
  EXPECT_EQ(first.present[0].id, anna.id);
  rooms_.clock.Advance(milliseconds(50));
  Guest bert = Join({.role = Role::kViewer, .name = "Bert"});
  EXPECT_GT(anna.receiver->wakes, 0);
  bert.participant->Show(Shown{.grabbed = {2}, .cursor = "here"});
  const auto change = Take<PresenceChange>(anna);
  EXPECT_FALSE(change.complete);
  ASSERT_EQ(change.present.size(), 1u);
  EXPECT_EQ(change.present[0].name, "Bert");
  EXPECT_EQ(change.present[0].role, Role::kViewer);
  EXPECT_EQ(change.present[0].shown.cursor, "here");
  EXPECT_THAT(change.present[0].shown.grabbed, ElementsAre(2));
  bert.participant.reset();
  rooms_.clock.Advance(milliseconds(50));
  EXPECT_THAT(Take<PresenceChange>(anna).left, ElementsAre(bert.id));
}

TEST_F(ParticipantsTest, ShowingThingsOftenCostsOneChangeATime) {
  Guest anna = Join({.wants_presence = true});
  Guest bert = JoinAndSee({});
  Take<PresenceChange>(anna);
  anna.TakeFrame();
  const int wakes = anna.receiver->wakes;
  for (int i = 0; i < 1000; ++i) {
    bert.participant->Show(Shown{.cursor = std::to_string(i)});
  }
  EXPECT_EQ(anna.receiver->wakes, wakes);
  EXPECT_FALSE(anna.participant->Take());
  rooms_.clock.Advance(milliseconds(50));
  EXPECT_EQ(Take<PresenceChange>(anna).present[0].shown.cursor, "999");
  EXPECT_FALSE(anna.participant->Take());
  // Who did not ask is told nothing.
  EXPECT_FALSE(bert.participant->Take());
}

TEST_F(ParticipantsTest, APresenceThatIsTooLargeIsRefusedWithoutASequence) {
  Guest anna = JoinAndSee({});
  anna.participant->Show(Shown{.cursor = std::string(257, 'x')});
  const Rejection refused = Refused(anna);
  EXPECT_EQ(refused.sequence, 0u);
  EXPECT_EQ(DetailOf(refused.status).reason, "CURSOR_TOO_LARGE");
  Guest long_name;
  const auto joined =
      TryJoin(long_name, {.name = std::string(65, 'n')}, Delivery::kLatest);
  EXPECT_EQ(DetailOf(joined.status()).reason, "NAME_TOO_LONG");
  EXPECT_EQ(session_->state().participants, 1);
}

TEST_F(ParticipantsTest, GoOnWhereABrokenStreamWas) {
  Guest anna = JoinAndSee({});
  Put(anna, 1, 3, 1, {.edit = 1});
  rooms_.executor.RunAll();
  Put(anna, 2, 3, 2, {.edit = 1});  // Accepted, not applied yet.
  anna.participant.reset();
  Guest back = Join({.token = anna.token, .last_revision = 0});
  EXPECT_TRUE(back.resumed);
  EXPECT_EQ(back.id, anna.id);
  EXPECT_EQ(back.token, anna.token);
  EXPECT_EQ(back.last_sequence, 2u);
  EXPECT_EQ(back.joined.revision, 1u);
  const FrameToSend first = back.TakeFrame();
  EXPECT_TRUE(first.tells_origin);
  EXPECT_EQ(first.answers_sequence, 1u);
  EXPECT_EQ(first.skipped_revisions, 0u);
  rooms_.executor.RunAll();
  EXPECT_EQ(back.TakeFrame().answers_sequence, 2u);
  EXPECT_EQ(X(3), 2);
  // A pose that was accepted is not accepted again.
  EXPECT_FALSE(Put(back, 2, 3, 9));
  EXPECT_EQ(DetailOf(Refused(back).status).reason, "SEQUENCE_NOT_RISING");
  EXPECT_TRUE(back.participant->Reverse(3, Direction::kUndo));
  rooms_.executor.RunAll();
  EXPECT_NE(X(3), 2);
}

TEST_F(ParticipantsTest, WhatIsAppliedWhileAwayIsAnsweredAfterwards) {
  Guest anna = JoinAndSee({});
  Put(anna, 1, 3, 1);
  anna.participant.reset();
  rooms_.executor.RunAll();
  EXPECT_EQ(X(3), 1);
  Guest back = Join({.token = anna.token, .last_revision = 0});
  rooms_.executor.RunAll();
  EXPECT_EQ(back.TakeFrame().answers_sequence, 1u);
}

TEST_F(ParticipantsTest, FramesTellWhatWasSkippedWhileAway) {
  Guest anna = JoinAndSee({});
  Guest bert = JoinAndSee({});
  anna.participant.reset();
  for (uint64_t i = 1; i <= 3; ++i) {
    Put(bert, i, 1, static_cast<double>(i));
    rooms_.executor.RunAll();
  }
  Guest back = Join({.token = anna.token, .last_revision = 0});
  EXPECT_EQ(back.TakeFrame().skipped_revisions, 2u);
}

TEST_F(ParticipantsTest, AStreamThatStillHasThePlaceIsEnded) {
  Guest anna = JoinAndSee({});
  const int wakes = anna.receiver->wakes;
  Guest back = Join({.token = anna.token});
  EXPECT_TRUE(back.resumed);
  EXPECT_EQ(session_->state().participants, 1);
  EXPECT_GT(anna.receiver->wakes, wakes);
  EXPECT_FALSE(Put(anna, 1, 3, 1));
  EXPECT_EQ(DetailOf(anna.participant->CheckStall()).reason, "TAKEN_OVER");
  const absl::Status end = anna.TakeEnd();
  EXPECT_EQ(end.code(), absl::StatusCode::kAborted);
  EXPECT_EQ(DetailOf(end).reason, "TAKEN_OVER");
  anna.participant.reset();
  EXPECT_TRUE(Put(back, 1, 3, 1));
  EXPECT_EQ(session_->state().participants, 1);
}

TEST_F(ParticipantsTest, AnAttemptThatComesLateTakesNoPlace) {
  Guest anna = JoinAndSee({});
  Guest back = Join({.token = anna.token, .attempt = 2});
  const auto refused = [&](uint64_t attempt) {
    Guest late;
    return TryJoin(late, {.token = anna.token, .attempt = attempt},
                   Delivery::kLatest)
        .status();
  };
  const absl::Status status = refused(1);
  EXPECT_EQ(status.code(), absl::StatusCode::kAborted);
  EXPECT_EQ(DetailOf(status).reason, "TAKEN_OVER");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("attempt 1 to come back was overtaken by attempt 2"));
  EXPECT_TRUE(Put(back, 1, 3, 1));
  // Nor one that is kept.
  back.participant.reset();
  EXPECT_EQ(DetailOf(refused(1)).reason, "TAKEN_OVER");
  EXPECT_TRUE(Join({.token = anna.token, .attempt = 3}).resumed);
}

TEST_F(ParticipantsTest, APlaceIsKeptForAWhile) {
  Guest anna = JoinAndSee({});
  Put(anna, 1, 3, 1);
  anna.participant.reset();
  rooms_.clock.Advance(rooms_.Environment().resume_grace);
  Guest late = Join({.token = anna.token});
  EXPECT_FALSE(late.resumed);
  EXPECT_NE(late.id, anna.id);
  EXPECT_NE(late.token, anna.token);
  EXPECT_EQ(late.last_sequence, 0u);
  Guest guesser = Join({.token = "guess"});
  EXPECT_FALSE(guesser.resumed);
}

TEST_F(ParticipantsTest, WhoHasFinishedDoesNotComeBack) {
  Guest anna = JoinAndSee({});
  anna.participant->Lock(1, std::vector<int32_t>{3}, {}, 0);
  anna.participant->Leave();
  Guest bert = JoinAndSee({});
  EXPECT_FALSE(Put(bert, 1, 3, 1));  // It might come back.
  Refused(bert);
  anna.participant->Forget();
  EXPECT_TRUE(Put(bert, 2, 3, 1));
  EXPECT_FALSE(Join({.token = anna.token}).resumed);
}

TEST_F(ParticipantsTest, AnswersThatAreLostComeAgain) {
  Guest anna = JoinAndSee({});
  Guest bert = JoinAndSee({});
  Put(bert, 1, 3, 5);
  rooms_.executor.RunAll();
  anna.participant->Lock(1, std::vector<int32_t>{4}, {}, 0);
  Put(anna, 2, 3, 1, {.base_revision = 0});
  Put(anna, 3, 5, 1);
  Put(anna, 4, 3, 1, {.base_revision = 0});
  anna.participant.reset();
  Guest back = Join({.token = anna.token, .last_sequence = 1});
  EXPECT_EQ(back.last_sequence, 3u);
  // Not the lock, which is known, nor pose 4, which will be sent again.
  EXPECT_EQ(Refused(back).sequence, 2u);
  rooms_.executor.RunAll();
  EXPECT_EQ(back.TakeFrame().answers_sequence, 3u);
}

}  // namespace
}  // namespace deform::server
