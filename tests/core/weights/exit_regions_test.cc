#include "core/weights/exit_regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/weights/cage_faces.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using Kind = ExitRegions::Kind;

Cage Cube() { return CageOf(Cuboid({-1, -1, -1}, {1, 1, 1})); }

// A bar of square cross-section along x, with its middle at (y, z).
Shape Leg(double from, double to, double y, double z) {
  const int cells[] = {10, 2, 2};
  return Bar({from, y - 0.1, z - 0.1}, {to, y + 0.1, z + 0.1}, cells);
}

std::vector<PointState> StatesOf(const Mesh& model, const Cage& cage) {
  const auto evaluator = (*FindScheme("green"))->Prepare(cage, {});
  WeightBlock block;
  (*evaluator)->Evaluate(model.positions(), block);
  return block.states;
}

ExitAssignment Assign(const Mesh& model, const Cage& cage,
                      const ExitRegions& regions) {
  return AssignExitFaces(model, cage, StatesOf(model, cage), regions);
}

std::vector<int64_t> OutsidePoints(const Mesh& model, const Cage& cage) {
  const std::vector<PointState> states = StatesOf(model, cage);
  std::vector<int64_t> points;
  for (size_t i = 0; i < states.size(); ++i) {
    if (states[i] == PointState::kOutside) points.push_back(i);
  }
  return points;
}

// The faces whose outward normal is n: the two triangles of a side of a cube.
std::vector<int32_t> Side(const Cage& cage, const Vec3& n) {
  const CageFaces faces(cage);
  std::vector<int32_t> side;
  for (int64_t f = 0; f < faces.size(); ++f) {
    if ((faces[f].normal - n).norm() < 1e-12) side.push_back(f);
  }
  return side;
}

// Which of the two triangles of the side x = 1 the line at (y, z) passes.
int32_t FaceAt(const Cage& cage, double y, double z) {
  return static_cast<int32_t>(CageFaces(cage).NearestOf({1, y, z}).face);
}

TEST(AutomaticExit, TakesTheFaceThatALegCrosses) {
  const Cage cage = Cube();
  // One side of the diagonal of the square, whichever it is.
  const Mesh model = MeshOf(Leg(-0.5, 2, 0.7, 0));
  const ExitAssignment exits = Assign(model, cage, {.kind = Kind::kAutomatic});
  EXPECT_THAT(exits.unbound, IsEmpty());
  ASSERT_THAT(exits.parts, SizeIs(1));
  EXPECT_EQ(exits.parts[0].exit_face, FaceAt(cage, 0.7, 0));
  EXPECT_EQ(exits.parts[0].points, OutsidePoints(model, cage));
  EXPECT_THAT(exits.parts[0].crossed_faces, IsEmpty());
}

TEST(AutomaticExit, GivesEachOfTwoLegsItsOwnFace) {
  const Cage cage = Cube();
  const Mesh model = MeshOf(Leg(-3, 2, 0.7, 0));
  const ExitAssignment exits = Assign(model, cage, {.kind = Kind::kAutomatic});
  EXPECT_THAT(exits.unbound, IsEmpty());
  ASSERT_THAT(exits.parts, SizeIs(2));
  for (const ExitPart& part : exits.parts) {
    const double side = model.positions()(part.points[0], 0) > 0 ? 1 : -1;
    EXPECT_THAT(Side(cage, {side, 0, 0}), Contains(part.exit_face));
    for (int64_t i : part.points) EXPECT_GT(side * model.positions()(i, 0), 1);
  }
}

TEST(AutomaticExit, OfTwoFacesOfASideTakesTheOneMoreOftenCrossed) {
  const Cage cage = Cube();
  // The diagonal passes through the middle of the side, so close to it most
  // edges, not all, cross one of the triangles.
  const Mesh model = MeshOf(Leg(-0.5, 2, 0.04, 0));
  const ExitAssignment exits = Assign(model, cage, {.kind = Kind::kAutomatic});
  ASSERT_THAT(exits.parts, SizeIs(1));
  const ExitPart& part = exits.parts[0];
  EXPECT_EQ(part.exit_face, FaceAt(cage, 0.04, 0));
  ASSERT_THAT(part.crossed_faces, SizeIs(1));
  EXPECT_NE(part.crossed_faces[0], part.exit_face);
  EXPECT_THAT(Side(cage, {1, 0, 0}), Contains(part.crossed_faces[0]));
}

