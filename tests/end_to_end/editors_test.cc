// Several people on one session, over real connections.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/base/error.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

PoseUpdate Put(int32_t vertex, const Vec3& to) {
  return {.vertices = {vertex}, .positions = Positions(to.transpose())};
}

// The first frame that contains this pose of the stream's own.
Frame FrameWith(DeformStream& stream, uint64_t sequence) {
  Frame frame;
  do {
    const absl::Status status = stream.NextFrame(frame);
    EXPECT_TRUE(status.ok()) << status;
    if (!status.ok()) break;
  } while (frame.answers_sequence < sequence);
  return frame;
}

// The first frame of this revision or a later one.
Frame FrameOf(DeformStream& stream, uint64_t revision) {
  Frame frame;
  do {
    EXPECT_TRUE(stream.NextFrame(frame).ok());
  } while (frame.revision < revision);
  return frame;
}

absl::Status NextRefusal(DeformStream& stream) {
  Frame frame;
  absl::Status status;
  while (status.ok()) status = stream.NextFrame(frame);
  EXPECT_FALSE(stream.ended());
  return status;
}

TEST(Editors, SeeEachOthersMotionAndSoDoesWhoComesLate) {
  RunningServer server;
  const std::string session = server.BallSession();
  auto anna = server.client().Deform(session, Delivery::kEvery).value();
  auto bert = server.client().Deform(session, Delivery::kEvery).value();
  FrameOf(anna, 0);
  FrameOf(bert, 0);
  for (int i = 1; i <= 20; ++i) {
    anna.Send(Put(0, {-1 - 0.01 * i, -1, -1})).value();
    bert.Send(Put(7, {1 + 0.01 * i, 1, 1})).value();
  }
  const Frame at_anna = FrameOf(anna, 40);
  const Frame at_bert = FrameOf(bert, 40);
  EXPECT_EQ(at_anna.positions, at_bert.positions);
  EXPECT_EQ(at_anna.answers_sequence, 20u);
  EXPECT_EQ(at_bert.answers_sequence, 20u);
  auto late = server.client().Deform(session).value();
  Positions pose = Cube().vertices();
  pose.row(0) << -1.2, -1, -1;
  pose.row(7) << 1.2, 1, 1;
  EXPECT_LT((late.joined().pose.vertices - pose).norm(), 1e-12);
  const Frame at_late = FrameOf(late, 40);
  EXPECT_TRUE(at_late.keyframe);
  EXPECT_EQ(at_late.positions, at_anna.positions);
}

