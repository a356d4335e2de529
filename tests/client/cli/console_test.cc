#include "client/cli/console.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "client/cli/exit_code.h"
#include "client/cli/progress.h"
#include "core/base/error.h"

namespace deform::cli {
namespace {

using testing::HasSubstr;

TEST(Table, LinesColumnsUpAndNumbersToTheRight) {
  Table table({{"NAME"}, {"COUNT", Table::Align::kRight}, {"LAST"}});
  table.Add({"a", "1,000", "x"});
  table.Add({"longer", "5", ""});
  std::ostringstream out;
  table.Print(out);
  EXPECT_EQ(out.str(),
            "NAME    COUNT  LAST\n"
            "a       1,000  x\n"
            "longer      5\n");
}

TEST(Numbers, AreWrittenForPeople) {
  EXPECT_EQ(Thousands(0), "0");
  EXPECT_EQ(Thousands(999), "999");
  EXPECT_EQ(Thousands(1000), "1,000");
  EXPECT_EQ(Thousands(-1234567), "-1,234,567");
  EXPECT_EQ(Thousands(-123), "-123");
  EXPECT_EQ(Bytes(999), "999 B");
  EXPECT_EQ(Bytes(1000), "1.0 kB");
  EXPECT_EQ(Bytes(999999), "1.0 MB");
  EXPECT_EQ(Bytes(225000000), "225.0 MB");
  EXPECT_EQ(Seconds(0.00002), "20 us");
  EXPECT_EQ(Seconds(0.0123), "12.3 ms");
  EXPECT_EQ(Seconds(75), "75.00 s");
}

class ErrorTest : public testing::Test {
 protected:
  std::string Tell(const absl::Status& status, bool json) {
    std::ostringstream out;
    std::ostringstream err;
    Console(out, err, json, false).Error(status);
    return json ? out.str() : err.str();
  }
  const absl::Status refused_ = MakeError(
      absl::StatusCode::kFailedPrecondition, "3 points lie outside the cage",
      {.reason = "EXTERIOR_NO_EXIT_FACE", .field = "exits"});
};

TEST_F(ErrorTest, TellsPeopleTheMessageTheReasonAndWhatToDo) {
  EXPECT_EQ(Tell(refused_, false),
            "deformctl: 3 points lie outside the cage (EXTERIOR_NO_EXIT_FACE)\n"
            "  next: use --exit auto to reach these points through the cage's "
            "faces, or --unbindable report to leave them where they are\n");
}

TEST_F(ErrorTest, TellsProgramsTheSame) {
  const Json error = Json::parse(Tell(refused_, true))["error"];
  EXPECT_EQ(error["code"], "FAILED_PRECONDITION");
  EXPECT_EQ(error["message"], "3 points lie outside the cage");
  EXPECT_EQ(error["reason"], "EXTERIOR_NO_EXIT_FACE");
  EXPECT_EQ(error["field"], "exits");
  EXPECT_EQ(error["exit_code"], 4);
  EXPECT_THAT(error["hint"].get<std::string>(), HasSubstr("--exit auto"));
}

TEST_F(ErrorTest, SaysNoMoreThanItKnows) {
  EXPECT_EQ(Tell(absl::InternalError("odd"), false), "deformctl: odd\n");
  EXPECT_FALSE(
      Json::parse(Tell(absl::InternalError("odd"), true))["error"].contains(
          "hint"));
}

TEST_F(ErrorTest, SurvivesMessagesThatAreNotText) {
  EXPECT_TRUE(Json::accept(Tell(absl::InternalError("\xff\x80"), true)));
}

TEST(ExitCode, TellsWhoseFaultItWas) {
  EXPECT_EQ(ExitCodeOf(absl::OkStatus()), kOk);
  EXPECT_EQ(ExitCodeOf(absl::InvalidArgumentError("x")), kRefused);
  EXPECT_EQ(ExitCodeOf(MakeError(absl::StatusCode::kUnavailable, "x",
                                 {.reason = "SERVER_UNREACHABLE"})),
            kUnreachable);
  EXPECT_EQ(ExitCodeOf(MakeError(absl::StatusCode::kUnavailable, "x",
                                 {.reason = "DRAINING"})),
            kRefused);
  EXPECT_EQ(ExitCodeOf(absl::CancelledError("x")), kInterrupted);
  EXPECT_EQ(ExitCodeOf(UsageError("x")), kUsage);
  const absl::Status file =
      WithExit(kBadFile, InvalidInput("BAD_MESH_FILE", "", "line 3: x"));
  EXPECT_EQ(ExitCodeOf(file), kBadFile);
  EXPECT_EQ(DetailOf(file).reason, "BAD_MESH_FILE") << "the detail is kept";
  EXPECT_EQ(ExitCodeOf(Annotate(file, "a: ")), kBadFile);
}

class ProgressTest : public testing::Test {
 protected:
  // What is shown of 10 steps, one each `step`.
  std::string Run(bool terminal, std::chrono::milliseconds step) {
    std::ostringstream out;
    std::ostringstream err;
    Console console(out, err, false, terminal);
    std::chrono::steady_clock::time_point now;
    {
      Progress progress(console, "binding", nullptr, [&] { return now; });
      for (int i = 1; i <= 10; ++i) {
        now += step;
        progress.Show(i, 10);
      }
    }
    EXPECT_EQ(out.str(), "");
    return err.str();
  }
};

TEST_F(ProgressTest, SaysNothingAboutShortWork) {
  EXPECT_EQ(Run(true, std::chrono::milliseconds(40)), "");
  EXPECT_EQ(Run(false, std::chrono::milliseconds(400)), "");
}

TEST_F(ProgressTest, DrawsABarOnATerminalAndClearsIt) {
  const std::string shown = Run(true, std::chrono::milliseconds(1000));
  EXPECT_THAT(shown, HasSubstr("binding [###############...............]  50 %"
                               "  5 s left"));
  EXPECT_THAT(shown, testing::EndsWith("\r\x1b[K"));
}

TEST_F(ProgressTest, WritesSparseLinesElsewhere) {
  EXPECT_EQ(Run(false, std::chrono::milliseconds(2000)),
            "binding: 30 % after 6 s\nbinding: 60 % after 12 s\n"
            "binding: 90 % after 18 s\n");
}

}  // namespace
}  // namespace deform::cli