TEST(AutomaticExit, DoesNotServeAPartThatFloatsFree) {
  const Cage cage = Cube();
  const Mesh model =
      MeshOf(Joined(Leg(-0.5, 0.5, 0, 0), Cuboid({3, 3, 3}, {3.5, 3.5, 3.5})));
  const ExitAssignment exits = Assign(model, cage, {.kind = Kind::kAutomatic});
  EXPECT_THAT(exits.parts, IsEmpty());
  ASSERT_THAT(exits.unbound, SizeIs(1));
  EXPECT_EQ(exits.unbound[0].reason, "EXTERIOR_NO_EXIT_FACE");
  EXPECT_THAT(exits.unbound[0].detail, HasSubstr("does not cross the cage"));
  EXPECT_EQ(exits.unbound[0].points, OutsidePoints(model, cage));
}

TEST(AutomaticExit, RefusesToChooseBetweenFacesThatDoNotTouch) {
  // A ring around the z axis that passes through the cage along y.
  const Cage cage = CageOf(Cuboid({1, -0.6, -1}, {3, 0.6, 1}));
  const Mesh model = MeshOf(Torus(2, 0.2, 40, 8));
  const ExitAssignment exits = Assign(model, cage, {.kind = Kind::kAutomatic});
  EXPECT_THAT(exits.parts, IsEmpty());
  ASSERT_THAT(exits.unbound, SizeIs(1));
  EXPECT_EQ(exits.unbound[0].reason, "EXIT_AMBIGUOUS");
  EXPECT_THAT(exits.unbound[0].detail, HasSubstr("which do not touch"));
}

TEST(AutomaticExit, ServesASingleVertexThatPeeksOut) {
  const Cage cage = Cube();
  Shape shape = Icosphere(0.9, 2);
  int64_t top = 0;
  shape.positions.col(2).maxCoeff(&top);
  shape.positions.row(top) << 0.3, 0.1, 1 + 1e-9;
  const ExitAssignment exits =
      Assign(MeshOf(shape), cage, {.kind = Kind::kAutomatic});
  EXPECT_THAT(exits.unbound, IsEmpty());
  ASSERT_THAT(exits.parts, SizeIs(1));
  EXPECT_THAT(exits.parts[0].points, ElementsAre(top));
  EXPECT_THAT(Side(cage, {0, 0, 1}), Contains(exits.parts[0].exit_face));
}

TEST(AutomaticExit, GivesPointsWithoutEdgesTheirNearestFace) {
  const Cage cage = Cube();
  Shape points{Positions(3, 3), Faces(0, 3)};
  points.positions << 3, 0.5, 0.1,  //
      0, 0, 0,                      //
      0.1, -7, 0.2;
  const ExitAssignment exits =
      Assign(MeshOf(points), cage, {.kind = Kind::kAutomatic});
  EXPECT_THAT(exits.unbound, IsEmpty());
  ASSERT_THAT(exits.parts, SizeIs(2));
  EXPECT_THAT(exits.parts[0].points, ElementsAre(0));
  EXPECT_THAT(Side(cage, {1, 0, 0}), Contains(exits.parts[0].exit_face));
  EXPECT_THAT(exits.parts[1].points, ElementsAre(2));
  EXPECT_THAT(Side(cage, {0, -1, 0}), Contains(exits.parts[1].exit_face));
}

