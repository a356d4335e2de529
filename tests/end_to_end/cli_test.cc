// deformctl against a live server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/cli/exit_code.h"
#include "core/files/mesh_file.h"
#include "tests/client/cli/cli_run.h"
#include "tests/client/verify/hand_made.h"
#include "tests/end_to_end/running_server.h"
#include "tests/support/temporary_folder.h"

namespace deform::cli {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

class Cli : public testing::Test {
 protected:
  Cli() {
    Write("ball.obj", ObjText(Ball().positions(), Ball().faces()));
    Write("cube.obj", ObjText(Cube().vertices(), Cube().faces()));
    Positions posed = Cube().vertices();
    posed.col(0) = posed.col(0).array() * 1 + 5;
    Write("moved.obj", ObjText(posed, Cube().faces()));
  }

  std::string Path(const std::string& name) { return folder_.Path(name); }
  std::string Write(const std::string& name, const std::string& text) {
    return folder_.Write(name, text);
  }
  std::string Read(const std::string& name) {
    std::ifstream stream(Path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  CliResult Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--server", server_.address()});
    return RunCli(arguments);
  }
  Json RunJson(std::vector<std::string> arguments) {
    arguments.push_back("--json");
    const CliResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, kOk) << result.out << result.err;
    return result.json();
  }

  std::string Register() {
    return RunJson({"register", Path("ball.obj")})["model_id"];
  }
  std::string Bind() {
    return RunJson(
        {"bind", Register(), "--cage", Path("cube.obj")})["binding_id"];
  }
  bool ServerIsEmpty() {
    return server_.client().ListModels()->empty() &&
           server_.client().ListBindings()->empty() &&
           server_.client().ListSessions()->empty();
  }

