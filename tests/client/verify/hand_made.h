// A small case whose weights are known without computing: a point in the middle
// of a triangle with handles at its corners (any convex scheme gives thirds).
#pragma once

#include <nlohmann/json.hpp>

#include "client/verify/golden_case.h"

namespace deform {

inline nlohmann::json TriangleCase() {
  return nlohmann::json::parse(R"({
    "schema": "deform-golden/1", "id": "triangle", "group": "scc.hand",
    "scheme": "SCC", "dimension": 2, "bbox_diagonal": "4.2426406871192848",
    "control_points": [["0", "0"], ["3", "0"], ["0", "3"]],
    "options": {"lambda": "1.5"},
    "deformations": [
      {"name": "moved", "vertices": [["1", "0"], ["4", "0"], ["1", "3"]]}],
    "queries": [
      {"id": 0, "point": ["1", "1"], "class": "interior", "tags": ["inside"],
       "tol_weights": "1e-11", "tol_deformed": "1e-11",
       "expected": {
         "alpha": ["0.33333333333333333", "0.33333333333333333",
                   "0.33333333333333333"],
         "deformed": {"moved": ["2", "1"]}}},
      {"id": 1, "point": ["7", "7"], "class": "outside_hull",
       "expected": {"error": "outside_hull"}}]
  })");
}

inline absl::StatusOr<std::optional<GoldenCase>> Parse(
    const nlohmann::json& json) {
  const std::string text = json.dump();
  return ParseGoldenCase(text, "case.json");
}

}  // namespace deform
