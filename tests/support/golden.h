// Reference weights and positions from 60-digit arithmetic: the files of
// tests/golden, one case each.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/rig.h"
#include "core/weights/scheme.h"

namespace deform {

struct GoldenDeformation {
  std::string name;
  Positions vertices;           // V x 3
  double stretch_blend = 1;     // b
  std::vector<double> stretch;  // s_b of every face; empty without normals.
  // Diagonal of the posed rig's bounding box.
  double diagonal = 0;
};

struct GoldenQuery {
  int id = 0;
  Vec3 point = Vec3::Zero();
  int32_t exit_face = -1;
  // Weights need not be compared, only positions: coincident handles.
  bool ambiguous_split = false;
  // Of vertex weights; normal weights times GoldenCase::NormalScale().
  double weight_tolerance = 0;
  // In units of the posed diagonal.
  double position_tolerance = 0;

  std::string expected_error;  // Empty: weights are expected.
  bool accepts_any_error = false;
  std::vector<std::string> accepted_errors;
  std::vector<double> vertex;  // V
  std::vector<double> normal;  // F, or empty
  std::map<std::string, Vec3> deformed;
};

struct GoldenCase {
  std::string id;
  std::string group;
  std::string scheme;  // Our id.
  int dimension = 3;
  // Refused for some of the invalid cases.
  absl::StatusOr<Rig> rig;
  SchemeOptions options;
  double diagonal = 0;
  std::vector<GoldenDeformation> deformations;
  std::vector<GoldenQuery> queries;

  // The unit of the tolerance of normal weights: they are lengths and in 2D
  // contain the logarithm of one.
  double NormalScale() const;
};

// Groups of all cases, in order, with their files.
std::map<std::string, std::vector<std::string>> GoldenGroups();

// Ends the program if the file cannot be read.
GoldenCase ReadGolden(const std::string& file);

}  // namespace deform
