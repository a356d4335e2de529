// What the server tells about itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cli/exit_code.h"
#include "tests/client/cli/cli_run.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::HasSubstr;

// Reads until the stream has ended.
void ReadAll(DeformStream& stream) {
  Frame frame;
  while (!stream.ended()) stream.NextFrame(frame).IgnoreError();
}

TEST(Status, CountsWhatTheServerHolds) {
  RunningServer server;
  const std::string session = server.BallSession();
  const ServerStatus alone = server.client().GetServerStatus().value();
  EXPECT_EQ(alone.models, 1);
  EXPECT_EQ(alone.bindings, 1);
  EXPECT_EQ(alone.sessions, 1);
  EXPECT_EQ(alone.participants, 0);
  DeformStream first = server.client().Deform(session).value();
  DeformStream second = server.client().Deform(session).value();
  EXPECT_EQ(server.client().GetServerStatus()->participants, 2);
}

TEST(Status, CountsTheThingsOfAllTenants) {
  RunningServer server;
  server.BindBall();
  Client other = server.Connect("other");
  RunningServer::BindBall(other);
  EXPECT_EQ(other.GetServerStatus()->models, 2);
}

TEST(Status, CountsPosesAndFramesExactly) {
  RunningServer server;
  DeformStream stream =
      server.client().Deform(server.BallSession(), Delivery::kEvery).value();
  const PoseUpdate right = {.vertices = {0},
                            .positions = Positions::Zero(1, 3)};
  PoseUpdate wrong = right;
  wrong.vertices = {8};
  for (int i = 0; i < 3; ++i) stream.Send(right).value();
  stream.Send(wrong).value();
  stream.Close();
  ReadAll(stream);
  const ServerStatus status = server.client().GetServerStatus().value();
  EXPECT_EQ(status.poses_accepted, 3);
  EXPECT_EQ(status.poses_rejected, 1);
  // One at joining, one for each pose.
  EXPECT_EQ(status.frames_sent, 4);
  // 162 points of three floats each, and some header.
  EXPECT_GT(status.frame_bytes_sent, 4 * 162 * 12);
  EXPECT_LT(status.frame_bytes_sent, 4 * (162 * 12 + 200));
}

TEST(Status, MeasuresTheProcess) {
  RunningServer server;
  const ServerStatus before = server.client().GetServerStatus().value();
  server.BindBall();
  const ServerStatus after = server.client().GetServerStatus().value();
  EXPECT_GT(before.cpu_seconds, 0);
  EXPECT_GT(after.cpu_seconds, before.cpu_seconds);
  EXPECT_GE(after.uptime_seconds, before.uptime_seconds);
  // More than a megabyte: a count of pages or kilobytes would be less.
  EXPECT_GT(after.resident_bytes, 1 << 20);
  // Output and error output, at least, and a socket.
  EXPECT_GE(after.open_files, 3);
  EXPECT_LT(after.open_files, 1000);
  EXPECT_GT(after.processors, 0);
  EXPECT_NE(after.version, "");
}

TEST(Status, IsShownByDeformctl) {
  RunningServer server;
  server.BindBall();
  const cli::CliResult text =
      cli::RunCli({"--server", server.address(), "status"});
  EXPECT_EQ(text.exit_code, cli::kOk) << text.err;
  EXPECT_THAT(text.out, HasSubstr("holds          1 models, 1 bindings, 0 "
                                  "sessions with 0 participants\n"));
  const cli::CliResult json =
      cli::RunCli({"--server", server.address(), "status", "--json"});
  EXPECT_EQ(json.json()["models"], 1);
  EXPECT_GT(json.json()["resident_bytes"].get<int64_t>(), 1 << 20);
}

}  // namespace
}  // namespace deform
