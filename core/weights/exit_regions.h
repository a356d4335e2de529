// Which exit face each outside point of a model belongs to ([L08] section 4.2).
//
// The exterior of a cage is cut into parts with one exit face each; what must
// be smooth is the map on the model. So for a mesh a connected component of its
// outside part belongs, as a whole, to the face through which it leaves the
// cage; a point set has no connectivity and takes the nearest face.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/cage.h"
#include "core/mesh/mesh.h"
#include "core/weights/scheme.h"

namespace deform {

struct ExitRegions {
  enum class Kind { kNone, kAutomatic, kFaces, kPerPoint };
  Kind kind = Kind::kNone;
  std::vector<int32_t> faces;          // kFaces: the allowed ones.
  std::vector<int32_t> face_of_point;  // kPerPoint: N entries, -1 for none.
};

// A connected part of the model outside the cage, with its exit face.
struct ExitPart {
  int32_t exit_face = -1;
  std::vector<int64_t> points;  // Sorted.
  // Other faces that edges of the part cross, sorted. The map is smooth across
  // them only while they move by the same similarity as the exit face.
  std::vector<int32_t> crossed_faces;
};

// Outside points that no exit face serves.
struct UnboundPoints {
  std::string
      reason;  // EXTERIOR_NO_EXIT_FACE, EXIT_AMBIGUOUS, OUTSIDE_HULL, ...
  std::string detail;           // For people: the cause, or what to do.
  std::vector<int64_t> points;  // Sorted.
};

struct ExitAssignment {
  std::vector<ExitPart> parts;
  std::vector<UnboundPoints> unbound;
};

// Refuses regions that do not fit the cage or model: EXIT_FACE_OUT_OF_RANGE,
// WRONG_LENGTH (per point), NO_EXIT_FACES (an empty list).
absl::Status CheckExitRegions(const ExitRegions& regions, const Cage& cage,
                              int64_t points);

// Assigns the points whose state is kOutside. `regions` is right. Reasons:
//   EXTERIOR_NO_EXIT_FACE  no regions, or -1 for this point, or its part leaves
//                          through none of the faces, or floats free
//   EXIT_AMBIGUOUS         its part leaves through two of the named faces, or
//                          (automatic) through faces that do not touch
ExitAssignment AssignExitFaces(const Mesh& model, const Cage& cage,
                               std::span<const PointState> states,
                               const ExitRegions& regions);

}  // namespace deform
