// Generated models with rigs to pose them by: for demonstrations and figures,
// wherever a model of one's own is not at hand.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/types.h"

namespace deform {

struct GeneratedShape {
  int dimension = 3;
  Positions positions;
  Faces faces;  // Closed and outward in 3D, counter-clockwise in 2D.
  // A cage around it, its corners 2 in 2D. Empty where one is better made from
  // the model (MakeCage).
  Positions cage;
  Faces cage_faces;
  // Free control points whose hull contains the model.
  Positions handles;
};

// "organ"   a heart-like surface among 35 handles, eight of them the corners of
//           1.6 times its box
// "bar"     along z, with a cage of five levels, whose vertices are its handles
// "torus"   around z, with a coarse torus as cage and the corners of a box, and
//           a ring of points inside, as handles
// "plate"   2D: a square that fills its cage, three vertices to a side
// "angle"   2D: an L that fills its cage, likewise
const std::vector<std::string>& ShapeNames();

// About `points` points, 100 to 1,000,000. NotFound UNKNOWN_SHAPE,
// InvalidArgument INVALID_OPTION.
absl::StatusOr<GeneratedShape> GenerateShape(const std::string& name,
                                             int64_t points);

}  // namespace deform
