#include "client/cli/app.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "core/files/mesh_file.h"
#include "core/mesh/cage.h"
#include "tests/client/cli/cli_run.h"
#include "tests/support/temporary_folder.h"

namespace deform::cli {
namespace {

using testing::AnyOf;
using testing::Each;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

// No server listens here.
constexpr char kNowhere[] = "unix:/nonexistent/deformd.sock";

std::string CubeObj() {
  return Temporary().Write("cube.obj",
                           "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n"
                           "v 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
                           "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\n"
                           "f 1 5 7 3\nf 2 4 8 6\n");
}

TEST(Help, ListsTheCommandsAndExitCodes) {
  const CliResult result = RunCli({"--help"});
  EXPECT_EQ(result.exit_code, kOk);
  EXPECT_EQ(result.err, "");
  EXPECT_THAT(result.out, HasSubstr("Usage: deformctl [OPTIONS] SUBCOMMAND"));
  EXPECT_THAT(result.out, HasSubstr("Exit codes: 0 done;"));
  for (const Command* command : AllCommands()) {
    EXPECT_THAT(result.out, HasSubstr(command->summary)) << command->name;
  }
}

TEST(Help, OfEveryCommandShowsExamples) {
  for (const Command* command : AllCommands()) {
    const CliResult result = RunCli({command->name, "--help"});
    EXPECT_EQ(result.exit_code, kOk) << command->name;
    EXPECT_THAT(result.out,
                HasSubstr(std::string("Usage: deformctl ") + command->name));
    EXPECT_THAT(result.out, HasSubstr("Examples:\n  ")) << command->name;
  }
}

TEST(Help, TellsHowFacesAreCounted) {
  EXPECT_THAT(RunCli({"bind", "--help"}).out,
              HasSubstr("Faces are counted from 0, as triangles"));
}

struct BadUsage {
  const char* name;
  std::vector<std::string> arguments;
  const char* message;
};
void PrintTo(const BadUsage& test, std::ostream* out) { *out << test.name; }

class CliRefuses : public testing::TestWithParam<BadUsage> {};

TEST_P(CliRefuses, BadArguments) {
  const CliResult result = RunCli(GetParam().arguments);
  EXPECT_EQ(result.exit_code, kUsage);
  EXPECT_EQ(result.out, "");
  EXPECT_THAT(result.err, StartsWith("deformctl: "));
  EXPECT_THAT(result.err, HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Arguments, CliRefuses,
    testing::ValuesIn<BadUsage>({
        {"Nothing", {}, "see 'deformctl --help'"},
        {"UnknownCommand",
         {"dance", "--json=no", "m"},
         "there is no command 'dance', only register, bind, "},
        {"UnknownOption",
         {"list", "models", "--colour"},
         "--colour; see 'deformctl list --help'"},
        {"RegisterWithoutFile", {"register"}, "file is required"},
        {"RegisterDimension",
         {"register", "a.obj", "--dimension", "4"},
         "4 not in {2,3}"},
        {"BindWithoutModel", {"bind"}, "model is required"},
        {"BindTwoRigs",
         {"bind", "m", "--cage", "a", "--handles", "b"},
         "--cage excludes --handles"},
        {"BindTwoExits",
         {"bind", "m", "--cage", "a", "--exit", "auto", "--exit-per-point",
          "b"},
         "excludes"},
        {"BindUnbindable",
         {"bind", "m", "--cage", "a", "--unbindable", "ignore"},
         "ignore not in {fail,report}"},
        {"DeformWithoutPose",
         {"deform", "--out", "x"},
         "give the posed rig, --pose FILE, or a built-in --motion"},
        {"DeformWithoutResult",
         {"deform", "--pose", "x", "--binding", "b"},
         "--out FILE or --png FILE"},
        {"DeformPngWithoutModel",
         {"deform", "--pose", "x", "--binding", "b", "--png", "y"},
         "--png needs --model-file"},
        {"DeformWithoutModel",
         {"deform", "--pose", "x", "--out", "y", "--cage", "c"},
         "say what is to be deformed"},
        {"DeformBlend",
         {"deform", "--pose", "x", "--out", "y", "--blend", "1.5"},
         "1.5 not in range"},
        {"DeformBindingAndCage",
         {"deform", "--pose", "x", "--out", "y", "--binding", "b", "--cage",
          "c"},
         "excludes"},
        {"FewOfAll",
         {"play", "--motion", "bend", "--max-fps", "10"},
         "--max-fps leaves frames out: it needs --delivery latest"},
        {"PlayNothing", {"play", "--binding", "b"}, "give pose files"},
        {"PlayBoth",
         {"play", "a.obj", "--motion", "twist", "--binding", "b"},
         "give pose files"},
        {"PlayMotion",
         {"play", "--motion", "jump"},
         "jump not in {twist,bend,stretch,pulse,beat,wave}"},
        {"PlayInFlight",
         {"play", "--motion", "bend", "--in-flight", "0"},
         "--in-flight: Value 0 not in range"},
        {"PlayDelivery",
         {"play", "--motion", "bend", "--delivery", "some"},
         "some not in {every,latest}"},
        {"ListNothing", {"list"}, "what is required"},
        {"ListOther", {"list", "cats"}, "cats not in {models,bindings"},
        {"ShowNothing", {"show"}, "id is required"},
        {"DeleteNothing", {"delete"}, "id is required"},
        {"DownloadNothing", {"download", "--out", "m"}, "model is required"},
        {"DownloadNowhere", {"download", "m"}, "--out is required"},
        {"WeightsNothing", {"weights"}, "binding is required"},
        {"WeightsFormat",
         {"weights", "b", "--format", "xml"},
         "xml not in {csv,binary}"},
        {"WeightsBinaryToTerminal",
         {"weights", "b", "--format", "binary"},
         "--format binary needs --out"},
        {"WeightsFirst", {"weights", "b", "--first", "-1"}, "--first"},
        {"ReportNothing", {"report"}, "say what is to be deformed"},
        {"ReportPngWithoutModel",
         {"report", "--binding", "b", "--motion", "bend", "--png", "p"},
         "--png needs --model-file"},
        {"ReportPngWithoutPose",
         {"report", "--binding", "b", "--model-file", "m", "--png", "p"},
         "--color distortion needs a pose: --pose, --motion or --session"},
        {"ReportTwoPoses",
         {"report", "--binding", "b", "--pose", "p", "--session", "s"},
         "excludes"},
        {"ReportColor",
         {"report", "--binding", "b", "--color", "mood"},
         "mood not in {distortion,volume,displacement,influence}"},
        {"ReportMaxPoints",
         {"report", "--binding", "b", "--max-points", "1000001"},
         "1000001 not in range"},
        {"ReportHandleAndFace",
         {"report", "--binding", "b", "--handle", "1", "--face", "1"},
         "excludes"},
        {"CompareNothing",
         {"compare", "--model-file", "m", "--motion", "bend"},
         "--cage FILE, --handles FILE, or both"},
        {"CompareWithoutPose",
         {"compare", "--model-file", "m", "--cage", "c"},
         "give the posed rigs, --cage-pose and --handles-pose"},
        {"CompareOnePoseOfTwo",
         {"compare", "--model-file", "m", "--cage", "c", "--handles", "h",
          "--cage-pose", "p"},
         "each rig needs its pose"},
        {"CompareMotionAndPose",
         {"compare", "--model-file", "m", "--cage", "c", "--cage-pose", "p",
          "--motion", "bend"},
         "excludes"},
        {"CompareWithoutModel", {"compare"}, "--model-file is required"},
        {"GenerateNothing", {"generate"}, "shape is required"},
        {"GenerateUnknown",
         {"generate", "cube", "--out", "x"},
         "cube not in {organ,bar,torus,plate,angle}"},
        {"GeneratePoints",
         {"generate", "bar", "--out", "x", "--points", "99"},
         "99 not in range"},
        {"GenerateCageOfOrgan",
         {"generate", "organ", "--out", "x", "--cage", "c"},
         "organ comes without a cage"},
        {"CageWithoutOut", {"cage", "a.obj"}, "--out is required"},
        {"CageFaces",
         {"cage", "a.obj", "--out", "b", "--faces", "7"},
         "7 not in range"},
        {"CageMargin",
         {"cage", "a.obj", "--out", "b", "--margin", "2"},
         "2 not in range"},
        {"PictureWithoutOut", {"picture", "a.obj"}, "--out is required"},
        {"PictureSize",
         {"picture", "a.obj", "--out", "b", "--width", "5000"},
         "5000 not in range"},
        {"PicturePosedCage",
         {"picture", "a.obj", "--out", "b", "--posed-cage", "c"},
         "--posed-cage requires"},
        {"VerifyNothing", {"verify"}, "directory is required"},
        {"VerifyJobs", {"verify", "d", "--jobs", "0"}, "0 not in range"},
        {"CompletionShell", {"completion", "tcsh"}, "tcsh not in {bash,zsh"},
        {"VersionArgument", {"version", "x"}, "x"},
        {"Timeout",
         {"--connect-timeout", "-1", "version"},
         "--connect-timeout: Value -1 not in range"},
    }),
    [](const auto& test) { return test.param.name; });

TEST(Refusals, AreJsonWhereJsonIsAskedFor) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{
           {"list", "cats", "--json"}, {"--json", "dance"}, {"--json"}}) {
    const CliResult result = RunCli(arguments);
    EXPECT_EQ(result.exit_code, kUsage);
    EXPECT_EQ(result.err, "");
    EXPECT_EQ(result.json()["error"]["reason"], "USAGE");
  }
}

TEST(Server, ThatDoesNotAnswerHasAnExitCodeOfItsOwn) {
  for (const std::vector<std::string>& command :
       std::vector<std::vector<std::string>>{{"list", "models"},
                                             {"list", "schemes"},
                                             {"show", "x"},
                                             {"delete", "x"},
                                             {"download", "x", "--out", "m"},
                                             {"bind", "m", "--cage", "c.obj"},
                                             {"weights", "b"},
                                             {"register", CubeObj()},
                                             {"verify", "d"}}) {
    std::vector<std::string> arguments = {"--server", kNowhere,
                                          "--connect-timeout", "0.01"};
    arguments.insert(arguments.end(), command.begin(), command.end());
    const CliResult result = RunCli(arguments);
    EXPECT_EQ(result.exit_code, kUnreachable) << command[0];
    EXPECT_THAT(result.err, HasSubstr("no server answers at unix:"));
    EXPECT_THAT(result.err, HasSubstr("start one with 'deformd'"));
  }
}

TEST(Server, IsTakenFromTheEnvironment) {
  setenv("DEFORM_SERVER", "unix:/nonexistent/elsewhere", 1);
  const CliResult result =
      RunCli({"list", "models", "--connect-timeout", "0.01"});
  unsetenv("DEFORM_SERVER");
  EXPECT_THAT(result.err, HasSubstr("unix:/nonexistent/elsewhere"));
}

TEST(Files, AreReadBeforeTheServerIsAsked) {
  const std::string broken = Temporary().Write("broken.obj", "v 1 2\n");
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{
           {"register", broken},
           {"picture", broken, "--out", Temporary().Path("x.png")},
           {"deform", "--model-file", broken, "--cage", "c.obj", "--pose",
            "p.obj", "--out", "o.obj"}}) {
    const CliResult result = RunCli(arguments);
    EXPECT_EQ(result.exit_code, kBadFile) << arguments[0];
    EXPECT_THAT(result.err, HasSubstr("broken.obj: line 1"));
  }
  const CliResult missing = RunCli({"register", "/nonexistent.obj"});
  EXPECT_EQ(missing.exit_code, kBadFile);
  EXPECT_THAT(missing.err, HasSubstr("/nonexistent.obj"));
}

