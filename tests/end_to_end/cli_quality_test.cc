// deformctl report and compare against a live server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "tests/end_to_end/cli_fixture.h"

namespace deform::cli {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

// Width and height of a PNG file, 0 if it is none.
std::pair<int, int> PngSize(const std::string& bytes) {
  if (bytes.size() < 24 || bytes.compare(1, 3, "PNG") != 0) return {0, 0};
  const auto number = [&](size_t at) {
    int value = 0;
    for (size_t k = 0; k < 4; ++k) {
      value = value * 256 + static_cast<unsigned char>(bytes[at + k]);
    }
    return value;
  };
  return {number(16), number(20)};
}

TEST_F(Cli, ReportTellsOfABindingAndOfAPose) {
  const std::string binding = Bind();
  const CliResult alone = Run({"report", "--binding", binding});
  EXPECT_EQ(alone.exit_code, kOk) << alone.err;
  EXPECT_THAT(alone.out, HasSubstr("sum to 1 within"));
  EXPECT_THAT(alone.out, Not(HasSubstr("distortion")));
  const Json posed =
      RunJson({"report", "--binding", binding, "--motion", "twist"});
  const Json& quality = posed["quality"];
  EXPECT_EQ(quality["pose"]["point_count"], 162);
  EXPECT_GT(quality["pose"]["distortion"]["max"], 1.1);
  EXPECT_EQ(quality["pose"]["volume"]["kind"], "closed");
  const CliResult human =
      Run({"report", "--binding", binding, "--pose", Path("moved.obj")});
  EXPECT_THAT(human.out, HasSubstr("median 1, p99 1, max 1 at point"));
  EXPECT_THAT(human.out, HasSubstr(" posed: 0.00 % (closed mesh)"));
}

TEST_F(Cli, ReportTellsOfASession) {
  const std::string session =
      server_.client().CreateSession(Bind()).value().session_id;
  {
    auto stream = server_.client().Deform(session, Delivery::kEvery).value();
    Positions wide = Cube().vertices();
    wide.col(0) *= 3;
    ASSERT_TRUE(stream.Send({.positions = wide}).ok());
    stream.Close();
    Frame frame;
    while (stream.NextFrame(frame).ok()) {
    }
  }
  for (const bool drawn : {false, true}) {
    std::vector<std::string> arguments = {"report", "--session", session};
    if (drawn) {
      arguments.insert(arguments.end(), {"--model-file", Path("ball.obj"),
                                         "--png", Path("session.png"),
                                         "--width", "64", "--height", "64"});
    }
    EXPECT_GT(RunJson(arguments)["quality"]["pose"]["distortion"]["max"], 1.1);
  }
  EXPECT_EQ(PngSize(Read("session.png")), std::pair(64, 64 + 84 + 200));
  EXPECT_TRUE(server_.client().GetSession(session).ok());
  EXPECT_EQ(Run({"report", "--session", "s-none"}).exit_code, kRefused);
}

TEST_F(Cli, ReportDrawsWhatItIsAskedFor) {
  for (const char* color :
       {"distortion", "volume", "displacement", "influence"}) {
    const CliResult result =
        Run({"report", "--model-file", Path("ball.obj"), "--cage",
             Path("cube.obj"), "--motion", "bend", "--png", Path("ball.png"),
             "--color", color, "--width", "100", "--height", "80"});
    EXPECT_EQ(result.exit_code, kOk) << result.err;
    EXPECT_THAT(result.out, HasSubstr("wrote "));
    EXPECT_EQ(PngSize(Read("ball.png")), std::pair(100, 80 + 84 + 200))
        << color;
  }
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Cli, ReportSaysWhichWeightsThereAre) {
  const std::vector<std::string> drawn = {
      "report", "--model-file", Path("ball.obj"), "--cage",   Path("cube.obj"),
      "--png",  Path("x.png"),  "--color",        "influence"};
  const auto with = [&](const char* option, const char* value) {
    std::vector<std::string> arguments = drawn;
    arguments.insert(arguments.end(), {option, value});
    return Run(arguments);
  };
  EXPECT_EQ(with("--face", "11").exit_code, kOk);
  EXPECT_THAT(with("--handle", "8").err,
              HasSubstr("--handle 8: the rig has 8 vertices"));
  EXPECT_THAT(with("--face", "12").err,
              HasSubstr("--face 12: scheme green has weights of 12 normals"));
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Cli, CompareShowsEverySchemeOfBothRigs) {
  const std::vector<std::string> arguments = {"compare",
                                              "--model-file",
                                              Path("ball.obj"),
                                              "--cage",
                                              Path("cube.obj"),
                                              "--handles",
                                              Path("cube.obj"),
                                              "--motion",
                                              "twist",
                                              "--png",
                                              Path("all.png"),
                                              "--width",
                                              "64",
                                              "--height",
                                              "64"};
  const Json json = RunJson(arguments);
  ASSERT_THAT(json["schemes"], SizeIs(4));
  const char* const names[] = {"green", "mean_value", "t_cc", "s_cc"};
  for (int k = 0; k < 4; ++k) {
    const Json& scheme = json["schemes"][k];
    EXPECT_EQ(scheme["scheme"], names[k]);
    EXPECT_GT(scheme["compute_seconds"], 0);
    EXPECT_EQ(scheme["quality"]["pose"]["point_count"], 162);
  }
  // Rest and four schemes.
  EXPECT_EQ(PngSize(Read("all.png")).first, 5 * 64);
  EXPECT_TRUE(ServerIsEmpty());
  const CliResult human = Run(arguments);
  EXPECT_THAT(human.out, HasSubstr("mean_value"));
  EXPECT_THAT(human.out, HasSubstr("fold-overs"));
}

TEST_F(Cli, CompareTakesPosesAndNamedSchemes) {
  const Json json = RunJson({"compare", "--model-file", Path("ball.obj"),
                             "--cage", Path("cube.obj"), "--cage-pose",
                             Path("moved.obj"), "--schemes", "mean_value"});
  ASSERT_THAT(json["schemes"], SizeIs(1));
  EXPECT_NEAR(json["schemes"][0]["quality"]["pose"]["distortion"]["max"], 1,
              1e-9);
}

TEST_F(Cli, CompareSaysWhatASchemeNeeds) {
  const auto run = [&](const char* schemes) {
    return Run({"compare", "--model-file", Path("ball.obj"), "--cage",
                Path("cube.obj"), "--motion", "bend", "--schemes", schemes});
  };
  EXPECT_THAT(run("green,s_cc").err, HasSubstr("scheme s_cc needs --handles"));
  EXPECT_THAT(run("blue").err, HasSubstr("there is no 'blue'; the server knows "
                                         "green"));
  EXPECT_TRUE(ServerIsEmpty());
}

}  // namespace
}  // namespace deform::cli
