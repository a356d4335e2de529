// What deformctl load refuses before it looks for a server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cli/duration.h"
#include "client/cli/exit_code.h"
#include "client/cli/load_picture.h"
#include "client/cli/load_text.h"
#include "tests/client/cli/cli_run.h"

namespace deform::cli {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

TEST(ParseDuration, ReadsWhatPeopleWrite) {
  const auto parse = [](const std::string& text) {
    return ParseDuration("--duration", text, "0s", "1h").value();
  };
  EXPECT_EQ(parse("20s"), milliseconds(20000));
  EXPECT_EQ(parse("500ms"), milliseconds(500));
  EXPECT_EQ(parse("2m"), milliseconds(120000));
  EXPECT_EQ(parse("1m30s"), milliseconds(90000));
  EXPECT_EQ(parse("0.5s"), milliseconds(500));
}

struct BadLoad {
  std::string name;
  std::vector<std::string> options;
  std::string message;
};

class LoadRefuses : public testing::TestWithParam<BadLoad> {};

TEST_P(LoadRefuses, AndSaysWhy) {
  std::vector<std::string> arguments = {"load"};
  arguments.insert(arguments.end(), GetParam().options.begin(),
                   GetParam().options.end());
  const CliResult result = RunCli(arguments);
  EXPECT_EQ(result.exit_code, kUsage);
  EXPECT_THAT(result.err, HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Options, LoadRefuses,
    testing::ValuesIn<BadLoad>({
        {"DurationWithoutUnit",
         {"--duration", "20"},
         "--duration: '20' is not a duration, such as 20s, 500ms or 2m"},
        {"DurationTooShort",
         {"--duration", "1ms"},
         "--duration: 1ms is not between 100ms and 1h"},
        {"DurationInfinite",
         {"--duration", "inf"},
         "--duration: inf is not between 100ms and 1h"},
        {"NegativeWarmUp",
         {"--warm-up", "-1s"},
         "--warm-up: -1s is not between 0s and 10m"},
        {"Check", {"--check", "often"}, "--check: 'often' is not a duration"},
        {"NoSessions", {"--sessions", "0"}, "--sessions: Value 0 not in range"},
        {"TooManySessions",
         {"--sessions", "5000"},
         "--sessions: Value 5000 not in range 1 to 4096"},
        {"TooManyParticipants",
         {"--sessions", "4000", "--viewers", "9"},
         "these are 40,000 participants; 10,000 are the most"},
        {"Rate", {"--rate", "0"}, "--rate: Value 0 not in range"},
        {"Pattern", {"--pattern", "walk"}, "--pattern: walk not in"},
        {"RecordedWithoutPoses",
         {"--pattern", "recorded"},
         "--pattern recorded needs the poses: --poses FILE"},
        {"Delivery", {"--delivery", "some"}, "--delivery: some not in"},
        {"Encoding",
         {"--encoding", "morse"},
         "--encoding: there is no 'morse', only auto, float32, quantized16, "
         "predicted"},
        {"ViewersOfAll",
         {"--viewers", "1", "--viewer-fps", "10", "--delivery", "every"},
         "--viewer-fps leaves frames out: it needs --delivery latest"},
        {"LimitWithoutPercentile",
         {"--find-limit"},
         "--find-limit needs the limit, such as --p99 5ms"},
        {"Percentile", {"--p99", "5"}, "--p99: '5' is not a duration"},
        {"BindingAndPoints",
         {"--binding", "b", "--points", "500"},
         "--binding excludes --points"},
        {"CageAndHandles",
         {"--cage-faces", "80", "--handles", "9"},
         "--cage-faces excludes --handles"},
    }),
    [](const auto& test) { return test.param.name; });

TEST(Load, NeedsAServer) {
  EXPECT_EQ(
      RunCli({"--server", "127.0.0.1:1", "--connect-timeout", "0.05", "load"})
          .exit_code,
      kUnreachable);
}

// A report of 1000 poses, of which every hundredth took 50 ms, else 1 ms.
LoadReport Report() {
  LoadReport report;
  report.seconds = 2;
  report.poses_due = report.poses_sent = report.poses_answered = 1000;
  report.figures.intervals.resize(2);
  report.figures.intervals[1].begin = 1;
  for (int i = 0; i < 1000; ++i) {
    report.figures.intervals[i % 2].latency.Add(
        milliseconds(i % 100 == 7 ? 50 : 1));
    report.figures.lateness.Add(std::chrono::microseconds(100));
  }
  report.figures.frames = 500;
  report.figures.bytes = 6'000'000;
  return report;
}

TEST(LoadText, TellsRatesAndPercentiles) {
  const Json json = ToJson(LoadSubject{}, Report());
  EXPECT_EQ(json["frames_per_second"], 250);
  EXPECT_EQ(json["bytes_per_second"], 3'000'000);
  EXPECT_NEAR(json["latency_ms"]["p50"].get<double>(), 1, 0.01);
  EXPECT_EQ(json["latency_ms"]["max"], 50);
  EXPECT_EQ(json["ok"], true);
  std::ostringstream text;
  Describe(LoadSubject{}, Report(), text);
  EXPECT_THAT(text.str(),
              HasSubstr("250/s, 3.0 MB/s, 12.0 kB each, 0 revisions skipped"));
  EXPECT_THAT(text.str(), HasSubstr("p50 1.00, p90 1.00, p99 1.00"));
}

TEST(LoadText, SaysSoWhenTheClientWasLateItself) {
  LoadReport report = Report();
  EXPECT_TRUE(report.kept_schedule());
  for (int i = 0; i < 20; ++i) report.figures.lateness.Add(milliseconds(30));
  EXPECT_FALSE(report.kept_schedule());
  EXPECT_EQ(ToJson(LoadSubject{}, report)["client"]["kept_schedule"], false);
  std::ostringstream text;
  Describe(LoadSubject{}, report, text);
  EXPECT_THAT(text.str(), HasSubstr("THE CLIENT WAS LATE: it sent 2.0 % of"));
}

TEST(LoadText, FailsForWrongFramesThenMissingOnesThenSlowOnes) {
  LoadSubject subject{.tolerance = 1e-6, .p99_limit = milliseconds(20)};
  LoadReport report = Report();
  EXPECT_EQ(LoadFailure(subject, report), "");
  for (int i = 0; i < 10; ++i) {
    report.figures.intervals[0].latency.Add(milliseconds(40));
  }
  EXPECT_THAT(LoadFailure(subject, report), HasSubstr("more than 20.00 ms"));
  report.poses_answered = 997;
  EXPECT_THAT(LoadFailure(subject, report),
              HasSubstr("3 of 1,000 poses were not answered within 10.00 s"));
  report.checks.wrong = WrongFrame{.revision = 12, .vertex = 34, .error = 0.5};
  report.wrong_session = "s-1";
  EXPECT_EQ(LoadFailure(subject, report),
            "session s-1, revision 12: vertex 34 is off by 0.5 D, more than "
            "1e-06 D");
}

TEST(LoadText, TellsWhatTheServerTookOverTime) {
  LoadReport report = Report();
  report.server_cpus = 0.5;
  report.server_processors = 2;
  report.server_over_time = {
      {0, 20 << 20, 9}, {1, 24 << 20, 12}, {2, 21 << 20, 10}};
  const Json server = ToJson(LoadSubject{}, report)["server"];
  EXPECT_EQ(server["resident_bytes"]["most"], 24 << 20);
  EXPECT_EQ(server["open_files"],
            Json({{"begin", 9}, {"most", 12}, {"end", 10}}));
  EXPECT_EQ(server["over_time"][1]["open_files"], 12);
  std::ostringstream text;
  Describe(LoadSubject{}, report, text);
  EXPECT_THAT(text.str(), HasSubstr("9 files open, at most 12, in the end 10"));
}

TEST(LoadText, DrawsEvenARunWithoutAnswers) {
  const int answers = DrawLoad(Report()).height;
  EXPECT_GT(answers, 0);
  EXPECT_EQ(DrawLoad(LoadReport()).height, answers);
  LoadReport told = Report();
  told.server_over_time = {{0, 20 << 20, 9}};
  EXPECT_GT(DrawLoad(told).height, answers);
}

}  // namespace
}  // namespace deform::cli
