#include "core/mesh/cage.h"

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::HasSubstr;

Shape UnitBox() { return Cuboid({0, 0, 0}, {1, 1, 1}); }

Shape Square() {
  return Loop2d(
      std::array<Eigen::Vector2d, 4>{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}});
}

absl::StatusOr<Cage> Create(
    const Shape& shape,
    Cage::Orientation orientation = Cage::Orientation::kAsGiven) {
  return Cage::Create(static_cast<int>(shape.faces.cols()), shape.positions,
                      shape.faces, orientation);
}

void DropFace(Shape& shape, int64_t face) {
  for (int64_t f = face; f + 1 < shape.faces.rows(); ++f) {
    shape.faces.row(f) = shape.faces.row(f + 1);
  }
  shape.faces.conservativeResize(shape.faces.rows() - 1, Eigen::NoChange);
}

void AddFace(Shape& shape, std::initializer_list<int32_t> corners) {
  const int64_t f = shape.faces.rows();
  shape.faces.conservativeResize(f + 1, Eigen::NoChange);
  std::copy(corners.begin(), corners.end(), shape.faces.row(f).data());
}

// Puts a vertex in place of the face, and three faces to it.
void Split(Shape& shape, int64_t face, const Vec3& vertex) {
  const auto added = static_cast<int32_t>(shape.positions.rows());
  shape.positions.conservativeResize(added + 1, 3);
  shape.positions.row(added) = vertex;
  const Eigen::RowVector3i corners = shape.faces.row(face);
  shape.faces(face, 2) = added;
  AddFace(shape, {corners[1], corners[2], added});
  AddFace(shape, {corners[2], corners[0], added});
}

struct BadCage {
  std::string name;
  std::function<void(Shape&)> spoil;
  std::string reason;
  std::string message;
};

std::string NameOf(const testing::TestParamInfo<BadCage>& test) {
  return test.param.name;
}

void ExpectRefused(Shape shape, const BadCage& bad) {
  bad.spoil(shape);
  const auto cage = Create(shape);
  ASSERT_FALSE(cage.ok());
  EXPECT_EQ(cage.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(cage.status()).reason, bad.reason);
  EXPECT_THAT(DetailOf(cage.status()).field, HasSubstr("rig.cage"));
  EXPECT_THAT(std::string(cage.status().message()), HasSubstr(bad.message));
}

class BoxCage : public testing::TestWithParam<BadCage> {};
TEST_P(BoxCage, IsRefused) { ExpectRefused(UnitBox(), GetParam()); }

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