TEST(Editors, AViewerSeesAndIsToldWhyItCannotMove) {
  RunningServer server;
  const std::string session = server.BallSession();
  auto viewer =
      server.client()
          .Deform(session, DeformOptions{.role = ParticipantRole::kViewer})
          .value();
  viewer.Send(Put(0, {-2, -1, -1})).value();
  const absl::Status refused = NextRefusal(viewer);
  EXPECT_EQ(refused.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(DetailOf(refused).reason, "VIEWER");
  EXPECT_THAT(std::string(refused.message()),
              HasSubstr("join with the role of an editor"));
  auto editor = server.client().Deform(session).value();
  editor.Send(Put(0, {-2, -1, -1})).value();
  EXPECT_EQ(FrameOf(viewer, 1).positions, FrameWith(editor, 1).positions);
}

TEST(Editors, LockHandlesAndSeeWhoHasThem) {
  RunningServer server;
  const std::string session = server.BallSession();
  std::vector<ParticipantInfo> seen;
  std::vector<uint64_t> acknowledged;
  auto anna =
      server.client()
          .Deform(session,
                  DeformOptions{.name = "Anna",
                                .on_acknowledged =
                                    [&](const AcknowledgedRequest& r) {
                                      acknowledged.push_back(r.sequence);
                                    }})
          .value();
  auto bert =
      server.client()
          .Deform(session,
                  DeformOptions{
                      .name = "Bert",
                      .on_participants = [&](const auto& all) { seen = all; }})
          .value();
  const std::vector<int32_t> handles = {3, 5};
  EXPECT_EQ(anna.Lock(handles).value(), 1u);
  ASSERT_TRUE(anna.Show(std::vector<int32_t>{3}, "at 3").ok());
  anna.Send(Put(3, {1, 1, -2})).value();
  FrameWith(anna, 2);
  EXPECT_THAT(acknowledged, ElementsAre(1u));
  bert.Send(Put(5, {2, 2, 2})).value();
  const absl::Status refused = NextRefusal(bert);
  EXPECT_EQ(DetailOf(refused).reason, "HANDLE_LOCKED");
  EXPECT_THAT(std::string(refused.message()),
              HasSubstr("handle 5 is locked by participant 1 (\"Anna\")"));
  // What anna shows has come before, or comes with a coming frame.
  uint64_t sequence = 1;
  while (seen.size() < 2 || seen[0].locked != handles ||
         seen[0].cursor != "at 3") {
    sequence = bert.Send(Put(6, {-1, 1, 1 + 0.01 * sequence})).value();
    FrameWith(bert, sequence);
  }
  EXPECT_EQ(seen[0].name, "Anna");
  EXPECT_THAT(seen[0].grabbed, ElementsAre(3));
  EXPECT_EQ(seen[1].id, bert.joined().participant_id);
  anna.Unlock().value();
  anna.Send(Put(3, {1, 1, -3})).value();
  FrameWith(anna, 4);
  EXPECT_THAT(acknowledged, ElementsAre(1u, 3u));
  FrameWith(bert, bert.Send(Put(5, {2, 2, 2})).value());
}

TEST(Editors, UndoTheirOwnEdits) {
  RunningServer server;
  const std::string session = server.BallSession();
  std::vector<AcknowledgedRequest> acknowledged;
  auto anna =
      server.client()
          .Deform(session, DeformOptions{.on_acknowledged =
                                             [&](const AcknowledgedRequest& r) {
                                               acknowledged.push_back(r);
                                             }})
          .value();
  auto bert = server.client().Deform(session).value();
  for (int i = 1; i <= 10; ++i) {
    anna.Send(Put(0, {-1 - 0.1 * i, -1, -1}), {.edit = 4}).value();
    anna.Send(Put(1, {1, -1, -1 - 0.1 * i}), {.edit = 4}).value();
  }
  FrameWith(anna, 20);
  FrameWith(bert, bert.Send(Put(1, {5, 5, 5})).value());
  FrameWith(anna, anna.Undo().value());
  ASSERT_EQ(acknowledged.size(), 1u);
  EXPECT_EQ(acknowledged[0].edit, 4u);
  EXPECT_THAT(acknowledged[0].left_out, ElementsAre(1));
  auto late = server.client().Deform(session).value();
  Positions pose = Cube().vertices();
  pose.row(1) << 5, 5, 5;
  EXPECT_EQ(late.joined().pose.vertices, pose);
  anna.Undo().value();
  EXPECT_EQ(DetailOf(NextRefusal(anna)).reason, "NOTHING_TO_UNDO");
}

TEST(Editors, MergeAfterAConflict) {
  RunningServer server;
  const std::string session = server.BallSession();
  auto anna = server.client().Deform(session).value();
  auto bert = server.client().Deform(session).value();
  const Frame seen = FrameOf(bert, 0);
  FrameWith(anna, anna.Send(Put(2, {-1, 3, -1})).value());
  bert.Send(Put(2, {-1, 4, -1}), {.base_revision = seen.revision}).value();
  const absl::Status refused = NextRefusal(bert);
  EXPECT_EQ(refused.code(), absl::StatusCode::kAborted);
  EXPECT_EQ(DetailOf(refused).reason, "REVISION_CONFLICT");
  ASSERT_TRUE(bert.conflict());
  EXPECT_EQ(bert.conflict()->pose.vertices(2, 1), 3);
  FrameWith(bert, bert.Send(Put(2, {-1, 3.5, -1}),
                            {.base_revision = bert.conflict()->revision})
                      .value());
}

}  // namespace
}  // namespace deform
