// deformctl load against a live server. Runs are short: what is looked at is
// that the numbers add up, not how fast anything is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <algorithm>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "client/cli/exit_code.h"
#include "client/cpp/deform_call.h"
#include "core/files/mesh_file.h"
#include "tests/client/cli/cli_run.h"
#include "tests/end_to_end/falsifying_server.h"
#include "tests/end_to_end/running_server.h"
#include "tests/support/temporary_folder.h"

namespace deform::cli {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// Half a second of a few small sessions, each looked at often.
std::vector<std::string> ShortLoad(const std::string& address,
                                   std::vector<std::string> more = {}) {
  std::vector<std::string> arguments = {"--server",   address,   "load",
                                        "--duration", "400ms",   "--warm-up",
                                        "100ms",      "--check", "50ms"};
  if (std::find(more.begin(), more.end(), "--points") == more.end()) {
    arguments.insert(arguments.end(), {"--points", "200"});
  }
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

class Load : public testing::Test {
 protected:
  CliResult Run(const std::vector<std::string>& more) {
    return RunCli(ShortLoad(server_.address(), more));
  }
  Json RunJson(std::vector<std::string> more) {
    more.push_back("--json");
    const CliResult result = Run(more);
    EXPECT_EQ(result.exit_code, kOk) << result.out << result.err;
    EXPECT_EQ(result.err, "");
    return result.json();
  }
  bool ServerIsEmpty() {
    return server_.client().ListModels()->empty() &&
           server_.client().ListBindings()->empty() &&
           server_.client().ListSessions()->empty();
  }
  // Returns when the server has accepted some poses of a load.
  void WaitForPoses() {
    while (server_.client().GetServerStatus()->poses_accepted < 5) {
      std::this_thread::yield();
    }
  }

  RunningServer server_;
  const TemporaryFolder folder_;
};

TEST_F(Load, AnswersEveryPoseAndAddsUp) {
  const Json report =
      RunJson({"--sessions", "3", "--editors", "2", "--viewers", "1", "--rate",
               "50", "--delivery", "every", "--connections", "2"});
  // 3 x 2 editors, 0.5 s at 50 Hz.
  EXPECT_EQ(report["poses"]["due"], 150);
  EXPECT_EQ(report["poses"]["sent"], 150);
  EXPECT_EQ(report["poses"]["answered"], 150);
  // Of these the ones that were due in the 0.4 s after the warm-up.
  EXPECT_EQ(report["latency_ms"]["count"], 120);
  EXPECT_EQ(report["client"]["lateness_ms"]["count"], 120);
  int64_t over_time = 0;
  for (const Json& interval : report["latency_ms_over_time"]) {
    over_time += interval["count"].get<int64_t>();
  }
  EXPECT_EQ(over_time, 120);
  EXPECT_GT(report["latency_ms"]["p50"], 0);
  EXPECT_LE(report["latency_ms"]["p50"], report["latency_ms"]["p99"]);
  EXPECT_LE(report["latency_ms"]["p99"], report["latency_ms"]["max"]);
  EXPECT_EQ(report["connections"], 2);
  EXPECT_EQ(report["ok"], true);
  EXPECT_EQ(report["skipped_revisions"], 0);
  EXPECT_TRUE(ServerIsEmpty());
  const ServerStatus status = server_.client().GetServerStatus().value();
  EXPECT_EQ(status.poses_accepted, 150);
  EXPECT_EQ(status.poses_rejected, 0);
  // Each pose is a revision, which all three participants of its session get,
  // beside a frame at joining; but who was answered may leave before the last.
  EXPECT_LE(status.frames_sent, 3 * 3 * (50 + 1));
  EXPECT_GE(status.frames_sent, 3 * 2 * (25 + 1) + 3);
}

TEST_F(Load, AnswersEveryPoseWithTheNewestFrameToo) {
  const Json report = RunJson({"--sessions", "2", "--rate", "200"});
  EXPECT_EQ(report["delivery"], "latest");
  EXPECT_EQ(report["poses"]["due"], 200);
  EXPECT_EQ(report["poses"]["answered"], 200);
  EXPECT_EQ(report["latency_ms"]["count"], 160);
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Load, ViewersMayWantFewFrames) {
  const Json report = RunJson({"--viewers", "2", "--viewer-fps", "5"});
  EXPECT_EQ(report["viewer_fps"], 5);
  EXPECT_EQ(report["poses"]["answered"], report["poses"]["due"]);
  // A viewer gets one in 200 ms; others come meanwhile.
  EXPECT_GT(report["skipped_revisions"], 0);
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Load, FramesMayHaveNormals) {
  const Json report = RunJson({"--normals"});
  EXPECT_EQ(report["normals"], true);
  EXPECT_EQ(report["bytes_per_frame"], 162 * (12 + 2));
}

TEST_F(Load, ChecksFramesOfEverySession) {
  const Json report = RunJson({"--sessions", "3"});
  EXPECT_GE(report["checks"]["frames"], 3);
  EXPECT_EQ(report["checks"]["sessions_unchecked"], 0);
  EXPECT_EQ(report["checks"]["points"],
            162 * report["checks"]["frames"].get<int64_t>());
  EXPECT_GT(report["checks"]["worst"], 0);
  EXPECT_LT(report["checks"]["worst"], 1e-6);
}

struct LoadCase {
  std::string name;
  std::vector<std::string> options;
};

class LoadOf : public Load, public testing::WithParamInterface<LoadCase> {};

TEST_P(LoadOf, IsCheckedAndRight) {
  const Json report = RunJson(GetParam().options);
  EXPECT_EQ(report["poses"]["due"], report["poses"]["answered"]);
  EXPECT_GT(report["checks"]["frames"], 0);
  EXPECT_TRUE(ServerIsEmpty());
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, LoadOf,
    testing::ValuesIn<LoadCase>(
        {{"Jitter", {"--pattern", "jitter"}},
         {"WholeCage", {"--pattern", "whole"}},
         {"Handles", {"--handles", "12", "--pattern", "jitter"}},
         {"ManyModels", {"--models", "3", "--sessions", "4"}},
         // Of several editors the pose is told by all their answers.
         {"EditorsEvery",
          {"--editors", "4", "--pattern", "jitter", "--delivery", "every"}},
         {"EditorsAndViewers",
          {"--editors", "2", "--viewers", "3", "--pattern", "whole"}},
         {"Encoding", {"--encoding", "float32"}},
         {"Poses", {"--encoding", "pose", "--models", "2"}},
         // As many points as are worth compressing.
         {"Bases",
          {"--encoding", "basis", "--frame-tolerance", "1e-4", "--points",
           "20000"}}}),
    [](const auto& test) { return test.param.name; });

TEST_F(Load, PosesABindingThatIsThereAndLeavesIt) {
  const BindingInfo binding = server_.BindBall();
  std::filesystem::create_directory(folder_.Path("poses"));
  for (int i = 0; i < 3; ++i) {
    folder_.Write(absl::StrCat("poses/", i, ".obj"),
                  ObjText(Cube().vertices() * (1 + 0.1 * i), Cube().faces()));
  }
  const CliResult result =
      RunCli({"--server", server_.address(), "load", "--duration", "300ms",
              "--warm-up", "0s", "--check", "50ms", "--binding",
              binding.binding_id, "--poses", folder_.Path("poses"), "--json"});
  ASSERT_EQ(result.exit_code, kOk) << result.out << result.err;
  EXPECT_EQ(result.json()["pattern"], "recorded");
  EXPECT_EQ(result.json()["point_count"], 162);
  EXPECT_GT(result.json()["checks"]["frames"], 0);
  EXPECT_EQ(server_.client().ListBindings()->size(), 1u);
  EXPECT_TRUE(server_.client().ListSessions()->empty());
}

TEST_F(Load, TellsPeopleWhatItMeasured) {
  const CliResult result = Run({"--sessions", "2"});
  EXPECT_EQ(result.exit_code, kOk) << result.out << result.err;
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("2 sessions, each 1 editor at 60 Hz (drag, "
                              "latest) and 0 viewers"),
                    HasSubstr("pose to frame  p50 "),
                    HasSubstr("60 due, 60 sent, 60 answered"),
                    HasSubstr(" processors, "), HasSubstr("checked        ")));
  // No live view where nobody looks.
  EXPECT_THAT(result.err, Not(HasSubstr("\r")));
}

