#include "core/files/loops.h"

#include <string>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/mesh/cage.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

// Loops in each other, every one counter-clockwise.
Shape Nested() {
  const Shape outer = RegularLoop2d(4, 12);
  return Joined(
      Joined(outer, RegularLoop2d(2, 9)),
      Joined(RegularLoop2d(1, 5), Scaled(RegularLoop2d(1, 6), 1, {9, 0, 0})));
}

TEST(OrientLoops, MakesCagesOfNestedLoops) {
  const Shape nested = Nested();
  const auto edges = OrientLoops(nested.positions, nested.faces);
  ASSERT_TRUE(edges.ok()) << edges.status();
  EXPECT_EQ(edges->topRows(12), nested.faces.topRows(12));
  EXPECT_EQ(edges->middleRows(12, 9),
            nested.faces.middleRows(12, 9).rowwise().reverse());
  EXPECT_EQ(edges->bottomRows(11), nested.faces.bottomRows(11));
  EXPECT_EQ(Cage::Create(2, nested.positions, *edges).status(),
            absl::OkStatus());
}

TEST(OrientLoops, TurnsSingleEdgesAndWholeLoops) {
  Shape nested = Nested();
  const Faces expected = *OrientLoops(nested.positions, nested.faces);
  EXPECT_EQ(*OrientLoops(nested.positions, Turned(nested).faces), expected);
  for (const int64_t e : {0, 3, 14, 20, 31}) {
    std::swap(nested.faces(e, 0), nested.faces(e, 1));
  }
  EXPECT_EQ(*OrientLoops(nested.positions, nested.faces), expected);
}

TEST(OrientLoops, RefusesWhatIsNoLoop) {
  const auto refuse = [](const Faces& edges, const std::string& reason,
                         const std::string& message) {
    const auto turned = OrientLoops(Grid2d(1).positions, edges);
    EXPECT_EQ(DetailOf(turned.status()).reason, reason);
    EXPECT_EQ(turned.status().message(), message);
  };
  Faces edges(2, 2);
  edges << 0, 1, 1, 4;
  refuse(edges, "INDEX_OUT_OF_RANGE", "face 1 refers to vertex 4 of 4");
  edges << 0, 1, 1, 1;
  refuse(edges, "DEGENERATE_FACE", "face 1 has vertex 1 as two of its corners");
  edges << 0, 1, 1, 2;
  refuse(edges, "CAGE_NOT_CLOSED",
         "vertex 0 belongs to edge 0 only: the loop is not closed there");
  Faces star(3, 2);
  star << 0, 1, 0, 2, 3, 0;
  refuse(star, "CAGE_NOT_MANIFOLD", "vertex 0 belongs to 3 edges: 0, 1 and 2");
}

}  // namespace
}  // namespace deform