  RunningServer server_;
  const TemporaryFolder folder_;
};

TEST_F(Cli, RegisterPrintsTheIdAlone) {
  const CliResult result = Run({"register", Path("ball.obj")});
  EXPECT_EQ(result.exit_code, kOk);
  const std::string id = server_.client().ListModels()->front().model_id;
  EXPECT_EQ(result.out, id + "\n");
  EXPECT_EQ(result.err, "162 vertices, 320 triangles\n");
  EXPECT_THAT(Run({"register", Path("ball.obj")}).err,
              HasSubstr("was there before"));
}

TEST_F(Cli, BindTellsHowItWent) {
  const CliResult result =
      Run({"bind", Register(), "--cage", Path("cube.obj")});
  EXPECT_EQ(result.exit_code, kOk) << result.err;
  EXPECT_THAT(result.out, HasSubstr("scheme         green\n"));
  EXPECT_THAT(result.out, HasSubstr("points         162 in 3D\n"));
  EXPECT_THAT(result.out, HasSubstr("rig            8 vertices, 12 normals"));
}

TEST_F(Cli, BindSaysWhatToDoAboutPointsOutside) {
  Write("small.obj", ObjText(Cube().vertices() * 0.3, Cube().faces()));
  const std::string model = Register();
  const CliResult refused = Run({"bind", model, "--cage", Path("small.obj")});
  EXPECT_EQ(refused.exit_code, kRefused);
  EXPECT_THAT(refused.err, HasSubstr("(EXTERIOR_NO_EXIT_FACE)"));
  EXPECT_THAT(refused.err, HasSubstr("next: use --exit auto"));
  const Json reported = RunJson(
      {"bind", model, "--cage", Path("small.obj"), "--unbindable", "report"});
  EXPECT_EQ(reported["unbound"][0]["reason"], "EXTERIOR_NO_EXIT_FACE");
  EXPECT_EQ(reported["unbound"][0]["points"].size(),
            reported["unbound_count"].get<size_t>());
}

TEST_F(Cli, BindAddsTheBoxAndClampsOnRequest) {
  Write("handles.obj", "v 0.1 0 0\nv -0.1 0 0\n");
  Write("points.txt", "3 7\n11");
  const std::string model = Register();
  const CliResult refused =
      Run({"bind", model, "--cage", Path("cube.obj"), "--add-box"});
  EXPECT_EQ(refused.exit_code, kUsage);
  const Json bound = RunJson({"bind", model, "--handles", Path("handles.obj"),
                              "--add-box", "--clamp", Path("points.txt")});
  EXPECT_EQ(bound["vertex_count"], 2);
  EXPECT_EQ(bound["fixed_handle_count"], 8);
  EXPECT_EQ(bound["clamped"], Json({3, 7, 11}));
  const CliResult told = Run({"bind", model, "--handles", Path("handles.obj"),
                              "--add-box", "--clamp", "11,3,7"});
  EXPECT_THAT(told.out, HasSubstr(bound["binding_id"].get<std::string>()));
  EXPECT_THAT(told.out, HasSubstr("2 vertices, 8 fixed handles, 0 normals"));
  EXPECT_THAT(told.out, HasSubstr("clamped        3 points: 3, 7, 11\n"));
  EXPECT_THAT(Run({"bind", model, "--handles", Path("handles.obj"), "--add-box",
                   "--clamp", "1.5"})
                  .err,
              HasSubstr("--clamp: entry 0 (1.5) is not the number of a point"));
}

TEST_F(Cli, HandlesEditsABindingAndTellsWhatMoved) {
  // One in the middle, and the corners of the cube.
  Positions handles = Positions::Zero(9, 3);
  handles.bottomRows(8) = Cube().vertices();
  Write("handles.obj", ObjText(handles, Faces(0, 3)));
  const std::string binding = RunJson(
      {"bind", Register(), "--handles", Path("handles.obj")})["binding_id"];
  const std::string session =
      server_.client().CreateSession(binding)->session_id;
  const Positions outward = 2 * handles.row(3);
  const Json edited =
      RunJson({"handles", binding, "--add", "0.1,0,0", "--move",
               absl::StrCat("3,", absl::StrJoin(outward.reshaped(), ",")),
               "--remove", "0"});
  EXPECT_EQ(edited["previous_handles"], Json({1, 2, 3, 4, 5, 6, 7, 8, -1}));
  EXPECT_EQ(edited["moved"][0]["session_id"], session);
  EXPECT_EQ(edited["moved"][0]["revision"], 1);
  const CliResult told =
      Run({"handles", edited["binding_id"], "--add", "0,0,0.1"});
  EXPECT_EQ(told.exit_code, kOk) << told.err;
  EXPECT_THAT(told.out, HasSubstr("Newton steps a point"));
  EXPECT_THAT(told.out, HasSubstr("session " + session +
                                  " moved over at revision 2; largest jump"));
  EXPECT_THAT(Run({"handles", binding}).err,
              HasSubstr("say what to edit: --add, --move or --remove"));
  EXPECT_THAT(Run({"handles", binding, "--add", "1,2"}).err,
              HasSubstr("--add 1,2: 3 coordinates, and then perhaps a weight"));
  EXPECT_THAT(Run({"handles", binding, "--move", "a,1,2,3"}).err,
              HasSubstr("--move a,1,2,3: 'a' is no number"));
  EXPECT_THAT(Run({"handles", binding, "--move", "0.5,1,2,3"}).err,
              HasSubstr("it begins with the number of a handle"));
}

TEST_F(Cli, BindTurnsAnInsideOutCageOnRequest) {
  Faces faces = Cube().faces();
  faces.col(0).swap(faces.col(1));
  Write("inverted.obj", ObjText(Cube().vertices(), faces));
  const std::string model = Register();
  const CliResult refused =
      Run({"bind", model, "--cage", Path("inverted.obj")});
  EXPECT_EQ(refused.exit_code, kRefused);
  EXPECT_THAT(refused.err, HasSubstr("--flip-cage"));
  EXPECT_EQ(Run({"bind", model, "--cage", Path("inverted.obj"), "--flip-cage"})
                .exit_code,
            kOk);
}

TEST_F(Cli, DeformReplacesThePositionsAndNothingElse) {
  Write("ball.obj", "# a ball\n" + Read("ball.obj") + "# the end\n");
  const CliResult result = Run(
      {"deform", "--model-file", Path("ball.obj"), "--cage", Path("cube.obj"),
       "--pose", Path("moved.obj"), "--out", Path("out.obj"), "--png",
       Path("out.png"), "--width", "64", "--height", "64"});
  EXPECT_EQ(result.exit_code, kOk) << result.err;
  EXPECT_THAT(result.out, HasSubstr("162 points deformed"));
  EXPECT_THAT(Read("out.obj"), StartsWith("# a ball\nv "));
  EXPECT_THAT(Read("out.obj"), EndsWith("# the end\n"));
  EXPECT_THAT(Read("out.png"), StartsWith("\x89PNG"));
  const MeshFile out = ReadMeshFile(Path("out.obj")).value();
  Positions expected = Ball().positions();
  expected.col(0).array() += 5;
  // The float of the wire, at the size of the ball.
  EXPECT_LT((out.positions - expected).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_EQ(out.faces, Ball().faces());
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Cli, DeformLeavesAloneWhatWasThereBefore) {
  const std::string binding = Bind();
  EXPECT_EQ(Run({"deform", "--model-file", Path("ball.obj"), "--cage",
                 Path("cube.obj"), "--pose", Path("moved.obj"), "--out",
                 Path("out.obj")})
                .exit_code,
            kOk);
  EXPECT_TRUE(server_.client().GetBinding(binding).ok());
  EXPECT_THAT(*server_.client().ListSessions(), IsEmpty());
}

TEST_F(Cli, DeformWithABindingNeedsNoModelFile) {
  const CliResult result =
      Run({"deform", "--binding", Bind(), "--pose", Path("moved.obj"), "--out",
           Path("points.obj")});
  EXPECT_EQ(result.exit_code, kOk) << result.err;
  EXPECT_EQ(ReadMeshFile(Path("points.obj"))->positions.rows(), 162);
}

TEST_F(Cli, DeformSaysWhenFilesDoNotFit) {
  const CliResult pose = Run({"deform", "--model-file", Path("ball.obj"),
                              "--cage", Path("cube.obj"), "--pose",
                              Path("ball.obj"), "--out", Path("out.obj")});
  EXPECT_EQ(pose.exit_code, kBadFile);
  EXPECT_THAT(pose.err, HasSubstr("ball.obj: has 162 vertices, the rig has 8"));
  EXPECT_TRUE(ServerIsEmpty()) << "also after an error";
  const CliResult model =
      Run({"deform", "--model-file", Path("cube.obj"), "--binding", Bind(),
           "--pose", Path("moved.obj"), "--out", Path("out.obj")});
  EXPECT_EQ(model.exit_code, kBadFile);
  EXPECT_THAT(
      model.err,
      HasSubstr("cube.obj: has 8 vertices, the binding's model has 162"));
}

TEST_F(Cli, DeformKeepsTheZOfAFlatModel) {
  Write("grid.obj", "v 0.2 0.2 7\nv 0.8 0.2 7\nv 0.5 0.8 7\nf 1 2 3\n");
  Write("square.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nl 1 2 3 4 1\n");
  Write("pose.obj", "v 3 0 0\nv 4 0 0\nv 4 1 0\nv 3 1 0\nl 1 2 3 4 1\n");
  const CliResult result = Run({"deform", "--model-file", Path("grid.obj"),
                                "--cage", Path("square.obj"), "--pose",
                                Path("pose.obj"), "--out", Path("out.obj")});
  EXPECT_EQ(result.exit_code, kOk) << result.err;
  const MeshFile out =
      ReadMeshFile(Path("out.obj"), FileDimension::k3d).value();
  EXPECT_NEAR(out.positions(0, 0), 3.2, 1e-6);
  EXPECT_EQ(out.positions(0, 2), 7);
}

TEST_F(Cli, PlayAnswersEveryPose) {
  const Json report = RunJson({"play", "--motion", "twist", "--frames", "20",
                               "--model-file", Path("ball.obj"), "--cage",
                               Path("cube.obj"), "--out-dir", Path("frames")});
  EXPECT_EQ(report["poses"], 20);
  EXPECT_EQ(report["frames"], 20);
  EXPECT_EQ(report["skipped_revisions"], 0);
  EXPECT_GT(report["latency_ms"]["p50"], 0);
  EXPECT_TRUE(std::filesystem::exists(Path("frames/frame_0001.obj")));
  // A motion ends at rest.
  const MeshFile last = ReadMeshFile(Path("frames/frame_0020.obj")).value();
  EXPECT_LT((last.positions - Ball().positions()).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_TRUE(ServerIsEmpty());
}

TEST_F(Cli, PlayTakesPoseFilesAndTheNewestStateOnly) {
  const CliResult result = Run({"play", Path("cube.obj"), Path("moved.obj"),
                                "--delivery", "latest", "--binding", Bind()});
  EXPECT_EQ(result.exit_code, kOk) << result.err;
  EXPECT_THAT(result.out, HasSubstr("2 poses, "));
  EXPECT_THAT(result.out, HasSubstr("pose to frame: p50"));
}

TEST_F(Cli, ListsAreTablesOrJson) {
  EXPECT_EQ(Run({"list", "models"}).err, "no models\n");
  EXPECT_THAT(RunJson({"list", "models"})["models"], SizeIs(0));
  const std::string binding = Bind();
  const std::string session =
      server_.client().CreateSession(binding, "mine")->session_id;
  EXPECT_THAT(Run({"list", "models"}).out, HasSubstr("ball.obj\n"));
  EXPECT_THAT(Run({"list", "bindings"}).out, HasSubstr(binding));
  EXPECT_THAT(Run({"list", "sessions"}).out, HasSubstr("mine"));
  EXPECT_THAT(Run({"list", "schemes"}).out, HasSubstr("green"));
  EXPECT_EQ(RunJson({"list", "bindings"})["bindings"][0]["point_count"], 162);
  EXPECT_EQ(RunJson({"list", "sessions"})["sessions"][0]["session_id"], "mine");
}

TEST_F(Cli, ShowAndDeleteFindThingsByTheirIds) {
  const std::string binding = Bind();
  const std::string model = Register();
  server_.client().CreateSession(binding, "mine").value();
  EXPECT_EQ(RunJson({"show", model})["kind"], "model");
  EXPECT_EQ(RunJson({"show", binding})["kind"], "binding");
  EXPECT_EQ(RunJson({"show", "mine"})["kind"], "session");
  const CliResult used = Run({"delete", model});
  EXPECT_EQ(used.exit_code, kRefused);
  EXPECT_THAT(used.err, HasSubstr("delete its bindings first"));
  const CliResult deleted = Run({"delete", "mine", binding, model});
  EXPECT_EQ(deleted.exit_code, kOk) << deleted.err;
  EXPECT_EQ(deleted.out, "deleted session mine\ndeleted binding " + binding +
                             "\ndeleted model " + model + "\n");
  EXPECT_TRUE(ServerIsEmpty());
  const CliResult unknown = Run({"show", "mine"});
  EXPECT_EQ(unknown.exit_code, kRefused);
  EXPECT_THAT(unknown.err, HasSubstr("no model, binding or session 'mine'"));
}

TEST_F(Cli, WeightsAreDumpedAsTextAndBytes) {
  const std::string binding = Bind();
  const CliResult csv =
      Run({"weights", binding, "--first", "5", "--count", "2"});
  EXPECT_EQ(csv.exit_code, kOk) << csv.err;
  EXPECT_THAT(csv.out, StartsWith("point,v0,"));
  EXPECT_THAT(csv.out, HasSubstr(",n11\n5,"));
  EXPECT_EQ(std::count(csv.out.begin(), csv.out.end(), '\n'), 3);

  const Json json = RunJson({"weights", binding, "--double", "--count", "1"});
  double sum = 0;
  for (const Json& weight : json["points"][0]["vertex"]) {
    sum += weight.get<double>();
  }
  EXPECT_NEAR(sum, 1, 1e-14);

  EXPECT_EQ(
      Run({"weights", binding, "--format", "binary", "--out", Path("w.f32")})
          .exit_code,
      kOk);
  EXPECT_EQ(Read("w.f32").size(), 162u * 20 * 4);
  EXPECT_EQ(Run({"weights", binding, "--double", "--format", "binary", "--out",
                 Path("w.f64")})
                .exit_code,
            kOk);
  EXPECT_EQ(Read("w.f64").size(), 162u * 20 * 8);
  EXPECT_EQ(Run({"weights", binding, "--out", "/nonexistent/w"}).exit_code,
            kBadFile);
}

TEST_F(Cli, TenantsDoNotSeeEachOther) {
  Register();
  EXPECT_THAT(RunJson({"--tenant", "other", "list", "models"})["models"],
              SizeIs(0));
}

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

TEST_F(Cli, AnInterruptedPlayLeavesNothingBehind) {
  std::ostringstream out;
  std::ostringstream err;
  Interruption interruption;
  interruption.requested = true;
  EXPECT_EQ(RunDeformctl(
                {"--server", server_.address(), "play", "--motion", "bend",
                 "--model-file", Path("ball.obj"), "--cage", Path("cube.obj")},
                {out, err, false, interruption}),
            kInterrupted);
  EXPECT_TRUE(interruption.expected);
  EXPECT_TRUE(ServerIsEmpty());
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