TEST_F(Load, MeasuresTheServer) {
  const Json server = RunJson({})["server"];
  EXPECT_GT(server["processors_used"], 0);
  EXPECT_GT(server["resident_bytes"]["begin"].get<int64_t>(), 1 << 20);
  EXPECT_GE(server["resident_bytes"]["most"], server["resident_bytes"]["end"]);
  EXPECT_GT(server["open_files"]["end"].get<int64_t>(), 3);
  EXPECT_GE(server["over_time"].size(), 2u);
}

TEST_F(Load, DrawsAPicture) {
  RunJson({"--png", folder_.Path("load.png")});
  std::ifstream stream(folder_.Path("load.png"), std::ios::binary);
  std::string head(8, 0);
  stream.read(head.data(), 8);
  EXPECT_EQ(head, "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(Run({"--png", "/nonexistent/load.png"}).exit_code, kBadFile);
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Load, FailsIfThePercentileIsLongerThanItMayBe) {
  const CliResult result = Run({"--p99", "10us"});
  EXPECT_EQ(result.exit_code, kCheckFailed);
  EXPECT_THAT(result.out, HasSubstr("FAILED: p99 is "));
  EXPECT_EQ(Run({"--p99", "1m"}).exit_code, kOk);
}

TEST_F(Load, FindsThatNotEvenOneSessionHolds) {
  const CliResult result = Run({"--find-limit", "--p99", "10us"});
  EXPECT_EQ(result.exit_code, kCheckFailed);
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("1 session: p50 "), HasSubstr("fails, p99 is"),
                    HasSubstr("not even one session holds")));
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Load, FindsTheLargestThatItMayTry) {
  // Two sessions are all the participants that may be: the search ends there.
  const CliResult result = Run({"--find-limit", "--p99", "1m", "--sessions",
                                "1", "--most", "2", "--json"});
  ASSERT_EQ(result.exit_code, kOk) << result.out << result.err;
  EXPECT_EQ(result.json()["sessions"], 2);
  EXPECT_EQ(result.json()["trials"].size(), 2u);
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Load, FailsAServerThatAnswersWrongly) {
  const FalsifyingServer wrong(server_.address(),
                               {.from_revision = 5, .vertex = 7, .off = 1e-4f});
  const CliResult result =
      RunCli(ShortLoad(wrong.address(), {"--sessions", "2", "--json"}));
  EXPECT_EQ(result.exit_code, kCheckFailed) << result.err;
  const Json report = result.json();
  EXPECT_EQ(report["ok"], false);
  const Json& found = report["checks"]["wrong"];
  EXPECT_EQ(found["vertex"], 7);
  EXPECT_GE(found["revision"], 5);
  EXPECT_THAT(found["session"].get<std::string>(), HasSubstr("s-"));
  // 1e-4 of a cage of 3.2 across each way.
  EXPECT_GT(found["error"], 1e-5);
  EXPECT_LT(found["error"], 1e-4);
  EXPECT_THAT(report["failure"].get<std::string>(),
              AllOf(HasSubstr("revision "), HasSubstr("vertex 7 is off by ")));
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Load, PassesAServerThatDoesNotTellHowItIs) {
  const FalsifyingServer right(server_.address(), {});
  const CliResult result = RunCli(ShortLoad(right.address(), {"--json"}));
  EXPECT_EQ(result.exit_code, kOk) << result.out << result.err;
  EXPECT_EQ(result.json()["server"]["processors"], 0);
}

