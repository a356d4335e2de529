// Compares what a server computed with what a reference case expects.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "client/verify/golden_case.h"

namespace deform {

// What became of a query.
struct QueryResult {
  // Reason in lower case ("outside_hull"), or empty. Nothing else is set if an
  // error came.
  std::string error;
  std::vector<double> vertex_weights;  // Recomputed in double.
  std::vector<double> normal_weights;
  // sum phi v + sum psi n - eta from these weights, model units.
  Vec3 reproduction_error = Vec3::Zero();
  // By deformation: from these weights, in double; and as a frame told it.
  std::vector<Vec3> deformed;
  std::vector<Vec3> streamed;
};

// What became of a case.
struct CaseResult {
  std::vector<QueryResult> queries;  // As the case orders them.
  // By deformation: blended stretch per face; empty if nothing was bound.
  std::vector<std::vector<double>> stretch;
};

// Something that is wrong.
struct VerifyFailure {
  std::string group;
  std::string case_id;
  int64_t query = -1;  // -1: the whole case.
  std::string message;
  std::vector<std::string> tags;
};

// Largest errors of a group. In units of the tolerances of the case files:
// weights absolute, psi of PsiScale(), positions of the deformed diagonal.
struct GroupReport {
  int64_t cases = 0;
  int64_t queries = 0;
  int64_t errors_as_expected = 0;
  // Of these: reported under another name than expected.
  int64_t errors_named_otherwise = 0;
  double weight_error = 0;
  double psi_error = 0;
  double reproduction_error = 0;
  double deformed_error = 0;
  double streamed_error = 0;
  double worst_ratio = 0;  // Error by tolerance.
  int64_t failures = 0;
};

struct VerifyReport {
  std::map<std::string, GroupReport> groups;
  std::vector<VerifyFailure> failures;

  void Fail(const GoldenCase& golden, int64_t query, std::string message,
            std::vector<std::string> tags = {});
};

// Unit of psi's tolerance: the rest diagonal, in 2D times 1 + |log D|.
double PsiScale(const GoldenCase& golden);

// Unit of a position's tolerance: the diagonal of the deformed rig, or a
// thousandth of the largest coordinate, where rounding of the coordinates
// themselves weighs more.
double PositionScale(const Positions& rig, const Vec3& position);

// What streamed float positions may be off, in units of PositionScale(): 1e-6,
// more where weights are large, and never less than the reference's own
// tolerance.
double StreamedTolerance(const GoldenQuery& query);

// Compares one query and adds to the report.
//   An expected error must come; any will do, another name is noted.
//   An error instead of a result must be among the accepted ones.
//   Weights and psi are compared one by one, except where coincident handles
//     leave their split open (tag ambiguous_split).
//   sum phi v + sum psi n must give the point back, where the case says it does
//     (not for raw exterior points).
//   Positions are compared in double and as streamed.
void JudgeQuery(const GoldenCase& golden, const GoldenQuery& query,
                const QueryResult& result, VerifyReport& report);

// Compares all queries of a case, and the stretch factors with those of the
// file: relative to 1 or themselves, within the case's largest weight
// tolerance.
void JudgeCase(const GoldenCase& golden, const CaseResult& result,
               VerifyReport& report);

}  // namespace deform
