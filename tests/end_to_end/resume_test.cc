// Streams that go on when their connection breaks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <string>
#include <thread>

#include "core/base/error.h"
#include "tests/end_to_end/running_server.h"
#include "tests/support/tcp_proxy.h"
#include "tests/support/temporary_folder.h"

namespace deform {
namespace {

using testing::HasSubstr;

// How often a drag loses its connection.
constexpr int64_t kCuts = 100;

// Where vertex 7 is in the k-th pose of a drag: a k that shows in its pose.
PoseUpdate DragTo(int64_t k) {
  return {.vertices = {7},
          .positions = Positions(
              Vec3(1 + 0.001 * static_cast<double>(k), 1, 1).transpose())};
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

// Cuts the connection again and again while poses are sent, a few in flight,
// after a number of bytes in one direction that nobody would choose.
class CutDrag {
 public:
  CutDrag(const server::Options& options, Delivery delivery,
          bool holds_weights = false)
      : server_(options),
        session_(server_.BallSession()),
        client_(Client::Connect(proxy_.address()).value()),
        stream_(client_.Deform(session_, OptionsFor(delivery, holds_weights))
                    .value()) {}

  // Until the last pose was answered. Returns how many were sent.
  uint64_t Run() {
    Frame frame;
    uint64_t sent = 0;
    while (true) {
      const bool goes_on = stream_.reconnections() < kCuts;
      // A connection may end without us, too, and a cut hit an attempt to
      // connect: only what the stream saw counts.
      if (goes_on && proxy_.cuts() >= cuts_to_come_) Arm();
      for (; goes_on && sent < answered_ + 4; ++sent) {
        EXPECT_EQ(stream_.Send(DragTo(static_cast<int64_t>(sent) + 1)).value(),
                  sent + 1);
      }
      if (answered_ == sent && !goes_on) return sent;
      const absl::Status status = stream_.NextFrame(frame);
      EXPECT_TRUE(status.ok()) << status;
      if (!status.ok()) return 0;
      EXPECT_GE(frame.answers_sequence, answered_);
      if (last_) {
        EXPECT_GT(frame.revision, *last_);
      }
      last_ = frame.revision;
      encoding_ = frame.encoding;
      answered_ = frame.answers_sequence;
    }
  }

  RunningServer& server() { return server_; }
  const std::string& session() const { return session_; }
  // Of the last frame.
  const std::string& encoding() const { return encoding_; }

 private:
  DeformOptions OptionsFor(Delivery delivery, bool holds_weights) {
    DeformOptions options{.delivery = delivery};
    if (holds_weights) {
      const SessionInfo session = client_.GetSession(session_).value();
      options.weights = client_.DownloadBinding(session.binding_id).value();
    }
    return options;
  }
  void Arm() {
    std::uniform_int_distribution<int64_t> bytes(1, 20'000);
    cuts_to_come_ = proxy_.cuts() + 1;
    up_ = !up_;
    if (up_) {
      proxy_.CutAfterUp(1 + bytes(random_) / 20);
    } else {
      proxy_.CutAfterDown(bytes(random_));
    }
  }

  RunningServer server_;
  TcpProxy proxy_{server_.address()};
  const std::string session_;
  Client client_;
  DeformStream stream_;
  std::mt19937 random_{5};
  int64_t cuts_to_come_ = 0;
  bool up_ = true;
  uint64_t answered_ = 0;
  std::optional<uint64_t> last_;
  std::string encoding_;
};

TEST(Resume, CutsDuringADragLoseNoPoseAndDuplicateNone) {
  CutDrag drag(TestOptions(), Delivery::kEvery);
  const uint64_t poses = drag.Run();
  // Every pose became a revision of its own, once, in order: nothing else did.
  EXPECT_EQ(drag.server().client().GetSession(drag.session())->revision, poses);
  EXPECT_EQ(drag.server().client().GetServerStatus()->poses_accepted,
            static_cast<int64_t>(poses));
  auto late = drag.server().client().Deform(drag.session()).value();
  EXPECT_EQ(late.joined().pose.vertices.row(7),
            DragTo(static_cast<int64_t>(poses)).positions.row(0));
}

TEST(Resume, SoDoesWhoHoldsTheWeightsAndGetsPoses) {
  CutDrag drag(TestOptions(), Delivery::kEvery, true);
  const uint64_t poses = drag.Run();
  EXPECT_EQ(drag.server().client().GetSession(drag.session())->revision, poses);
  EXPECT_EQ(drag.encoding(), "pose");
}

TEST(Resume, AViewOfTheNewestGoesOnAsWell) {
  CutDrag drag(TestOptions(), Delivery::kLatest);
  const uint64_t poses = drag.Run();
  EXPECT_EQ(drag.server().client().GetServerStatus()->poses_accepted,
            static_cast<int64_t>(poses));
}

TEST(Resume, LosesNoPoseIfThePlaceWasNotKept) {
  server::Options options = TestOptions();
  options.resume_grace = {0};
  CutDrag drag(options, Delivery::kLatest);
  const uint64_t poses = drag.Run();
  EXPECT_GE(drag.server().client().GetServerStatus()->poses_accepted,
            static_cast<int64_t>(poses));
  auto late = drag.server().client().Deform(drag.session()).value();
  EXPECT_EQ(late.joined().pose.vertices.row(7),
            DragTo(static_cast<int64_t>(poses)).positions.row(0));
}

TEST(Resume, GoesOnWhenTheServerWasRestarted) {
  const TemporaryFolder folder;
  server::Options options = TestOptions();
  options.in_memory = false;
  options.data_dir = folder.Path("data");
  std::optional<RunningServer> server(std::in_place, options);
  const std::string session = server->BallSession();
  TcpProxy proxy(server->address());
  Client client = Client::Connect(proxy.address()).value();
  DeformStream stream = client.Deform(session).value();
  uint64_t sent = 0;
  const auto send = [&](int count) {
    for (int i = 0; i < count; ++i) {
      stream.Send(DragTo(static_cast<int64_t>(++sent))).value();
    }
  };
  for (int life = 0; life < 4; ++life) {
    send(20);
    FrameWith(stream, sent);
    proxy.SetOpen(false);
    server.reset();
    send(3);
    server.emplace(options);
    proxy.SetTarget(server->address());
    proxy.SetOpen(true);
    FrameWith(stream, sent);
    // Of the life before nothing came again.
    EXPECT_EQ(server->client().GetServerStatus()->poses_accepted, 3);
  }
  auto late = server->client().Deform(session).value();
  EXPECT_EQ(late.joined().pose.vertices.row(7),
            DragTo(static_cast<int64_t>(sent)).positions.row(0));
}

class ResumeTest : public testing::Test {
 protected:
  DeformStream Join(const DeformOptions& options = {}) {
    return client_.Deform(session_, options).value();
  }
  RunningServer server_;
  TcpProxy proxy_{server_.address()};
  const std::string session_ = server_.BallSession();
  Client client_ = Client::Connect(proxy_.address()).value();
};

TEST_F(ResumeTest, GoesOnWhenTheServerIsReachedAgain) {
  DeformStream stream = Join();
  FrameWith(stream, stream.Send(DragTo(1)).value());
  proxy_.SetOpen(false);
  proxy_.Cut();
  // Sending does not wait for it.
  for (int k = 2; k <= 10; ++k) stream.Send(DragTo(k)).value();
  std::thread later([this] { proxy_.SetOpen(true); });
  FrameWith(stream, 10);
  later.join();
  EXPECT_GE(stream.reconnections(), 1);
  auto late = server_.client().Deform(session_).value();
  EXPECT_EQ(late.joined().pose.vertices.row(7), DragTo(10).positions.row(0));
}

TEST_F(ResumeTest, GivesUpAfterAWhileAndSaysSo) {
  DeformStream stream = Join({.reconnect_for = std::chrono::milliseconds(200)});
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  proxy_.SetOpen(false);
  proxy_.Cut();
  const absl::Status end = stream.NextFrame(frame);
  EXPECT_TRUE(stream.ended());
  EXPECT_EQ(end.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(DetailOf(end).reason, "RECONNECT_TIMEOUT");
  EXPECT_THAT(std::string(end.message()),
              HasSubstr("could not be joined again for 0.2 s"));
  EXPECT_EQ(stream.Send(DragTo(1)).status().code(),
            absl::StatusCode::kUnavailable);
}

TEST_F(ResumeTest, EndsAtOnceIfItIsNotToComeBack) {
  DeformStream stream = Join({.reconnect_for = std::chrono::milliseconds(0)});
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  proxy_.Cut();
  EXPECT_EQ(DetailOf(stream.NextFrame(frame)).reason, "SERVER_UNREACHABLE");
  EXPECT_TRUE(stream.ended());
}

TEST_F(ResumeTest, DoesNotComeBackToASessionThatIsGone) {
  DeformStream stream = Join();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  proxy_.Cut();
  ASSERT_TRUE(server_.client().DeleteSession(session_).ok());
  const absl::Status end = stream.NextFrame(frame);
  EXPECT_TRUE(stream.ended());
  EXPECT_EQ(end.code(), absl::StatusCode::kNotFound);
}

TEST_F(ResumeTest, CancellingEndsTheWaiting) {
  DeformStream stream = Join();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  proxy_.SetOpen(false);
  proxy_.Cut();
  std::thread canceller([&] { stream.Cancel(); });
  EXPECT_EQ(stream.NextFrame(frame).code(), absl::StatusCode::kCancelled);
  canceller.join();
}

TEST_F(ResumeTest, WhatWasClosedIsAnsweredAllTheSame) {
  DeformStream stream = Join();
  FrameWith(stream, stream.Send(DragTo(1)).value());
  proxy_.SetOpen(false);
  proxy_.Cut();
  stream.Send(DragTo(2)).value();
  stream.Close();
  proxy_.SetOpen(true);
  FrameWith(stream, 2);
  Frame frame;
  EXPECT_EQ(stream.NextFrame(frame).code(), absl::StatusCode::kOutOfRange);
}

TEST_F(ResumeTest, AnEditFromBeforeIsUndoneAfterwards) {
  DeformStream stream = Join();
  FrameWith(stream, stream.Send(DragTo(5), {.edit = 1}).value());
  proxy_.Cut();
  FrameWith(stream, stream.Undo().value());
  EXPECT_GE(stream.reconnections(), 1);
  auto late = server_.client().Deform(session_).value();
  EXPECT_EQ(late.joined().pose.vertices, Cube().vertices());
}

TEST_F(ResumeTest, SaysHowManyMayWaitForAnAnswer) {
  DeformStream stream = Join();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  proxy_.SetOpen(false);
  proxy_.Cut();
  absl::Status status;
  int64_t sent = 0;
  for (; status.ok(); ++sent) status = stream.Send(DragTo(sent)).status();
  EXPECT_EQ(sent, 4097);
  EXPECT_EQ(DetailOf(status).reason, "UNANSWERED_LIMIT");
  EXPECT_THAT(std::string(status.message()), HasSubstr("read frames"));
  proxy_.SetOpen(true);
  FrameWith(stream, 4096);
  EXPECT_TRUE(stream.Send(DragTo(1)).ok());
}

}  // namespace
}  // namespace deform