TEST_F(Load, TidiesUpWhenInterrupted) {
  std::ostringstream out, err;
  Interruption interruption;
  int code = 0;
  std::thread load([&] {
    code =
        RunDeformctl({"--server", server_.address(), "load", "--duration", "1h",
                      "--points", "200", "--sessions", "2", "--viewers", "1"},
                     {out, err, false, interruption});
  });
  WaitForPoses();
  interruption.requested = true;
  load.join();
  EXPECT_EQ(code, kInterrupted) << err.str();
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Load, EndsWhenASessionIsTakenFromIt) {
  std::ostringstream out, err;
  Interruption interruption;
  int code = 0;
  std::thread load([&] {
    code = RunDeformctl({"--server", server_.address(), "load", "--duration",
                         "1h", "--points", "200"},
                        {out, err, false, interruption});
  });
  WaitForPoses();
  const std::string session =
      server_.client().ListSessions()->front().session_id;
  ASSERT_TRUE(server_.client().DeleteSession(session).ok());
  load.join();
  EXPECT_EQ(code, kRefused);
  EXPECT_THAT(err.str(), AllOf(HasSubstr(session), HasSubstr("was deleted")));
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Load, SaysWhatTheServerRefuses) {
  server::Options options = TestOptions();
  options.max_sessions = 2;
  RunningServer small(options);
  const CliResult result =
      RunCli(ShortLoad(small.address(), {"--sessions", "3"}));
  EXPECT_EQ(result.exit_code, kRefused);
  EXPECT_THAT(result.err, HasSubstr("(TOO_MANY_SESSIONS)"));
  EXPECT_TRUE(small.client().ListSessions()->empty());
  EXPECT_TRUE(small.client().ListModels()->empty());
}