TEST(AutomaticExit, WorksInThePlane) {
  const Eigen::Vector2d corners[] = {{0.2, -1}, {2, -1}, {2, 2}, {0.2, 2}};
  const Cage cage = CageOf(Loop2d(corners));
  const Mesh model = MeshOf(Grid2d(8), 2);  // Leaves through x = 0.2 only.
  const ExitAssignment exits = Assign(model, cage, {.kind = Kind::kAutomatic});
  EXPECT_THAT(exits.unbound, IsEmpty());
  ASSERT_THAT(exits.parts, SizeIs(1));
  EXPECT_EQ(exits.parts[0].exit_face, 3);
  EXPECT_THAT(exits.parts[0].crossed_faces, IsEmpty());
  EXPECT_EQ(exits.parts[0].points, OutsidePoints(model, cage));
}

// A triangle from two points inside to one outside, whose edges cross face f
// and g at their centroids.
Shape TriangleThrough(const Cage& cage, int64_t f, int64_t g,
                      const Vec3& outside) {
  const CageFaces faces(cage);
  Shape shape{Positions(3, 3), Faces(1, 3)};
  shape.faces << 0, 1, 2;
  shape.positions.row(2) = outside;
  for (int k = 0; k < 2; ++k) {
    const CageFaces::Face& face = faces[k == 0 ? f : g];
    const Vec3 centroid = face.position[0] + face.center;
    shape.positions.row(k) = centroid + 0.1 * (centroid - outside);
  }
  return shape;
}

int SharedCorners(const CageFaces::Face& f, const CageFaces::Face& g) {
  int shared = 0;
  for (int32_t a : f.corner) shared += std::count(g.corner, g.corner + 3, a);
  return shared;
}

TEST(AutomaticExit, BreaksATieByTheLowerFace) {
  const Cage cage = Cube();
  const std::vector<int32_t> side = Side(cage, {1, 0, 0});
  for (const bool swap : {false, true}) {
    const Mesh model =
        MeshOf(TriangleThrough(cage, side[swap], side[!swap], {2, 0.1, 0.2}));
    const ExitAssignment exits =
        Assign(model, cage, {.kind = Kind::kAutomatic});
    ASSERT_THAT(exits.parts, SizeIs(1));
    EXPECT_EQ(exits.parts[0].exit_face, side[0]);
    EXPECT_THAT(exits.parts[0].crossed_faces, ElementsAre(side[1]));
  }
}

TEST(AutomaticExit, RefusesToChooseBetweenFacesThatMeetAtACornerOnly) {
  const Cage cage = Cube();
  const CageFaces faces(cage);
  int pairs = 0;
  for (int64_t f : Side(cage, {1, 0, 0})) {
    for (int64_t g : Side(cage, {0, 1, 0})) {
      const Mesh model = MeshOf(TriangleThrough(cage, f, g, {1.5, 1.5, 0.1}));
      const ExitAssignment exits =
          Assign(model, cage, {.kind = Kind::kAutomatic});
      if (SharedCorners(faces[f], faces[g]) == 2) {
        EXPECT_THAT(exits.parts, SizeIs(1)) << f << " and " << g;
      } else {
        EXPECT_THAT(exits.parts, IsEmpty()) << f << " and " << g;
        ++pairs;
      }
    }
  }
  EXPECT_GT(pairs, 0);
}

TEST(AutomaticExit, CountsTheLastFaceThatAnEdgeCrosses) {
  // A U: edges from its right arm over the gap and through its left arm.
  const Eigen::Vector2d corners[] = {{0, 0}, {3, 0}, {3, 3}, {2, 3},
                                     {2, 1}, {1, 1}, {1, 3}, {0, 3}};
  Shape shape{Positions(3, 3), Faces(1, 3)};
  shape.positions << 2.5, 2, 0, 2.5, 2.1, 0, -1, 2, 0;
  shape.faces << 0, 1, 2;
  const ExitAssignment exits = Assign(MeshOf(shape, 2), CageOf(Loop2d(corners)),
                                      {.kind = Kind::kAutomatic});
  ASSERT_THAT(exits.parts, SizeIs(1));
  EXPECT_EQ(exits.parts[0].exit_face, 7);  // x = 0
  EXPECT_THAT(exits.parts[0].crossed_faces, IsEmpty());
}

