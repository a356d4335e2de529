#include "client/verify/judge.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

// 1e-6 D for weights rounded to float and summed in float; larger weights lose
// more.
constexpr double kStreamed = 1e-6;
constexpr double kOrdinaryWeightSum = 10;

// The errors of one query, with the worst by its tolerance.
class Errors {
 public:
  // Raises `largest` to `error`; NaN counts as infinite.
  void Add(double error, double tolerance, const std::string& what,
           double& largest) {
    if (std::isnan(error)) error = std::numeric_limits<double>::infinity();
    largest = std::max(largest, error);
    const double ratio = error == 0 ? 0 : error / tolerance;
    if (!(ratio <= worst_)) {
      worst_ = ratio;
      what_ = absl::StrFormat("%s is off by %.3g, %.3g x the tolerance %.3g",
                              what, error, ratio, tolerance);
    }
  }
  double worst() const { return worst_; }
  const std::string& what() const { return what_; }

 private:
  double worst_ = 0;
  std::string what_;
};

double SumOfMagnitudes(const std::vector<double>& weights) {
  double sum = 0;
  for (const double weight : weights) sum += std::abs(weight);
  return sum;
}

// True if the error, or its lack, settles the query.
bool JudgeError(const GoldenCase& golden, const GoldenQuery& query,
                const std::string& error, VerifyReport& report) {
  GroupReport& group = report.groups[golden.group];
  const bool accepted =
      query.any_error_accepted ||
      std::find(query.accepted_errors.begin(), query.accepted_errors.end(),
                error) != query.accepted_errors.end();
  if (!query.expected_error.empty()) {
    if (error.empty()) {
      report.Fail(golden, query.id,
                  absl::StrCat("expected error ", query.expected_error,
                               ", got a result"),
                  query.tags);
      return true;
    }
    ++group.errors_as_expected;
    if (error != query.expected_error && !accepted) {
      ++group.errors_named_otherwise;
    }
    return true;
  }
  if (error.empty()) return false;
  if (accepted) {
    ++group.errors_as_expected;
  } else {
    report.Fail(golden, query.id, absl::StrCat("unexpected error ", error),
                query.tags);
  }
  return true;
}

// Whether the expected weights give the point back: not those of a raw exterior
// point, which sum to 0.
bool Reproduces(const GoldenQuery& query) {
  double sum = 0;
  for (const double weight : query.vertex_weights) sum += weight;
  return sum > 0.5;
}

void JudgeWeights(const GoldenCase& golden, const GoldenQuery& query,
                  const QueryResult& result, GroupReport& group,
                  Errors& errors) {
  if (!query.HasTag("ambiguous_split")) {
    for (size_t k = 0; k < query.vertex_weights.size(); ++k) {
      errors.Add(std::abs(result.vertex_weights[k] - query.vertex_weights[k]),
                 query.weight_tolerance, absl::StrCat("vertex weight ", k),
                 group.weight_error);
    }
    for (size_t j = 0; j < query.normal_weights.size(); ++j) {
      errors.Add(std::abs(result.normal_weights[j] - query.normal_weights[j]) /
                     PsiScale(golden),
                 query.weight_tolerance, absl::StrCat("normal weight ", j),
                 group.psi_error);
    }
  }
  if (Reproduces(query)) {
    errors.Add(result.reproduction_error.norm() /
                   PositionScale(golden.rig.vertices, query.point),
               query.deformed_tolerance, "the reproduced point",
               group.reproduction_error);
  }
}

void JudgePositions(const GoldenCase& golden, const GoldenQuery& query,
                    const QueryResult& result, GroupReport& group,
                    Errors& errors) {
  for (const auto& [index, expected] : query.deformed) {
    const GoldenDeformation& deformation = golden.deformations[index];
    const double scale = PositionScale(deformation.vertices, expected);
    for (int k = 0; k < golden.dimension; ++k) {
      errors.Add(std::abs(result.deformed[index][k] - expected[k]) / scale,
                 query.deformed_tolerance,
                 absl::StrCat("position in ", deformation.name),
                 group.deformed_error);
      errors.Add(std::abs(result.streamed[index][k] - expected[k]) / scale,
                 StreamedTolerance(query),
                 absl::StrCat("streamed position in ", deformation.name),
                 group.streamed_error);
    }
  }
}