// Whoever is interested drives streams by events.
class Events : public DeformEvents {
 public:
  void OnJoined(const JoinedSession& joined) override {
    points = joined.point_count;
    Happened();
  }
  void OnFrame(const Frame& frame) override {
    answered = frame.answers_sequence;
    frame_bytes = frame.bytes;
    Happened();
  }
  void OnRejected(uint64_t sequence, const absl::Status& status) override {
    rejected = sequence;
    reason = std::string(status.message());
    Happened();
  }
  void OnRigChange(const RigChange&) override {}
  void OnSent() override { Happened(); }
  void OnEnd(const absl::Status& status) override {
    end = status;
    ended = true;
    Happened();
  }
  template <typename Condition>
  void Await(Condition condition) {
    MutexLock lock(mutex);
    while (!condition()) changed.Wait(mutex);
  }
  void Happened() {
    MutexLock lock(mutex);
    changed.NotifyAll();
  }

  Mutex mutex;
  CondVar changed;
  std::atomic<int64_t> points{0}, frame_bytes{0};
  std::atomic<uint64_t> answered{0}, rejected{0};
  std::atomic<bool> ended{false};
  std::string reason;
  absl::Status end;
};

TEST(DeformCall, SendsPosesAndTellsFramesWithoutAThreadThatWaits) {
  RunningServer server;
  Events events;
  const auto call = server.client().StartDeform(
      server.BallSession(), {.delivery = Delivery::kEvery}, events);
  events.Await([&] { return events.points == 162; });
  const PoseUpdate right = {.vertices = {0},
                            .positions = Positions::Zero(1, 3)};
  // The frame may be here before it is told that the join was sent.
  events.Await([&] { return call->Send(right); });
  events.Await([&] { return events.answered == 1; });
  EXPECT_EQ(events.frame_bytes, 162 * 12);
  PoseUpdate wrong = right;
  wrong.vertices = {8};
  events.Await([&] { return call->Send(wrong); });
  events.Await([&] { return events.rejected == 2; });
  EXPECT_THAT(events.reason, HasSubstr("8"));
  call->Close();
  EXPECT_FALSE(call->Send(right));
  events.Await([&] { return events.ended.load(); });
  EXPECT_TRUE(events.end.ok()) << events.end;
}

TEST(DeformCall, TellsWhyItCouldNotJoin) {
  RunningServer server;
  Events events;
  const auto call = server.client().StartDeform("nowhere", {}, events);
  events.Await([&] { return events.ended.load(); });
  EXPECT_TRUE(absl::IsNotFound(events.end)) << events.end;
}

TEST(DeformCall, EndsWhenItIsDestroyed) {
  RunningServer server;
  Events events;
  auto call = server.client().StartDeform(server.BallSession(), {}, events);
  call.reset();
  EXPECT_TRUE(events.ended);
  EXPECT_TRUE(absl::IsCancelled(events.end)) << events.end;
}

}  // namespace
}  // namespace deform::cli