TEST(AutomaticExit, AcceptsEdgesThatLeaveThroughAnEdgeOrFromTheBoundary) {
  const Cage cage = Cube();
  // Triangles with a corner inside, one on the boundary and one outside, all
  // within the plane through the cage's edge x = y = 1.
  Shape shape{Positions(3, 3), Faces(1, 3)};
  shape.positions << 0.5, 0.5, 0, 1, 1, 0.25, 2, 2, 0;
  shape.faces << 0, 1, 2;
  const ExitAssignment exits =
      Assign(MeshOf(shape), cage, {.kind = Kind::kAutomatic});
  EXPECT_THAT(exits.unbound, IsEmpty());
  ASSERT_THAT(exits.parts, SizeIs(1));
  std::vector<int32_t> meeting = Side(cage, {1, 0, 0});
  for (int32_t f : Side(cage, {0, 1, 0})) meeting.push_back(f);
  EXPECT_THAT(meeting, Contains(exits.parts[0].exit_face));
}

class NamedFaces : public testing::Test {
 protected:
  // Crosses both triangles of the side x = 1, `major` more often.
  const Cage cage_ = Cube();
  const Mesh model_ = MeshOf(Leg(-0.5, 2, 0.04, 0));
  const int32_t major_ = FaceAt(cage_, 0.04, 0);
  const int32_t minor_ = Side(cage_, {1, 0, 0})[0] == major_
                             ? Side(cage_, {1, 0, 0})[1]
                             : Side(cage_, {1, 0, 0})[0];
  const int32_t other_ = Side(cage_, {0, 1, 0})[0];

  ExitAssignment AssignTo(std::vector<int32_t> faces) const {
    return Assign(model_, cage_,
                  {.kind = Kind::kFaces, .faces = std::move(faces)});
  }
};

TEST_F(NamedFaces, TakeAPartThatCrossesOneOfThem) {
  const ExitAssignment exits = AssignTo({other_, minor_});
  EXPECT_THAT(exits.unbound, IsEmpty());
  ASSERT_THAT(exits.parts, SizeIs(1));
  EXPECT_EQ(exits.parts[0].exit_face, minor_);
  EXPECT_THAT(exits.parts[0].crossed_faces, ElementsAre(major_));
}

TEST_F(NamedFaces, AreAmbiguousWhereAPartCrossesTwo) {
  const ExitAssignment exits = AssignTo({major_, minor_});
  EXPECT_THAT(exits.parts, IsEmpty());
  ASSERT_THAT(exits.unbound, SizeIs(1));
  EXPECT_EQ(exits.unbound[0].reason, "EXIT_AMBIGUOUS");
  EXPECT_THAT(exits.unbound[0].detail, HasSubstr("crosses the named faces"));
  EXPECT_EQ(exits.unbound[0].points, OutsidePoints(model_, cage_));
}

TEST_F(NamedFaces, DoNotServeAPartThatCrossesOthers) {
  const ExitAssignment exits = AssignTo({other_});
  EXPECT_THAT(exits.parts, IsEmpty());
  ASSERT_THAT(exits.unbound, SizeIs(1));
  EXPECT_EQ(exits.unbound[0].reason, "EXTERIOR_NO_EXIT_FACE");
  EXPECT_THAT(exits.unbound[0].detail, HasSubstr("none of the named"));
}

TEST_F(NamedFaces, AreChosenAmongThoseThatMeetAtAnEdge) {
  // The model edge leaves exactly through the cage's edge x = y = 1.
  Shape shape{Positions(3, 3), Faces(1, 3)};
  shape.positions << 0.5, 0.5, 0, 0.5, 0.5, 0.5, 2, 2, 0;
  shape.faces << 0, 1, 2;
  for (const Vec3& normal : {Vec3(1, 0, 0), Vec3(0, 1, 0)}) {
    const ExitAssignment exits =
        Assign(MeshOf(shape), cage_,
               {.kind = Kind::kFaces, .faces = Side(cage_, normal)});
    ASSERT_THAT(exits.parts, SizeIs(1)) << normal.transpose();
    EXPECT_THAT(Side(cage_, normal), Contains(exits.parts[0].exit_face));
  }
}