bool HasAllNumbers(const GoldenCase& golden, const GoldenQuery& query,
                   const QueryResult& result) {
  return result.vertex_weights.size() == query.vertex_weights.size() &&
         result.normal_weights.size() == query.normal_weights.size() &&
         static_cast<int64_t>(result.vertex_weights.size()) ==
             golden.rig.vertices.rows() &&
         result.deformed.size() == golden.deformations.size() &&
         result.streamed.size() == golden.deformations.size();
}

void JudgeStretch(const GoldenCase& golden,
                  const GoldenDeformation& deformation,
                  const std::vector<double>& stretch, VerifyReport& report) {
  if (stretch.empty()) return;  // A scheme without normals.
  double tolerance = 0;
  for (const GoldenQuery& query : golden.queries) {
    tolerance = std::max(tolerance, query.weight_tolerance);
  }
  for (size_t f = 0; f < deformation.stretch.size(); ++f) {
    const double expected = deformation.stretch[f];
    const double error =
        std::abs(stretch[f] - expected) / std::max(1.0, std::abs(expected));
    if (error <= tolerance) continue;
    report.Fail(
        golden, -1,
        absl::StrFormat("stretch of face %d in %s is %.17g, expected "
                        "%.17g (tolerance %.3g)",
                        f, deformation.name, stretch[f], expected, tolerance));
  }
}

}  // namespace

void VerifyReport::Fail(const GoldenCase& golden, int64_t query,
                        std::string message, std::vector<std::string> tags) {
  ++groups[golden.group].failures;
  failures.push_back(
      {golden.group, golden.id, query, std::move(message), std::move(tags)});
}

double PsiScale(const GoldenCase& golden) {
  const double diagonal = golden.diagonal;
  if (golden.dimension == 3) return diagonal;
  return diagonal * (1 + std::abs(std::log(diagonal)));
}

double PositionScale(const Positions& rig, const Vec3& position) {
  return std::max(BoxOf(rig).diagonal(), 1e-3 * position.cwiseAbs().maxCoeff());
}

double StreamedTolerance(const GoldenQuery& query) {
  const double sum = SumOfMagnitudes(query.vertex_weights);
  return std::max(kStreamed * std::max(1.0, sum / kOrdinaryWeightSum),
                  query.deformed_tolerance);
}

void JudgeQuery(const GoldenCase& golden, const GoldenQuery& query,
                const QueryResult& result, VerifyReport& report) {
  GroupReport& group = report.groups[golden.group];
  ++group.queries;
  if (JudgeError(golden, query, result.error, report)) return;
  if (!HasAllNumbers(golden, query, result)) {
    report.Fail(
        golden, query.id,
        absl::StrCat("got ", result.vertex_weights.size(), " vertex and ",
                     result.normal_weights.size(), " normal weights, expected ",
                     query.vertex_weights.size(), " and ",
                     query.normal_weights.size()),
        query.tags);
    return;
  }
  Errors errors;
  JudgeWeights(golden, query, result, group, errors);
  JudgePositions(golden, query, result, group, errors);
  group.worst_ratio = std::max(group.worst_ratio, errors.worst());
  if (!(errors.worst() <= 1)) {
    report.Fail(golden, query.id, errors.what(), query.tags);
  }
}

void JudgeCase(const GoldenCase& golden, const CaseResult& result,
               VerifyReport& report) {
  ++report.groups[golden.group].cases;
  for (size_t i = 0; i < golden.queries.size(); ++i) {
    JudgeQuery(golden, golden.queries[i], result.queries[i], report);
  }
  for (size_t d = 0; d < result.stretch.size(); ++d) {
    JudgeStretch(golden, golden.deformations[d], result.stretch[d], report);
  }
}

}  // namespace deform
