#include "server/sessions/session_manager.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

using testing::HasSubstr;

class SessionManagerTest : public testing::Test {
 protected:
  SessionRooms rooms_;
  SessionManager sessions_{
      rooms_.bindings(), {.memory = 1 << 20, .count = 3}, rooms_.Environment()};
};

TEST_F(SessionManagerTest, TakesTheClientsIdOrMakesOne) {
  EXPECT_EQ(sessions_.Create("t", rooms_.binding_id, "mine").value()->id(),
            "mine");
  const std::string made =
      sessions_.Create("t", rooms_.binding_id, "").value()->id();
  EXPECT_THAT(made, testing::MatchesRegex("s-[0-9a-f]+"));
  EXPECT_NE(sessions_.Create("t", rooms_.binding_id, "").value()->id(), made);
}

TEST_F(SessionManagerTest, ReturnsTheSessionThatIsThere) {
  const auto first = sessions_.Create("t", rooms_.binding_id, "mine").value();
  EXPECT_EQ(sessions_.Create("t", rooms_.binding_id, "mine").value(), first);
}

TEST_F(SessionManagerTest, DoesNotGiveAnIdToAnotherBinding) {
  ASSERT_TRUE(sessions_.Create("t", rooms_.binding_id, "mine").ok());
  const absl::Status taken = sessions_.Create("t", "b-other", "mine").status();
  EXPECT_EQ(taken.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(DetailOf(taken).reason, "SESSION_EXISTS");
  EXPECT_EQ(DetailOf(taken).resource_name, "mine");
  EXPECT_THAT(std::string(taken.message()), HasSubstr(rooms_.binding_id));
}

TEST_F(SessionManagerTest, RefusesBadIdsAndUnknownBindings) {
  EXPECT_EQ(
      DetailOf(sessions_.Create("t", rooms_.binding_id, "a b").status()).field,
      "session_id");
  EXPECT_EQ(DetailOf(sessions_.Create("t", "b-none", "").status()).reason,
            "BINDING_NOT_FOUND");
  EXPECT_EQ(DetailOf(sessions_.Create("other", rooms_.binding_id, "").status())
                .reason,
            "BINDING_NOT_FOUND");
}

TEST_F(SessionManagerTest, HoldsSoManySessions) {
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(sessions_.Create("t", rooms_.binding_id, "").ok());
  }
  EXPECT_EQ(
      DetailOf(sessions_.Create("t", rooms_.binding_id, "").status()).reason,
      "TOO_MANY_SESSIONS");
}

TEST_F(SessionManagerTest, RefusesSessionsBeyondTheMemoryLimit) {
  SessionManager small(rooms_.bindings(), {.memory = 100, .count = 3},
                       rooms_.Environment());
  const absl::Status refused =
      small.Create("t", rooms_.binding_id, "").status();
  EXPECT_EQ(DetailOf(refused).field, "max-sessions-memory");
}

TEST_F(SessionManagerTest, TheBindingOfASessionCannotBeRemoved) {
  ASSERT_TRUE(sessions_.Create("t", rooms_.binding_id, "mine").ok());
  const absl::Status used = rooms_.bindings().Remove("t", rooms_.binding_id);
  EXPECT_THAT(std::string(used.message()),
              HasSubstr("is used by session mine"));
  ASSERT_TRUE(sessions_.Delete("t", "mine").ok());
  EXPECT_TRUE(rooms_.bindings().Remove("t", rooms_.binding_id).ok());
}

TEST_F(SessionManagerTest, WaitsForWeightsThatWereEvicted) {
  rooms_.EvictWeights();
  const auto session = sessions_.Create("t", rooms_.binding_id, "");
  ASSERT_TRUE(session.ok()) << session.status();
  EXPECT_TRUE(rooms_.bindings()
                  .catalogue()
                  .Find("t", rooms_.binding_id)
                  .value()
                  ->weights->state()
                  .resident);
}

TEST_F(SessionManagerTest, GivesUpWaitingWithItsCaller) {
  rooms_.EvictWeights();
  rooms_.HoldBinding();
  int asked = 0;
  const auto session = sessions_.Create("t", rooms_.binding_id, "mine",
                                        [&] { return ++asked < 2; });
  EXPECT_EQ(session.status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(asked, 2);
  // It left nothing behind.
  EXPECT_TRUE(rooms_.bindings().Remove("t", rooms_.binding_id).ok());
  rooms_.LetBindingGo();
}

TEST_F(SessionManagerTest, DeletingEndsTheStreams) {
  const auto session = sessions_.Create("t", rooms_.binding_id, "mine").value();
  FakeStream stream;
  stream.participant =
      session->Join(Delivery::kLatest, FrameWishes{}, stream.receiver)
          .value()
          .participant;
  ASSERT_TRUE(sessions_.Delete("t", "mine").ok());
  EXPECT_EQ(stream.receiver->wakes, 1);
  const absl::Status end = stream.TakeEnd();
  EXPECT_EQ(end.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(end.message(), "session \"mine\" was deleted");
  EXPECT_EQ(DetailOf(end).reason, "SESSION_DELETED");
  EXPECT_EQ(DetailOf(sessions_.Delete("t", "mine")).reason,
            "SESSION_NOT_FOUND");
}

TEST_F(SessionManagerTest, DrainingTakesNothingNew) {
  const auto session = sessions_.Create("t", rooms_.binding_id, "mine").value();
  sessions_.Drain();
  const absl::Status refused =
      sessions_.Create("t", rooms_.binding_id, "new").status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(DetailOf(refused).reason, "SERVER_DRAINING");
  EXPECT_EQ(
      session->Join(Delivery::kLatest, FrameWishes{}, std::weak_ptr<Receiver>())
          .status()
          .code(),
      absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace deform::server