TEST_F(NamedFaces, GivePointsWithoutEdgesTheNearestOfThem) {
  Shape points{Positions(1, 3), Faces(0, 3)};
  points.positions << 3, 0, 0;
  const ExitAssignment exits =
      Assign(MeshOf(points), cage_, {.kind = Kind::kFaces, .faces = {other_}});
  ASSERT_THAT(exits.parts, SizeIs(1));
  EXPECT_EQ(exits.parts[0].exit_face, other_);
}

TEST(ExitPerPoint, FollowsTheCallerAndReportsTheRest) {
  const Cage cage = Cube();
  const Mesh model = MeshOf(Leg(-0.5, 2, 0.04, 0));
  const std::vector<int64_t> outside = OutsidePoints(model, cage);
  ExitRegions regions{.kind = Kind::kPerPoint};
  regions.face_of_point.assign(model.size(), 5);
  regions.face_of_point[outside.back()] = -1;
  const ExitAssignment exits = Assign(model, cage, regions);
  ASSERT_THAT(exits.parts, SizeIs(1));
  EXPECT_EQ(exits.parts[0].exit_face, 5);
  EXPECT_THAT(exits.parts[0].points, SizeIs(outside.size() - 1));
  EXPECT_THAT(exits.parts[0].crossed_faces, Not(IsEmpty()));
  ASSERT_THAT(exits.unbound, SizeIs(1));
  EXPECT_EQ(exits.unbound[0].reason, "EXTERIOR_NO_EXIT_FACE");
  EXPECT_THAT(exits.unbound[0].points, ElementsAre(outside.back()));
}

TEST(NoExit, LeavesAllOutsidePointsUnbound) {
  const Cage cage = Cube();
  const Mesh model = MeshOf(Leg(-0.5, 2, 0.7, 0));
  const ExitAssignment exits = Assign(model, cage, {});
  EXPECT_THAT(exits.parts, IsEmpty());
  ASSERT_THAT(exits.unbound, SizeIs(1));
  EXPECT_EQ(exits.unbound[0].reason, "EXTERIOR_NO_EXIT_FACE");
  EXPECT_EQ(exits.unbound[0].points, OutsidePoints(model, cage));
}

struct BadRegions {
  std::string name;
  ExitRegions regions;
  std::string reason;
  std::string message;
};

class ExitRegionsRefuse : public testing::TestWithParam<BadRegions> {};

TEST_P(ExitRegionsRefuse, WhatDoesNotFit) {
  const absl::Status status = CheckExitRegions(GetParam().regions, Cube(), 3);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, GetParam().reason);
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Regions, ExitRegionsRefuse,
    testing::ValuesIn<BadRegions>({
        {"FaceBeyondTheLast",
         {.kind = Kind::kFaces, .faces = {0, 12}},
         "EXIT_FACE_OUT_OF_RANGE",
         "exit face 1 refers to face 12 of 12"},
        {"NegativeFace",
         {.kind = Kind::kFaces, .faces = {-1}},
         "EXIT_FACE_OUT_OF_RANGE",
         "refers to face -1 of 12"},
        {"EmptyList",
         {.kind = Kind::kFaces},
         "NO_EXIT_FACES",
         "list of exit faces is empty"},
        {"TooFewPoints",
         {.kind = Kind::kPerPoint, .face_of_point = {1, 2}},
         "WRONG_LENGTH",
         "there are 2 exit faces for 3 points"},
        {"PointToNowhere",
         {.kind = Kind::kPerPoint, .face_of_point = {1, -1, -2}},
         "EXIT_FACE_OUT_OF_RANGE",
         "the exit face of point 2 refers to face -2 of 12"},
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform
