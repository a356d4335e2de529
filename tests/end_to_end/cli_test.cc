// deformctl against a live server: models, bindings, sessions and frames.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/files/mesh_file.h"
#include "tests/end_to_end/cli_fixture.h"

namespace deform::cli {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::StartsWith;

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

TEST_F(Cli, BindTakesAWeightToleranceAndTellsTheForm) {
  const std::string model = Register();
  const CliResult told = Run({"bind", model, "--cage", Path("cube.obj"),
                              "--weight-tolerance", "1e-4"});
  EXPECT_THAT(told.out, HasSubstr("form           dense: they are small: "));
  const Json dense = RunJson(
      {"bind", model, "--cage", Path("cube.obj"), "--weight-tolerance", "0"});
  EXPECT_EQ(dense["weight_tolerance"], 0);
  EXPECT_EQ(dense["weight_form"], "dense");
  EXPECT_EQ(dense["why_dense"], "");
  EXPECT_EQ(dense["compression_ratio"], 1);
  EXPECT_EQ(dense["dense_weight_bytes"], dense["weight_bytes"]);
  EXPECT_THAT(Run({"list", "bindings"}).out, HasSubstr("dense"));
  const CliResult refused = Run(
      {"bind", model, "--cage", Path("cube.obj"), "--weight-tolerance", "0.5"});
  EXPECT_EQ(refused.exit_code, kRefused);
  EXPECT_THAT(refused.err, HasSubstr("in [1e-06, 0.01], not 0.5"));
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

TEST_F(Cli, AModelComesBackAsAFile) {
  const std::string binding = Bind();
  const std::string model = RunJson({"show", binding})["model_id"];
  const CliResult written = Run({"download", model, "--out", Path("back.obj")});
  EXPECT_EQ(written.exit_code, kOk) << written.err;
  EXPECT_THAT(written.out, HasSubstr("162 points, 320 triangles\nwrote"));
  // The same content is the same model.
  EXPECT_EQ(RunJson({"register", Path("back.obj")})["model_id"], model);
  EXPECT_EQ(Run({"download", "nowhere", "--out", Path("none.obj")}).exit_code,
            kRefused);
  EXPECT_EQ(Run({"download", model, "--out", "/nonexistent/m"}).exit_code,
            kBadFile);
}

TEST_F(Cli, PlaysWithWeightsOfItsOwn) {
  const Json played = RunJson({"play", "--binding", Bind(), "--motion", "bend",
                               "--frames", "20", "--encoding", "pose"});
  EXPECT_EQ(played["encodings"].size(), 1u);
  EXPECT_EQ(played["encodings"]["pose"], 20);
}

TEST_F(Cli, TenantsDoNotSeeEachOther) {
  Register();
  EXPECT_THAT(RunJson({"--tenant", "other", "list", "models"})["models"],
              SizeIs(0));
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

}  // namespace
}  // namespace deform::cli
