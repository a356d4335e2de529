// Reference cases, schema "deform-golden/1": a rig, points, and what weights
// and deformed positions they must have.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "client/cpp/arrays.h"
#include "core/mesh/types.h"

namespace deform {

// A pose of the rig.
struct GoldenDeformation {
  std::string name;
  Positions vertices;  // V x 3.
  double stretch_blend = 1;
  std::vector<double> stretch;  // s_j blended, one per face; may be empty.
};

// A point, and what is expected of it: an error or a result.
struct GoldenQuery {
  int64_t id = 0;
  Vec3 point = Vec3::Zero();
  std::optional<int32_t> exit_face;
  std::vector<std::string> tags;

  std::string expected_error;  // Empty: a result is expected.
  // Errors that may come instead of a result.
  bool any_error_accepted = false;
  std::vector<std::string> accepted_errors;

  double weight_tolerance = 0;         // Absolute; psi: see PsiScale().
  double deformed_tolerance = 0;       // In units of the deformed diagonal.
  std::vector<double> vertex_weights;  // phi, lambda or alpha.
  std::vector<double> normal_weights;  // psi; empty without normals.
  // By index of the deformation.
  std::vector<std::pair<int, Vec3>> deformed;

  bool HasTag(absl::string_view tag) const;
};

struct GoldenCase {
  std::string file;
  std::string id;
  std::string group;
  std::string scheme;  // As the server calls it: "green".
  int dimension = 3;
  double diagonal = 0;  // Of the rest rig's bounding box.
  RigArrays rig;
  SchemeOptions options;
  std::vector<GoldenDeformation> deformations;
  std::vector<GoldenQuery> queries;

  bool uses_normals() const { return scheme == "green"; }
};

// Reads a case; numbers are decimal strings or JSON numbers, not finite ones
// ("nan", "inf") included. nullopt if the text is JSON but no case: a list, or
// an object of another schema. InvalidArgument (BAD_CASE) names file and field:
// "a.json: queries[3].expected.phi[2]: 'x' is not a number".
absl::StatusOr<std::optional<GoldenCase>> ParseGoldenCase(
    absl::string_view text, absl::string_view file);

}  // namespace deform
