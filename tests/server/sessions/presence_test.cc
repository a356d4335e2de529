#include "server/sessions/presence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"

namespace deform::server {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<int64_t> Ids(const PresenceChange& change) {
  std::vector<int64_t> ids;
  for (const Attendee& attendee : change.present) ids.push_back(attendee.id);
  return ids;
}

TEST(Presence, TellsANewcomerEverything) {
  Presence presence;
  presence.Enter({.id = 1, .name = "Anna"});
  presence.Enter({.id = 2, .name = "Bert", .role = Role::kViewer});
  presence.Leave(1);
  const PresenceChange change = presence.Since(0);
  EXPECT_TRUE(change.complete);
  EXPECT_THAT(Ids(change), ElementsAre(2));
  EXPECT_EQ(change.present[0].name, "Bert");
  EXPECT_EQ(change.present[0].role, Role::kViewer);
  EXPECT_EQ(change.version, presence.version());
}

TEST(Presence, TellsOthersWhatHasChanged) {
  Presence presence;
  presence.Enter({.id = 1});
  presence.Enter({.id = 2});
  presence.Enter({.id = 3});
  const uint64_t known = presence.version();
  presence.Show(2, {.grabbed = {7}, .cursor = "here"});
  presence.Leave(3);
  presence.Enter({.id = 4});
  const PresenceChange change = presence.Since(known);
  EXPECT_FALSE(change.complete);
  EXPECT_THAT(Ids(change), ElementsAre(2, 4));
  EXPECT_THAT(change.present[0].shown.grabbed, ElementsAre(7));
  EXPECT_EQ(change.present[0].shown.cursor, "here");
  EXPECT_THAT(change.left, ElementsAre(3));
  EXPECT_THAT(Ids(presence.Since(change.version)), IsEmpty());
}

TEST(Presence, ManyChangesAreOne) {
  Presence presence;
  presence.Enter({.id = 1});
  const uint64_t known = presence.version();
  for (int i = 0; i < 1000; ++i) {
    presence.Show(1, {.cursor = std::to_string(i)});
  }
  const PresenceChange change = presence.Since(known);
  ASSERT_THAT(Ids(change), ElementsAre(1));
  EXPECT_EQ(change.present[0].shown.cursor, "999");
}

TEST(Presence, SaysNothingWhereNothingChanges) {
  Presence presence;
  presence.Enter({.id = 1});
  presence.Show(1, {.cursor = "here"});
  presence.SetLocks(1, {{.handle = 2, .owner = 1}});
  const uint64_t known = presence.version();
  presence.Show(1, {.cursor = "here"});
  presence.SetLocks(1, {{.handle = 2, .owner = 1}});
  presence.Show(9, {.cursor = "nobody"});
  presence.Leave(9);
  EXPECT_EQ(presence.version(), known);
}

TEST(Presence, WhoComesBackHasNotLeft) {
  Presence presence;
  presence.Enter({.id = 1});
  const uint64_t known = presence.version();
  presence.Leave(1);
  presence.Enter({.id = 1});
  const PresenceChange change = presence.Since(known);
  EXPECT_THAT(Ids(change), ElementsAre(1));
  EXPECT_THAT(change.left, IsEmpty());
}

TEST(Presence, WhoIsFarBehindIsToldAllAnew) {
  Presence presence;
  presence.Enter({.id = 1});
  const uint64_t known = presence.version();
  const auto come_and_go = [&](int64_t id) {
    presence.Enter({.id = id});
    presence.Leave(id);
  };
  for (size_t i = 0; i < Presence::kMaxLeft; ++i) {
    come_and_go(100 + static_cast<int64_t>(i));
  }
  EXPECT_FALSE(presence.Since(known).complete);
  EXPECT_EQ(presence.Since(known).left.size(), Presence::kMaxLeft);
  come_and_go(99);
  const PresenceChange change = presence.Since(known);
  EXPECT_TRUE(change.complete);
  EXPECT_THAT(Ids(change), ElementsAre(1));
  EXPECT_THAT(change.left, IsEmpty());
}

TEST(Presence, GrabbedHandlesFollowTheRig) {
  Presence presence;
  presence.Enter({.id = 1, .shown = {.grabbed = {0, 2}, .cursor = "c"}});
  presence.Renumber({1, -1, 2});
  EXPECT_THAT(presence.Find(1)->shown.grabbed, ElementsAre(2));
  EXPECT_EQ(presence.Find(1)->shown.cursor, "c");
}

TEST(Presence, BoundsWhatIsShown) {
  EXPECT_TRUE(Presence::Check({.grabbed = std::vector<int32_t>(256, 7),
                               .cursor = std::string(256, 'c')},
                              8)
                  .ok());
  absl::Status status = Presence::Check({.cursor = std::string(257, 'c')}, 8);
  EXPECT_EQ(DetailOf(status).reason, "CURSOR_TOO_LARGE");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("a cursor of 257 bytes; at most 256"));
  status = Presence::Check({.grabbed = std::vector<int32_t>(257, 0)}, 8);
  EXPECT_EQ(DetailOf(status).reason, "TOO_MANY_HANDLES");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("257 grabbed handles; at most 256"));
  for (const int32_t handle : {-1, 8}) {
    status = Presence::Check({.grabbed = {handle}}, 8);
    EXPECT_EQ(DetailOf(status).reason, "INDEX_OUT_OF_RANGE");
    EXPECT_THAT(std::string(status.message()), HasSubstr("of 8"));
  }
  EXPECT_TRUE(Presence::CheckName(std::string(64, 'n')).ok());
  status = Presence::CheckName(std::string(65, 'n'));
  EXPECT_EQ(DetailOf(status).reason, "NAME_TOO_LONG");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("has 65 bytes; at most 64"));
}

}  // namespace
}  // namespace deform::server
