// Makes a cage for a model that came without one.
#pragma once

#include "absl/status/statusor.h"
#include "core/mesh/cage.h"
#include "core/mesh/mesh.h"

namespace deform {

struct CageMakingOptions {
  // Faces to aim at: triangles, in 2D edges. Shapes that need more to be
  // enclosed get more. 0 means 200, in 2D 40.
  int target_faces = 0;
  // Distance of the surface that the cage is cut from, in diagonals of the
  // model. A larger one makes a simpler, looser cage.
  double margin = 0.04;
};

// A closed cage that follows the shape of the model: open surfaces and point
// sets are wrapped, hollows filled; in 2D loops, also around holes that are
// wider than the margin. Every model point is inside, at least about
// a quarter of the margin away from the cage, and the cage does not run through
// itself. If that takes more faces than twice the target, the margin is widened
// step by step up to threefold. Seconds for 200,000 triangles.
//
// Refuses INVALID_OPTION (target_faces outside 8 to 20000, margin outside 0.01
// to 1) and MODEL_WITHOUT_EXTENT (a single place);
// FailedPrecondition NO_CAGE_FOUND if no attempt succeeds: more faces or
// another margin may help.
absl::StatusOr<Cage> MakeCage(const Mesh& model,
                              const CageMakingOptions& options);

}  // namespace deform
