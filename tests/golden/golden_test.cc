// Every case of tests/golden against the schemes, from the rig to positions.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_replace.h"
#include "core/base/error.h"
#include "core/deform/columns.h"
#include "core/deform/deformer.h"
#include "core/weights/binding.h"
#include "tests/support/golden.h"

namespace deform {
namespace {

class Golden : public testing::TestWithParam<std::string> {
 protected:
  std::vector<GoldenCase> Cases() const {
    std::vector<GoldenCase> cases;
    const auto groups = GoldenGroups();
    for (const std::string& file : groups.at(GetParam())) {
      cases.push_back(ReadGolden(file));
    }
    return cases;
  }
};

absl::StatusOr<std::shared_ptr<const Binding>> BindQueries(
    const GoldenCase& golden) {
  if (!golden.rig.ok()) return golden.rig.status();
  Positions points(golden.queries.size(), 3);
  ExitRegions exits;
  for (size_t i = 0; i < golden.queries.size(); ++i) {
    points.row(i) = golden.queries[i].point;
    exits.face_of_point.push_back(golden.queries[i].exit_face);
  }
  if (std::holds_alternative<Cage>(*golden.rig)) {
    exits.kind = ExitRegions::Kind::kPerPoint;
  }
  absl::StatusOr<Mesh> model =
      Mesh::Create(golden.dimension, std::move(points), Faces(0, 3));
  if (!model.ok()) return model.status();
  return Bind({.model = std::make_shared<const Mesh>(*std::move(model)),
               .rig = *golden.rig,
               .scheme = golden.scheme,
               .options = golden.options,
               .exits = exits,
               .unbindable = Unbindable::kReport},
              {});
}

// What the files call the reason why a point is not bound; empty if it is.
std::string ErrorOf(const Binding& binding, int64_t point) {
  for (const UnboundPoints& group : binding.unbound()) {
    if (!std::count(group.points.begin(), group.points.end(), point)) continue;
    return group.reason == "NOT_CONVERGED"
               ? "no_convergence"
               : absl::AsciiStrToLower(group.reason);
  }
  return "";
}

// Whether weights of the query are to be compared; otherwise checks that the
// error, or its absence, is as the file says.
bool CheckError(const GoldenQuery& query, const std::string& error) {
  if (!query.expected_error.empty()) {
    EXPECT_NE(error, "") << "expected " << query.expected_error;
    if (!query.accepts_any_error && error != query.expected_error) {
      EXPECT_THAT(query.accepted_errors, testing::Contains(error));
    }
    return false;
  }
  if (error.empty()) return true;
  EXPECT_THAT(query.accepted_errors, testing::Contains(error));
  return false;
}

// Largest |actual - expected| as a fraction of `tolerance`. Not a number counts
// as infinitely wrong.
double Excess(const Eigen::RowVectorXd& actual,
              const std::vector<double>& expected, double tolerance) {
  EXPECT_EQ(actual.size(), static_cast<int64_t>(expected.size()));
  double excess = 0;
  for (int64_t k = 0; k < actual.size(); ++k) {
    const double error = std::abs(actual[k] - expected[k]) / tolerance;
    excess = error <= excess ? excess : std::isnan(error) ? HUGE_VAL : error;
  }
  return excess;
}

// The unit of position tolerances: coordinates far from the origin are coarse
// themselves.
double PositionScale(const GoldenDeformation& deformation, const Vec3& at) {
  return std::max(deformation.diagonal, 1e-3 * at.cwiseAbs().maxCoeff());
}

// Displacement form of [L08] Eq. 9 in double.
Vec3 Deform(const Vec3& eta, const Eigen::RowVectorXd& vertex,
            const Eigen::RowVectorXd& normal, const PosedColumns& posed,
            const Columns& columns) {
  const Columns moved = columns - posed.rest();
  Vec3 x = eta + (vertex * moved.topRows(vertex.size())).transpose();
  if (normal.size() > 0) {
    x += (normal * moved.bottomRows(normal.size())).transpose();
  }
  return x;
}

TEST_P(Golden, WeightsAreWithinTheirTolerance) {
  double worst = 0;
  for (const GoldenCase& golden : Cases()) {
    SCOPED_TRACE(golden.id);
    const auto binding = BindQueries(golden);
    ASSERT_TRUE(binding.ok()) << binding.status();
    const auto weights = RecomputeWeights(**binding, 0, golden.queries.size());
    ASSERT_TRUE(weights.ok()) << weights.status();
    for (size_t i = 0; i < golden.queries.size(); ++i) {
      const GoldenQuery& query = golden.queries[i];
      SCOPED_TRACE(query.id);
      if (!CheckError(query, ErrorOf(**binding, i))) continue;
      if (query.ambiguous_split) continue;
      const double excess = std::max(
          Excess(weights->vertex.row(i), query.vertex, query.weight_tolerance),
          Excess(weights->normal.row(i), query.normal,
                 query.weight_tolerance * golden.NormalScale()));
      EXPECT_LE(excess, 1) << "times the tolerance " << query.weight_tolerance;
      worst = std::max(worst, excess);
    }
  }
  RecordProperty("largest_error_by_tolerance", std::to_string(worst));
}

TEST_P(Golden, PositionsInDoubleAreWithinTheirTolerance) {
  double worst = 0;
  for (const GoldenCase& golden : Cases()) {
    SCOPED_TRACE(golden.id);
    const auto binding = BindQueries(golden);
    ASSERT_TRUE(binding.ok()) << binding.status();
    const auto weights = RecomputeWeights(**binding, 0, golden.queries.size());
    const PosedColumns posed(*golden.rig, (*binding)->normal_count() > 0);
    for (const GoldenDeformation& deformation : golden.deformations) {
      SCOPED_TRACE(deformation.name);
      Columns columns = posed.rest();
      posed.UpdateAll({deformation.vertices, deformation.stretch_blend},
                      columns);
      for (size_t i = 0; i < golden.queries.size(); ++i) {
        const GoldenQuery& query = golden.queries[i];
        const auto expected = query.deformed.find(deformation.name);
        if (expected == query.deformed.end()) continue;
        if (!ErrorOf(**binding, i).empty()) continue;
        SCOPED_TRACE(query.id);
        const Vec3 x = Deform(query.point, weights->vertex.row(i),
                              weights->normal.row(i), posed, columns);
        const double error = (x - expected->second).cwiseAbs().maxCoeff() /
                             PositionScale(deformation, expected->second);
        EXPECT_LE(error, query.position_tolerance);
        worst = std::max(worst, error / query.position_tolerance);
      }
    }
  }
  RecordProperty("largest_error_by_tolerance", std::to_string(worst));
}

TEST_P(Golden, PositionsFromTheCachedWeightsAreWithinFloat) {
  for (const GoldenCase& golden : Cases()) {
    SCOPED_TRACE(golden.id);
    const auto binding = BindQueries(golden);
    ASSERT_TRUE(binding.ok()) << binding.status();
    const auto weights = RecomputeWeights(**binding, 0, golden.queries.size());
    for (const GoldenDeformation& deformation : golden.deformations) {
      SCOPED_TRACE(deformation.name);
      Deformer deformer(*binding, nullptr);
      deformer.MoveTo({deformation.vertices, deformation.stretch_blend});
      const Positions positions = deformer.positions();
      for (size_t i = 0; i < golden.queries.size(); ++i) {
        const GoldenQuery& query = golden.queries[i];
        const auto expected = query.deformed.find(deformation.name);
        if (expected == query.deformed.end()) continue;
        if (!ErrorOf(**binding, i).empty()) continue;
        SCOPED_TRACE(query.id);
        const double sum = weights->vertex.row(i).cwiseAbs().sum();
        const double error = (positions.row(i).transpose() - expected->second)
                                 .cwiseAbs()
                                 .maxCoeff() /
                             PositionScale(deformation, expected->second);
        // Rounding weights to float costs up to 6e-8 of each, on top of what
        // the weights in double may lose.
        EXPECT_LE(error,
                  1e-6 * std::max(1.0, sum / 10) + query.position_tolerance);
      }
    }
  }
}

class GoldenWithNormals : public Golden {};

TEST_P(GoldenWithNormals, StretchesAreThoseOfThePaper) {
  for (const GoldenCase& golden : Cases()) {
    SCOPED_TRACE(golden.id);
    const PosedColumns posed(*golden.rig, true);
    for (const GoldenDeformation& deformation : golden.deformations) {
      if (deformation.stretch.empty()) continue;
      SCOPED_TRACE(deformation.name);
      Columns columns = posed.rest();
      posed.UpdateAll({deformation.vertices, deformation.stretch_blend},
                      columns);
      for (size_t f = 0; f < deformation.stretch.size(); ++f) {
        const int64_t column = deformation.vertices.rows() + f;
        // Thin faces, of an aspect up to 4e6, lose five digits.
        EXPECT_NEAR(columns.row(column).norm(), deformation.stretch[f],
                    1e-10 * deformation.stretch[f])
            << "face " << f;
      }
    }
  }
}

TEST(GoldenInvalid, InputsAreRefusedWithAReason) {
  const auto groups = GoldenGroups();
  for (const std::string& file : groups.at("invalid")) {
    SCOPED_TRACE(file);
    const GoldenCase golden = ReadGolden(file);
    const absl::Status status = BindQueries(golden).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    EXPECT_NE(DetailOf(status).reason, "");
    EXPECT_NE(status.message(), "");
  }
}

// Valid groups whose name starts with `prefix`.
std::vector<std::string> Groups(const std::string& prefix) {
  std::vector<std::string> names;
  const auto groups = GoldenGroups();
  for (const auto& [name, files] : groups) {
    if (name != "invalid" && name.rfind(prefix, 0) == 0) names.push_back(name);
  }
  return names;
}

std::string TestName(const testing::TestParamInfo<std::string>& group) {
  return absl::StrReplaceAll(group.param, {{".", "_"}});
}

INSTANTIATE_TEST_SUITE_P(Group, Golden, testing::ValuesIn(Groups("")),
                         TestName);
INSTANTIATE_TEST_SUITE_P(Group, GoldenWithNormals,
                         testing::ValuesIn(Groups("gc")), TestName);

}  // namespace
}  // namespace deform