INSTANTIATE_TEST_SUITE_P(
    Cage, BoxCage,
    testing::ValuesIn<BadCage>({
        {"NoVertices", [](Shape& s) { s.positions.resize(0, 3); }, "EMPTY_CAGE",
         "the cage has no vertices"},
        {"NoFaces", [](Shape& s) { s.faces.resize(0, 3); }, "EMPTY_CAGE",
         "the cage has no faces"},
        {"NotANumber", [](Shape& s) { s.positions(3, 1) = kNan; }, "NON_FINITE",
         "vertex 3 has a coordinate that is not finite"},
        {"Infinite", [](Shape& s) { s.positions(0, 0) = kInf; }, "NON_FINITE",
         "vertex 0"},
        {"TooLarge", [](Shape& s) { s.positions(5, 2) = -2e100; },
         "COORDINATE_TOO_LARGE", "vertex 5 has a coordinate beyond 1e+100"},
        {"IndexOutOfRange", [](Shape& s) { s.faces(3, 1) = 8; },
         "INDEX_OUT_OF_RANGE", "face 3 refers to vertex 8 of 8"},
        {"NegativeIndex", [](Shape& s) { s.faces(3, 1) = -1; },
         "INDEX_OUT_OF_RANGE", "face 3 refers to vertex -1 of 8"},
        {"CornerTwice", [](Shape& s) { s.faces(4, 1) = s.faces(4, 0); },
         "DEGENERATE_FACE", "face 4 has vertex"},
        {"CoincidentVertices",
         [](Shape& s) { s.positions.row(1) = s.positions.row(0); },
         "DEGENERATE_FACE", "its vertices 0 and 1 coincide"},
        {"CollinearCorners",
         [](Shape& s) {
           // 0.1, 0.2, 0.3: collinear but for their rounding.
           for (int k = 0; k < 3; ++k) {
             s.positions.row(s.faces(0, k)).setConstant(0.1 * (k + 1));
           }
         },
         "DEGENERATE_FACE", "face 0 has no area: its corners lie on one line"},
        {"SideWithinRounding",
         [](Shape& s) {
           s.positions.row(1) = s.positions.row(0);
           s.positions.col(0).array() += 1e6;
           s.positions(1, 0) = std::nextafter(s.positions(0, 0), 2e6);
         },
         "DEGENERATE_FACE", "too short to tell where it points"},
        {"TooTiny", [](Shape& s) { s.positions *= 1e-101; }, "DEGENERATE_FACE",
         "too short"},
        {"Hole", [](Shape& s) { DropFace(s, 11); }, "CAGE_NOT_CLOSED",
         "is not shared by two faces"},
        {"Fin",
         [](Shape& s) {
           s.positions.conservativeResize(9, 3);
           s.positions.row(8) << 2, 2, 2;
           AddFace(s, {s.faces(0, 0), s.faces(0, 1), 8});
         },
         "CAGE_NOT_MANIFOLD", "is shared by 3 faces: "},
        {"TwoConesAtATip",
         [](Shape& s) {
           const Shape a = Tetrahedron();
           s = Joined(a, Scaled(a, 1, {2, 0, 0}));
           for (auto& corner : s.faces.reshaped()) {
             if (corner == 4) corner = 1;
           }
         },
         "CAGE_NOT_MANIFOLD",
         "at vertex 1 parts of the cage touch in one point"},
        {"FlippedFace",
         [](Shape& s) { std::swap(s.faces(7, 0), s.faces(7, 1)); },
         "CAGE_INCONSISTENT_ORIENTATION", "run the same way along edge"},
        {"InsideOut", [](Shape& s) { s = Turned(s); }, "CAGE_INVERTED",
         "inside out: its faces point inwards"},
        {"InsideOutComponents",
         [](Shape& s) {
           s = Turned(Joined(s, Scaled(s, 1, {3, 0, 0})));
         },
         "CAGE_INVERTED", "inside out"},
        {"InsideOutWithCavity",
         [](Shape& s) { s = Turned(Joined(s, Turned(Scaled(s, 0.5)))); },
         "CAGE_INVERTED", "inside out"},
        {"OneComponentInverted",
         [](Shape& s) {
           s = Joined(s, Turned(Scaled(s, 1, {3, 0, 0})));
         },
         "CAGE_OVERLAPPING", "face 0 points outwards and face 12 inwards"},
        {"OuterComponentInverted",
         [](Shape& s) {
           s = Joined(Turned(s), Scaled(s, 1, {3, 0, 0}));
         },
         "CAGE_OVERLAPPING", "face 0 points inwards and face 12 outwards"},
        {"CavityNotInverted", [](Shape& s) { s = Joined(s, Scaled(s, 0.5)); },
         "CAGE_OVERLAPPING",
         "face 12 has not the inside on one side only: the cage winds 2 times "
         "around points behind it and 1 times"},
        {"OverlappingComponents",
         [](Shape& s) {
           s = Joined(s, Scaled(s, 1, {0.6, 0.1, 0.1}));
         },
         "CAGE_OVERLAPPING", "cross each other: the cage runs through itself"},
        // No centroid of a face tells.
        {"DentThroughTheFloor",
         [](Shape& s) {
           int64_t f = 0;
           while (s.positions.col(2)(s.faces.row(f)).sum() != 3) ++f;
           Split(s, f, {0.9, 0.8, -0.1});
         },
         "CAGE_OVERLAPPING", "cross each other: the cage runs through itself"},
        {"CoincidentComponents", [](Shape& s) { s = Joined(s, s); },
         "CAGE_OVERLAPPING", "parts of the cage overlap"},
        {"Pillow",
         [](Shape& s) {
           s.faces.resize(2, 3);
           s.faces << 0, 1, 2, 0, 2, 1;
         },
         "CAGE_OVERLAPPING", "the cage encloses no volume"},
    }),
    NameOf);

