// Participants that want at most so many frames a second.
#include <gtest/gtest.h>

#include <random>

#include "server/sessions/session.h"
#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

using std::chrono::milliseconds;

class LimitedFrames : public testing::Test {
 protected:
  FakeStream Join(const FrameWishes& wishes) {
    FakeStream stream;
    auto joined = session_->Join(Delivery::kLatest, wishes, stream.receiver);
    EXPECT_TRUE(joined.ok()) << joined.status();
    stream.participant = std::move(joined->participant);
    rooms_.executor.RunAll();
    // The order of points, if it is on a grid, and a frame.
    while (stream.participant->Take()) {
    }
    return stream;
  }
  FakeStream JoinTenASecond() { return Join({.max_fps = 10}); }
  void Pose(FakeStream& stream, uint64_t sequence) {
    EXPECT_TRUE(stream.participant->Submit(
        sequence, MovedBy({0.001 * static_cast<double>(sequence), 0, 0})));
    rooms_.executor.RunAll();
  }
  void Pass(int time) {
    rooms_.clock.Advance(milliseconds(time));
    rooms_.executor.RunAll();
  }
  bool NothingWaits() {
    return rooms_.executor.waiting() == 0 && rooms_.clock.waiting_calls() == 0;
  }

  SessionRooms rooms_;
  std::shared_ptr<Session> session_ = Session::Create(
      "s", rooms_.bindings().Use("t", rooms_.binding_id, "session s").value(),
      {}, rooms_.Environment());
};

TEST_F(LimitedFrames, TheLastStateComesWithoutAnotherPose) {
  FakeStream stream = JoinTenASecond();
  EXPECT_TRUE(NothingWaits());
  Pose(stream, 1);
  Pose(stream, 2);
  EXPECT_FALSE(stream.participant->Take());
  EXPECT_EQ(rooms_.clock.waiting_calls(), 1u);
  Pass(99);
  EXPECT_FALSE(stream.participant->Take());
  const int wakes = stream.receiver->wakes;
  Pass(1);
  EXPECT_GT(stream.receiver->wakes, wakes);
  const FrameToSend sent = stream.TakeFrame();
  EXPECT_EQ(sent.frame->info.revision, 2u);
  EXPECT_EQ(sent.answers_sequence, 2u);
  EXPECT_EQ(sent.skipped_revisions, 1u);
  // Who is told all costs nothing more.
  EXPECT_FALSE(stream.participant->Take());
  EXPECT_TRUE(NothingWaits());
}

TEST_F(LimitedFrames, OthersGetAllAndShareTheirFrames) {
  FakeStream viewer = JoinTenASecond();
  FakeStream editor = Join({});
  std::shared_ptr<const Frame> last;
  for (uint64_t i = 1; i <= 5; ++i) {
    Pose(editor, i);
    last = editor.TakeFrame().frame;
    EXPECT_EQ(last->info.revision, i);
  }
  // Nothing is made for the viewer.
  rooms_.clock.Advance(milliseconds(100));
  EXPECT_EQ(rooms_.executor.waiting(), 0u);
  EXPECT_EQ(viewer.TakeFrame().frame, last);
}

TEST_F(LimitedFrames, AFrameOfItsOwnIsMadeWhenItIsDue) {
  FakeStream viewer = Join({.encodings = {FindEncoding("predicted")},
                            .tolerance = 1e-4,
                            .max_fps = 10});
  FakeStream editor = Join({});
  for (uint64_t i = 1; i <= 5; ++i) Pose(editor, i);
  rooms_.clock.Advance(milliseconds(100));
  EXPECT_EQ(rooms_.executor.RunAll(), 1);
  const FrameToSend sent = viewer.TakeFrame();
  EXPECT_EQ(sent.frame->info.revision, 5u);
  EXPECT_EQ(sent.frame->reference_revision, 0u);
}

