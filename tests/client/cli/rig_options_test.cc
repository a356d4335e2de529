#include "client/cli/rig_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cli/exit_code.h"
#include "client/cli/files.h"
#include "tests/support/temporary_folder.h"

namespace deform::cli {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string Tetrahedron() {
  return Temporary().Write("tetrahedron.obj",
                           "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
                           "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
}

std::string Square() {
  return Temporary().Write("square.obj",
                           "v 0 0 5\nv 1 0 5\nv 1 1 5\nv 0 1 5\nl 1 4 3 2 1\n");
}

TEST(Exits, AreNoneAutomaticOrNamed) {
  EXPECT_EQ(ParseExits("")->kind, ExitRegions::Kind::kNone);
  EXPECT_EQ(ParseExits("auto")->kind, ExitRegions::Kind::kAutomatic);
  EXPECT_THAT(ParseExits("3,17")->faces, ElementsAre(3, 17));
  for (const char* text : {"all", "3,", "-1", "1.5", "3 4", "99999999999"}) {
    const auto exits = ParseExits(text);
    ASSERT_FALSE(exits.ok()) << text;
    EXPECT_EQ(ExitCodeOf(exits.status()), kUsage);
    EXPECT_THAT(std::string(exits.status().message()),
                HasSubstr("neither 'auto' nor a face number"));
  }
}

TEST(Spec, OfACageIsGreenUnlessSaidOtherwise) {
  RigOptions options;
  options.cage = Tetrahedron();
  options.exit = "auto";
  options.unbindable = "report";
  options.flip_cage = true;
  const BindingSpec spec = LoadSpec(options, 3).value();
  EXPECT_EQ(spec.scheme, "green");
  EXPECT_EQ(spec.rig.kind, RigKind::kCage);
  EXPECT_EQ(spec.rig.faces.rows(), 4);
  EXPECT_EQ(spec.unbindable, Unbindable::kReport);
  EXPECT_TRUE(spec.flip_inside_out);
  options.scheme = "mean_value";
  EXPECT_EQ(LoadSpec(options, 3)->scheme, "mean_value");
}

TEST(Spec, OfHandlesTakesTheirWeightsFromAListOrAFile) {
  RigOptions options;
  options.handles = Tetrahedron();
  options.handle_weights = "0,0.5,1,2";
  const BindingSpec spec = LoadSpec(options, 3).value();
  EXPECT_EQ(spec.scheme, "s_cc");
  EXPECT_EQ(spec.rig.kind, RigKind::kHandles);
  EXPECT_THAT(spec.options.handle_weights, ElementsAre(0, 0.5, 1, 2));
  options.handle_weights = Temporary().Write("weights.txt", "3\n4, 5\t6\n");
  EXPECT_THAT(LoadSpec(options, 3)->options.handle_weights,
              ElementsAre(3, 4, 5, 6));
}

TEST(Spec, TakesAnExitFaceForEachPoint) {
  RigOptions options;
  options.cage = Tetrahedron();
  options.exit_per_point = Temporary().Write("exits.txt", "-1\n0\n3\n");
  EXPECT_THAT(LoadSpec(options, 3)->exits.face_of_point, ElementsAre(-1, 0, 3));
  for (const char* text : {"0.5", "-2", "1e12", "nan"}) {
    options.exit_per_point = Temporary().Write("exits.txt", text);
    const auto spec = LoadSpec(options, 3);
    ASSERT_FALSE(spec.ok()) << text;
    EXPECT_EQ(ExitCodeOf(spec.status()), kBadFile);
    EXPECT_THAT(std::string(spec.status().message()),
                HasSubstr("exits.txt: entry 0"));
  }
}

TEST(Spec, TurnsTheLoopsOfA2dCageLeft) {
  RigOptions options;
  options.cage = Square();
  const BindingSpec spec = LoadSpec(options, 2).value();
  EXPECT_EQ(spec.rig.dimension, 2);
  ASSERT_EQ(spec.rig.faces.rows(), 4);
  double area = 0;
  for (int f = 0; f < 4; ++f) {
    const auto a = spec.rig.vertices.row(spec.rig.faces(f, 0));
    const auto b = spec.rig.vertices.row(spec.rig.faces(f, 1));
    area += 0.5 * (a.x() * b.y() - a.y() * b.x());
  }
  EXPECT_DOUBLE_EQ(area, 1) << "counter-clockwise, though the file is not";
}

TEST(Spec, SaysWhatIsWrongWithAFile) {
  RigOptions options;
  EXPECT_THAT(std::string(LoadSpec(options, 3).status().message()),
              HasSubstr("--cage FILE or --handles FILE"));
  options.cage = Temporary().Write("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 1\n");
  EXPECT_THAT(std::string(LoadSpec(options, 3).status().message()),
              HasSubstr("points.obj: has no faces"));
  options.cage = Temporary().Write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
  EXPECT_THAT(std::string(LoadSpec(options, 2).status().message()),
              HasSubstr("flat.obj: has no polylines"));
  options.cage =
      Temporary().Write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\n");
  const auto open = LoadSpec(options, 2);
  EXPECT_EQ(ExitCodeOf(open.status()), kBadFile);
  EXPECT_THAT(std::string(open.status().message()), HasSubstr("open.obj: "));
}

TEST(Dimension, Is2OnlyIfModelAndRigAreFlat) {
  RigOptions options;
  options.cage = Square();
  EXPECT_EQ(ChooseDimension(options, 2).value(), 2);
  EXPECT_EQ(ChooseDimension(options, 3).value(), 3);
  options.cage = Tetrahedron();
  EXPECT_EQ(ChooseDimension(options, 2).value(), 3);
  options.dimension = 2;
  EXPECT_EQ(ChooseDimension(options, 3).value(), 2);
}

TEST(Numbers, NameTheEntryThatIsNone) {
  const auto numbers = LoadNumbers(Temporary().Write("n.txt", "1 2,x"));
  ASSERT_FALSE(numbers.ok());
  EXPECT_THAT(std::string(numbers.status().message()),
              HasSubstr("n.txt: entry 2 ('x') is not a number"));
  EXPECT_THAT(std::string(LoadNumbers("/nonexistent/n.txt").status().message()),
              HasSubstr("/nonexistent/n.txt: No such file"));
}

TEST(WriteFile, SaysWhereItCouldNot) {
  const absl::Status status = WriteFile("/nonexistent/x", "text");
  EXPECT_EQ(ExitCodeOf(status), kBadFile);
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("/nonexistent/x: cannot be written: No such file"));
}

}  // namespace
}  // namespace deform::cli
