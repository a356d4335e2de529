#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/base/error.h"
#include "server/rpc/convert.h"

namespace deform::server {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;

TEST(ConvertIntroduction, KeepsWhatIsSaid) {
  v1::Join join;
  absl::StatusOr<Introduction> who = IntroductionOf(join);
  EXPECT_EQ(who->role, Role::kEditor);
  EXPECT_FALSE(who->wants_presence);
  EXPECT_TRUE(who->token.empty());
  join.set_role(v1::ROLE_VIEWER);
  join.set_name("Anna");
  join.set_presence(true);
  join.mutable_resume()->set_token("t");
  join.mutable_resume()->set_last_sequence(5);
  join.mutable_resume()->set_rig_changes(2);
  who = IntroductionOf(join);
  EXPECT_EQ(who->role, Role::kViewer);
  EXPECT_EQ(who->name, "Anna");
  EXPECT_TRUE(who->wants_presence);
  EXPECT_EQ(who->token, "t");
  EXPECT_FALSE(who->last_revision.has_value());
  EXPECT_EQ(who->last_sequence, 5u);
  EXPECT_EQ(who->rig_changes, 2u);
  join.mutable_resume()->set_last_revision(0);
  EXPECT_EQ(IntroductionOf(join)->last_revision, 0u);
}

TEST(ConvertIntroduction, RefusesWhatItDoesNotKnow) {
  v1::Join join;
  join.mutable_resume()->set_token(std::string(65, 't'));
  absl::Status status = IntroductionOf(join).status();
  EXPECT_EQ(DetailOf(status).reason, "BAD_TOKEN");
  EXPECT_EQ(status.message(), "a resume token of 65 bytes; at most 64");
  join.set_role(static_cast<v1::Role>(7));
  EXPECT_EQ(IntroductionOf(join).status().message(), "role 7 is not known");
}

TEST(ConvertHandles, RefusesWhatIsNoIndex) {
  v1::LockHandles lock;
  lock.add_vertices(3);
  lock.add_vertices(0x7fffffff);
  EXPECT_THAT(ToHandles(lock.vertices(), "lock.vertices").value(),
              ElementsAre(3, 0x7fffffff));
  lock.add_vertices(0x80000000);
  const absl::Status status =
      ToHandles(lock.vertices(), "lock.vertices").status();
  EXPECT_EQ(DetailOf(status).reason, "INDEX_OUT_OF_RANGE");
  EXPECT_EQ(status.message(), "lock.vertices names vertex 2147483648");
}

TEST(ConvertTerms, TellApartWhatIsMissing) {
  v1::Pose pose;
  pose.set_edit(4);
  EXPECT_EQ(TermsOf(pose).edit, 4u);
  EXPECT_FALSE(TermsOf(pose).base_revision.has_value());
  pose.set_base_revision(0);
  EXPECT_EQ(TermsOf(pose).base_revision, 0u);
}

TEST(ConvertPresence, TellsHowLongLocksLast) {
  const std::chrono::steady_clock::time_point now{milliseconds(1000)};
  PresenceChange change{.complete = true, .left = {9}};
  change.present.push_back(
      {.id = 3,
       .name = "Anna",
       .role = Role::kViewer,
       .shown = {.grabbed = {1}, .cursor = "c"},
       .locks = {{.handle = 5, .owner = 3, .until = now + milliseconds(250)},
                 {.handle = 6, .owner = 3, .until = now}}});
  v1::Participants out;
  ToProto(change, now, &out);
  EXPECT_TRUE(out.complete());
  EXPECT_THAT(out.left(), ElementsAre(9));
  const v1::Participant& anna = out.participants(0);
  EXPECT_EQ(anna.participant_id(), 3u);
  EXPECT_EQ(anna.name(), "Anna");
  EXPECT_EQ(anna.role(), v1::ROLE_VIEWER);
  EXPECT_THAT(anna.grabbed(), ElementsAre(1));
  EXPECT_EQ(anna.cursor(), "c");
  ASSERT_EQ(anna.locks_size(), 1);  // The other's lease has ended.
  EXPECT_EQ(anna.locks(0).vertex(), 5u);
  EXPECT_EQ(anna.locks(0).remaining_ms(), 250u);
}

TEST(ConvertRejection, TellsWhatToMergeWith) {
  Rejection rejection{.sequence = 4, .status = absl::AbortedError("overtaken")};
  v1::PoseRejected out;
  ToProto(rejection, &out);
  EXPECT_EQ(out.sequence(), 4u);
  EXPECT_EQ(out.status().message(), "overtaken");
  EXPECT_FALSE(out.has_current());
  rejection.current = {.revision = 7, .dimension = 2};
  rejection.current->pose.vertices = Positions::Ones(3, 3);
  rejection.current->pose.stretch_blend = 0.5;
  ToProto(rejection, &out);
  EXPECT_EQ(out.current().revision(), 7u);
  EXPECT_EQ(out.current().pose_size(), 6);
  EXPECT_EQ(out.current().stretch_blend(), 0.5);
}

}  // namespace
}  // namespace deform::server
