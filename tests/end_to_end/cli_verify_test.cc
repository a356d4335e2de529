// deformctl verify against a live server, which it passes or fails.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "tests/client/verify/hand_made.h"
#include "tests/end_to_end/cli_fixture.h"

namespace deform::cli {
namespace {

using testing::HasSubstr;

TEST_F(Cli, VerifyPassesAServerThatIsRight) {
  Write("triangle.json", TriangleCase().dump());
  Write("index.json", R"([{"file": "triangle.json"}])");
  const CliResult result = Run({"verify", folder_.Path("")});
  EXPECT_EQ(result.exit_code, kOk) << result.out << result.err;
  EXPECT_THAT(result.out, HasSubstr("scc.hand"));
  EXPECT_THAT(result.out, HasSubstr("OK: 1 cases, 2 queries, 0 failures"));
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Cli, VerifyFailsAWrongWeightAndNamesTheQuery) {
  nlohmann::json wrong = TriangleCase();
  wrong["queries"][0]["expected"]["alpha"][1] = "0.333333333";
  Write("triangle.json", wrong.dump());
  const CliResult result = Run({"verify", folder_.Path("")});
  EXPECT_EQ(result.exit_code, kCheckFailed);
  EXPECT_THAT(result.out,
              HasSubstr("FAIL triangle query 0: vertex weight 1 is off by"));
  EXPECT_THAT(result.out, HasSubstr("FAILED: 1 cases"));
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Cli, VerifyFailsAWrongPosition) {
  nlohmann::json wrong = TriangleCase();
  wrong["queries"][0]["expected"]["deformed"]["moved"][0] = "2.001";
  Write("triangle.json", wrong.dump());
  const CliResult result = Run({"verify", folder_.Path(""), "--json"});
  EXPECT_EQ(result.exit_code, kCheckFailed);
  EXPECT_EQ(result.err, "");
  const Json report = result.json();
  EXPECT_EQ(report["ok"], false);
  EXPECT_EQ(report["groups"][0]["failures"], 1);
  EXPECT_EQ(report["failures"][0]["query"], 0);
  EXPECT_THAT(report["failures"][0]["message"].get<std::string>(),
              HasSubstr("position in moved is off by"));
}

TEST_F(Cli, VerifyFailsAnErrorThatDidNotCome) {
  nlohmann::json wrong = TriangleCase();
  wrong["queries"][1]["point"] = {"0.5", "0.5"};
  Write("triangle.json", wrong.dump());
  EXPECT_THAT(Run({"verify", folder_.Path("")}).out,
              HasSubstr("query 1: expected error outside_hull, got a result"));
}

TEST_F(Cli, VerifyFailsWhatItCannotRead) {
  Write("a.json", TriangleCase().dump());
  Write("b.json", "{");
  nlohmann::json unreadable = TriangleCase();
  unreadable["queries"][0].erase("point");
  Write("c.json", unreadable.dump());
  const CliResult result = Run({"verify", folder_.Path("")});
  EXPECT_EQ(result.exit_code, kCheckFailed);
  EXPECT_THAT(result.out, HasSubstr("b.json: is not JSON"));
  EXPECT_THAT(result.out,
              HasSubstr("c.json: queries[0]: has no field 'point'"));
}

TEST_F(Cli, VerifyFailsAnEmptyDirectory) {
  const CliResult empty = Run({"verify", folder_.Path("")});
  EXPECT_EQ(empty.exit_code, kCheckFailed);
  EXPECT_THAT(empty.err, HasSubstr("holds no case"));
  Write("triangle.json", TriangleCase().dump());
  const CliResult group = Run({"verify", folder_.Path(""), "--group", "gc3d"});
  EXPECT_EQ(group.exit_code, kCheckFailed);
  EXPECT_THAT(group.err, HasSubstr("in a group that begins with gc3d"));
  EXPECT_EQ(Run({"verify", Path("missing")}).exit_code, kCheckFailed);
}

TEST_F(Cli, VerifySendsWhatIsInvalidAndWantsItRefused) {
  nlohmann::json invalid = TriangleCase();
  invalid["control_points"][1][0] = "nan";
  invalid["deformations"] = nlohmann::json::array();
  for (auto& query : invalid["queries"]) {
    query["expected"] = {{"error", "non_finite"}};
  }
  Write("invalid.json", invalid.dump());
  nlohmann::json point = TriangleCase();
  point["queries"][1]["point"] = {"inf", "0"};
  Write("point.json", point.dump());
  const CliResult result = Run({"verify", folder_.Path("")});
  EXPECT_EQ(result.exit_code, kOk) << result.out;
  EXPECT_THAT(result.out, HasSubstr("2 cases, 4 queries, 0 failures"));
}

TEST_F(Cli, VerifyDeletesNothingOfOthers) {
  Write("triangle.json", TriangleCase().dump());
  Positions points(2, 3);
  points << 1, 1, 0, 7, 7, 0;  // The model of the case.
  const std::string id =
      server_.client().RegisterModel({2, points, Faces()}, "mine")->model_id;
  EXPECT_EQ(Run({"verify", folder_.Path("")}).exit_code, kOk);
  EXPECT_TRUE(server_.client().GetModel(id).ok());
}

TEST_F(Cli, AnInterruptedVerifyLeavesNothingBehind) {
  Write("triangle.json", TriangleCase().dump());
  std::ostringstream out;
  std::ostringstream err;
  Interruption interruption;
  interruption.requested = true;
  EXPECT_EQ(
      RunDeformctl({"--server", server_.address(), "verify", folder_.Path("")},
                   {out, err, false, interruption}),
      kInterrupted);
  EXPECT_TRUE(ServerIsEmpty());
}

}  // namespace
}  // namespace deform::cli