TEST_F(LimitedFrames, AKeyframeWaitsItsTurn) {
  FakeStream stream = JoinTenASecond();
  stream.participant->WantKeyframe();
  EXPECT_EQ(rooms_.executor.RunAll(), 0);
  EXPECT_FALSE(stream.participant->Take());
  Pass(100);
  EXPECT_EQ(stream.TakeFrame().frame->info.revision, 0u);
}

TEST_F(LimitedFrames, TheLastAnswerOfAStreamDoesNotWait) {
  FakeStream stream = JoinTenASecond();
  Pose(stream, 1);
  EXPECT_FALSE(stream.participant->Take());
  stream.participant->HalfClose();
  rooms_.executor.RunAll();
  EXPECT_EQ(stream.TakeFrame().answers_sequence, 1u);
  EXPECT_TRUE(stream.TakeEnd().ok());
}

TEST_F(LimitedFrames, NorDoesThatOfASessionThatDrains) {
  FakeStream stream = JoinTenASecond();
  Pose(stream, 1);
  session_->Drain(absl::UnavailableError("later"));
  rooms_.executor.RunAll();
  EXPECT_EQ(stream.TakeFrame().answers_sequence, 1u);
  EXPECT_EQ(stream.TakeEnd().message(), "later");
}

TEST_F(LimitedFrames, WhoHasLeftIsNotWaitedFor) {
  FakeStream stream = JoinTenASecond();
  Pose(stream, 1);
  stream.participant->Leave();
  Pass(100);
  EXPECT_TRUE(NothingWaits());
}

TEST_F(LimitedFrames, ASessionMayBeGoneBeforeTheyAreDue) {
  FakeStream stream = JoinTenASecond();
  Pose(stream, 1);
  stream.participant.reset();
  const std::weak_ptr<Session> alive = session_;
  session_.reset();
  EXPECT_TRUE(alive.expired());
  Pass(100);
}

// Two viewers that take what there is when they like; poses when they like.
TEST_F(LimitedFrames, AreNeverMoreAndEndWithTheLastWhateverHappens) {
  std::mt19937 random(5);
  FakeStream editor = Join({});
  struct Viewer {
    FakeStream stream;
    int interval = 0;  // In ms.
    int last = 0;      // When its last frame was taken.
    uint64_t revision = 0;
    int frames = 0;
  };
  std::vector<Viewer> viewers;
  viewers.push_back({Join({.max_fps = 40}), 25});
  viewers.push_back({Join({.encodings = {FindEncoding("predicted")},
                           .tolerance = 1e-4,
                           .max_fps = 8}),
                     125});
  int now = 0;
  uint64_t revision = 0;
  const auto take = [&](Viewer& viewer) {
    const auto next = viewer.stream.participant->Take();
    rooms_.executor.RunAll();
    if (!next) return;
    const auto& sent = std::get<FrameToSend>(*next);
    EXPECT_GE(now - viewer.last, viewer.interval);
    EXPECT_EQ(sent.skipped_revisions,
              sent.frame->info.revision - viewer.revision - 1);
    viewer.last = now;
    viewer.revision = sent.frame->info.revision;
    ++viewer.frames;
  };
  const auto pass = [&](int time) {
    Pass(time);
    now += time;
  };
  for (int i = 0; i < 3000; ++i) {
    pass(static_cast<int>(random() % 20));
    if (random() % 3 != 0) Pose(editor, ++revision);
    editor.participant->Take();
    for (Viewer& viewer : viewers) {
      if (random() % 2 == 0) take(viewer);
    }
  }
  for (Viewer& viewer : viewers) {
    take(viewer);  // If there was one, it is sent then.
    pass(viewer.interval);
    take(viewer);
    pass(viewer.interval);
    take(viewer);
    EXPECT_EQ(viewer.revision, revision);
    // 28 seconds of looking in every 19 ms, or less, on average.
    EXPECT_GT(viewer.frames, now / (viewer.interval + 60));
  }
  EXPECT_TRUE(NothingWaits());
}

}  // namespace
}  // namespace deform::server