class SquareCage : public testing::TestWithParam<BadCage> {};
TEST_P(SquareCage, IsRefused) { ExpectRefused(Square(), GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    Cage, SquareCage,
    testing::ValuesIn<BadCage>({
        {"NotPlanar", [](Shape& s) { s.positions(2, 2) = 0.5; }, "NOT_PLANAR",
         "vertex 2 of a 2D cage has z = 0.5, not 0"},
        {"IndexOutOfRange", [](Shape& s) { s.faces(3, 1) = 4; },
         "INDEX_OUT_OF_RANGE", "face 3 refers to vertex 4 of 4"},
        {"CornerTwice", [](Shape& s) { s.faces(2, 1) = 2; }, "DEGENERATE_FACE",
         "face 2 has vertex 2 as two of its corners"},
        {"ZeroEdge", [](Shape& s) { s.positions.row(2) = s.positions.row(1); },
         "DEGENERATE_FACE", "face 1 has no length: its vertices 1 and 2"},
        {"Open", [](Shape& s) { DropFace(s, 3); }, "CAGE_NOT_CLOSED",
         "vertex 0 belongs to edge 0 only"},
        {"Branch",
         [](Shape& s) {
           AddFace(s, {0, 2});
           AddFace(s, {2, 0});
         },
         "CAGE_NOT_MANIFOLD", "vertex 0 belongs to 4 edges: 0, 3, 4 and 5"},
        {"TurnedEdge",
         [](Shape& s) { std::swap(s.faces(1, 0), s.faces(1, 1)); },
         "CAGE_INCONSISTENT_ORIENTATION", "edges 0 and 1 both end at vertex 1"},
        {"Clockwise", [](Shape& s) { s = Turned(s); }, "CAGE_INVERTED",
         "inside out"},
        {"HoleNotInverted", [](Shape& s) { s = Joined(s, Scaled(s, 0.5)); },
         "CAGE_OVERLAPPING", "face 4 has not the inside on one side only"},
        {"ThereAndBack",
         [](Shape& s) {
           s.faces.resize(2, 2);
           s.faces << 0, 1, 1, 0;
         },
         "CAGE_OVERLAPPING", "the cage encloses no area"},
        {"FigureOfEight",
         [](Shape& s) { s.positions.row(2).swap(s.positions.row(3)); },
         "CAGE_OVERLAPPING", "faces 1 and 3 cross each other"},
    }),
    NameOf);

TEST(Cage, RefusesAnotherDimension) {
  const auto cage = Cage::Create(4, UnitBox().positions, UnitBox().faces);
  EXPECT_EQ(DetailOf(cage.status()).reason, "BAD_DIMENSION");
  EXPECT_EQ(cage.status().message(), "dimension must be 2 or 3, not 4");
}

TEST(Cage, RefusesFacesOfTheOtherDimension) {
  const auto cage = Cage::Create(2, Square().positions, Grid2d(1).faces);
  EXPECT_EQ(DetailOf(cage.status()).reason, "BAD_DIMENSION");
  EXPECT_EQ(cage.status().message(),
            "faces of a 2D cage have 2 corners, not 3");
}

TEST(Cage, KeepsWhatItWasGiven) {
  const Shape box = UnitBox();
  const auto cage = Create(box);
  ASSERT_TRUE(cage.ok()) << cage.status();
  EXPECT_EQ(cage->dimension(), 3);
  EXPECT_EQ(cage->vertices(), box.positions);
  EXPECT_EQ(cage->faces(), box.faces);
  EXPECT_DOUBLE_EQ(cage->diagonal(), std::sqrt(3));
}

TEST(Cage, MayBeTorusComponentsOrHaveCavities) {
  const Shape box = UnitBox();
  EXPECT_EQ(Create(Torus(2, 0.5, 12, 8)).status(), absl::OkStatus());
  EXPECT_EQ(Create(Joined(box, Scaled(box, 1, {3, 0, 0}))).status(),
            absl::OkStatus());
  const Shape hollow = Joined(box, Turned(Scaled(box, 0.5)));
  EXPECT_EQ(Create(hollow).status(), absl::OkStatus());
  EXPECT_EQ(Create(Joined(hollow, Scaled(box, 0.2))).status(),
            absl::OkStatus());
  EXPECT_EQ(Create(Joined(Square(), Turned(Scaled(Square(), 0.5)))).status(),
            absl::OkStatus());
}

TEST(Cage, MayHaveVerticesThatNoFaceUses) {
  Shape box = UnitBox();
  box.positions.conservativeResize(9, 3);
  box.positions.row(8) << 4, 4, 4;
  EXPECT_EQ(Create(box).status(), absl::OkStatus());
}

TEST(Cage, MayHaveSliversAndNeedles) {
  Shape box = UnitBox();
  // Splits face 0 at a point 1e-9 from one of its sides.
  const Vec3 a = box.positions.row(box.faces(0, 0));
  const Vec3 b = box.positions.row(box.faces(0, 1));
  const Vec3 c = box.positions.row(box.faces(0, 2));
  Split(box, 0, 0.5 * (a + b) + 1e-9 * (c - b));
  EXPECT_EQ(Create(box).status(), absl::OkStatus());
}

TEST(Cage, MayBeFarAwayTinyOrHuge) {
  EXPECT_EQ(Create(Scaled(UnitBox(), 1e-2, {1e6, -1e6, 1e6})).status(),
            absl::OkStatus());
  for (const double scale : {1e-90, 1e-6, 1e6, 1e99}) {
    Shape sphere = Icosphere(1, 1);
    sphere.positions *= scale;
    EXPECT_EQ(Create(sphere).status(), absl::OkStatus()) << scale;
  }
}

TEST(Cage, TurnsAnInsideOutCageWhenAsked) {
  for (const Shape& right : {UnitBox(), Square()}) {
    const auto cage =
        Create(Turned(right), Cage::Orientation::kFlipIfInsideOut);
    ASSERT_TRUE(cage.ok()) << cage.status();
    EXPECT_EQ(cage->faces(), right.faces);
  }
}

TEST(Cage, IsNotTurnedWhenRightOrOverlapping) {
  const auto cage = Create(UnitBox(), Cage::Orientation::kFlipIfInsideOut);
  ASSERT_TRUE(cage.ok()) << cage.status();
  EXPECT_EQ(cage->faces(), UnitBox().faces);
  const Shape one_inverted =
      Joined(UnitBox(), Turned(Scaled(UnitBox(), 1, {3, 0, 0})));
  EXPECT_EQ(
      DetailOf(
          Create(one_inverted, Cage::Orientation::kFlipIfInsideOut).status())
          .reason,
      "CAGE_OVERLAPPING");
}

TEST(Cage, LargerThanThePairBudgetIsCheckedAtSomeFaces) {
  EXPECT_EQ(Create(Icosphere(1, 5)).status(), absl::OkStatus());  // 20480
  EXPECT_EQ(DetailOf(Create(Turned(Icosphere(1, 5))).status()).reason,
            "CAGE_INVERTED");
}

// Fractions of the full angle; 1e-14 allows for the rounding of some dozen
// arcs.
TEST(WindingNumber, IsOneInsideAndZeroOutside) {
  const Cage torus = CageOf(Torus(2, 0.5, 12, 8));
  EXPECT_NEAR(WindingNumber(torus, {2, 0, 0}), 1, 1e-14);
  EXPECT_NEAR(WindingNumber(torus, {0, 0, 0}), 0, 1e-14);
  EXPECT_NEAR(WindingNumber(torus, {1e5, 3, 1}), 0, 1e-14);
  const Cage ring = CageOf(Joined(Square(), Turned(Scaled(Square(), 0.5))));
  EXPECT_NEAR(WindingNumber(ring, {0.1, 0.5, 0}), 1, 1e-14);
  EXPECT_NEAR(WindingNumber(ring, {0.5, 0.5, 0}), 0, 1e-14);
  EXPECT_NEAR(WindingNumber(ring, {-3, 0.5, 0}), 0, 1e-14);
}

TEST(WindingNumber, IsTheInteriorAngleFractionOnTheBoundary) {
  const Cage box = CageOf(UnitBox());
  EXPECT_NEAR(WindingNumber(box, {0.25, 0.5, 1}), 1.0 / 2, 1e-14);
  EXPECT_NEAR(WindingNumber(box, {0.25, 0, 1}), 1.0 / 4, 1e-14);
  EXPECT_NEAR(WindingNumber(box, {1, 1, 1}), 1.0 / 8, 1e-14);
  const Cage square = CageOf(Square());
  EXPECT_NEAR(WindingNumber(square, {0.25, 0, 0}), 1.0 / 2, 1e-14);
  EXPECT_NEAR(WindingNumber(square, {1, 1, 0}), 1.0 / 4, 1e-14);
}

TEST(WindingNumber, KeepsItsDigitsNearEdgesAndVertices) {
  const Cage sphere = CageOf(Icosphere(1, 1));
  for (int64_t f = 0; f < sphere.face_count(); ++f) {
    const Vec3 a = sphere.vertices().row(sphere.faces()(f, 0));
    const Vec3 b = sphere.vertices().row(sphere.faces()(f, 1));
    for (const double t : {0.0, 1e-7, 0.3}) {
      const Vec3 on_edge = (1 - t) * a + t * b;
      for (const double distance : {1e-3, 1e-6, 1e-9}) {
        // The rounding of coordinates as seen from the point.
        const double tolerance = 1e-14 + 1e-16 / distance;
        EXPECT_NEAR(WindingNumber(sphere, on_edge * (1 - distance)), 1,
                    tolerance);
        EXPECT_NEAR(WindingNumber(sphere, on_edge * (1 + distance)), 0,
                    tolerance);
      }
    }
  }
}

}  // namespace
}  // namespace deform