TEST(Cage, IsMadeWithoutAServer) {
  const std::string path = Temporary().Path("cube_cage.obj");
  const CliResult result =
      RunCli({"cage", CubeObj(), "--faces", "60", "--out", path, "--json"});
  ASSERT_EQ(result.exit_code, kOk) << result.out;
  const MeshFile cage = ReadMeshFile(path).value();
  EXPECT_EQ(cage.faces.rows(), result.json()["face_count"]);
  EXPECT_TRUE(Cage::Create(3, cage.positions, cage.faces).ok());
}

TEST(Cage, OfAFlatFileAreLoops) {
  const std::string path = Temporary().Path("square_cage.obj");
  const std::string square = Temporary().Write(
      "square.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
  const CliResult result =
      RunCli({"cage", square, "--margin", "0.1", "--out", path});
  ASSERT_EQ(result.exit_code, kOk) << result.err;
  EXPECT_THAT(result.out, HasSubstr(" edges\n"));
  const MeshFile cage = ReadMeshFile(path).value();
  EXPECT_EQ(cage.dimension, 2);
  EXPECT_TRUE(Cage::Create(2, cage.positions, cage.edges).ok());
  EXPECT_EQ(RunCli({"cage", square, "--margin", "0.1", "--dimension", "3",
                    "--out", path})
                .exit_code,
            kOk);
  EXPECT_EQ(ReadMeshFile(path)->dimension, 3);
}

TEST(Cage, SaysWhyThereIsNone) {
  const std::string out = Temporary().Path("x.obj");
  const CliResult point = RunCli(
      {"cage", Temporary().Write("point.obj", "v 1 2 3\n"), "--out", out});
  EXPECT_EQ(point.exit_code, kBadFile);
  EXPECT_THAT(point.err, HasSubstr("(MODEL_WITHOUT_EXTENT)"));
  EXPECT_THAT(point.err, HasSubstr("point.obj: "));
}

TEST(Generate, WritesModelAndRigsWithoutAServer) {
  const std::string folder = Temporary().Path("");
  const CliResult result =
      RunCli({"generate", "bar", "--points", "300", "--out", folder + "bar.obj",
              "--cage", folder + "bar_cage.obj", "--handles",
              folder + "bar_handles.obj", "--json"});
  EXPECT_EQ(result.exit_code, kOk) << result.out;
  const MeshFile model = ReadMeshFile(folder + "bar.obj").value();
  EXPECT_EQ(result.json()["point_count"], model.positions.rows());
  const MeshFile cage = ReadMeshFile(folder + "bar_cage.obj").value();
  EXPECT_EQ(cage.positions.rows(), 20);
  EXPECT_TRUE(Cage::Create(3, cage.positions, cage.faces).ok());
  EXPECT_EQ(ReadMeshFile(folder + "bar_handles.obj")->positions,
            cage.positions);
}

TEST(Generate, WritesLoopsIn2D) {
  const std::string folder = Temporary().Path("");
  EXPECT_EQ(RunCli({"generate", "angle", "--out", folder + "angle.obj",
                    "--cage", folder + "angle_cage.obj"})
                .exit_code,
            kOk);
  const MeshFile cage = ReadMeshFile(folder + "angle_cage.obj").value();
  EXPECT_EQ(cage.dimension, 2);
  EXPECT_EQ(cage.edges.rows(), 12);
}

TEST(Picture, IsDrawnWithoutAServer) {
  const std::string path = Temporary().Path("cube.png");
  const CliResult result =
      RunCli({"picture", CubeObj(), "--cage", CubeObj(), "--posed", CubeObj(),
              "--posed-cage", CubeObj(), "--caption", "rest", "--width", "100",
              "--height", "80", "--out", path, "--json"});
  EXPECT_EQ(result.exit_code, kOk) << result.out;
  EXPECT_EQ(result.json()["out"], path);
  std::ifstream file(path, std::ios::binary);
  std::string head(24, 0);
  file.read(head.data(), 24);
  EXPECT_THAT(head, StartsWith("\x89PNG"));
  EXPECT_EQ(head[19], static_cast<char>(200)) << "two panels of 100";
  EXPECT_EQ(head[23], 80);
}

TEST(Picture, SaysWhatDoesNotFit) {
  const std::string two = Temporary().Write("two.obj", "v 0 0 0\nv 1 1 1\n");
  const std::string out = Temporary().Path("x.png");
  const CliResult posed =
      RunCli({"picture", CubeObj(), "--posed", two, "--out", out});
  EXPECT_EQ(posed.exit_code, kBadFile);
  EXPECT_THAT(posed.err, HasSubstr("two.obj: has 2 vertices, not 8"));
  const CliResult view =
      RunCli({"picture", CubeObj(), "--view", "askew", "--out", out});
  EXPECT_EQ(view.exit_code, kUsage);
  EXPECT_THAT(view.err, HasSubstr("'askew' is no view"));
  const CliResult unwritable =
      RunCli({"picture", CubeObj(), "--out", "/nonexistent/x.png"});
  EXPECT_EQ(unwritable.exit_code, kBadFile);
}

TEST(Version, IsTold) {
  EXPECT_THAT(RunCli({"version"}).out, StartsWith("deformctl "));
  EXPECT_EQ(RunCli({"version", "--json"}).json()["protocol"], "deform.v1");
}

class CompletionTest : public testing::TestWithParam<std::string> {};

TEST_P(CompletionTest, KnowsEveryCommandAndItsOptions) {
  const std::string script = RunCli({"completion", GetParam()}).out;
  for (const Command* command : AllCommands()) {
    EXPECT_THAT(script, HasSubstr(command->name));
  }
  EXPECT_THAT(script, HasSubstr("flip-cage"));
  EXPECT_THAT(script, HasSubstr("models bindings sessions schemes"));
}

INSTANTIATE_TEST_SUITE_P(Shells, CompletionTest,
                         testing::Values("bash", "zsh", "fish"));

TEST(Completion, WorksInBash) {
  const std::string path =
      Temporary().Write("completion.bash", RunCli({"completion", "bash"}).out);
  const auto complete = [&](const std::string& words, int word) {
    const std::string command = "bash -c 'source " + path + "; COMP_WORDS=(" +
                                words +
                                "); COMP_CWORD=" + std::to_string(word) +
                                "; _deformctl; echo ${COMPREPLY[@]}'";
    FILE* const pipe = popen(command.c_str(), "r");
    std::string answer(4096, 0);
    answer.resize(fread(answer.data(), 1, answer.size(), pipe));
    pclose(pipe);
    return answer;
  };
  EXPECT_EQ(complete("deformctl re", 1), "register report\n");
  EXPECT_EQ(complete("deformctl --json list mo", 3), "models\n");
  EXPECT_EQ(complete("deformctl bind m --flip", 3), "--flip-cage\n");
  EXPECT_EQ(complete("deformctl bind m --serv", 3), "--server\n");
}

}  // namespace
}  // namespace deform::cli
