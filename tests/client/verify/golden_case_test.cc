#include "client/verify/golden_case.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/client/verify/hand_made.h"

namespace deform {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::StartsWith;

json CageCase() {
  return json::parse(R"({
    "schema": "deform-golden/1", "id": "square", "group": "gc2d.hand",
    "scheme": "GC", "dimension": 2,
    "cage": {"vertices": [["0", "0"], ["1", "0"], ["1", "1"], ["0", "1"]],
             "faces": [[0, 1], [1, 2], [2, 3], [3, 0]]},
    "options": {},
    "deformations": [
      {"name": "half", "s_mode": "blend:0.5", "s": ["1", "1", "1", "1"],
       "vertices": [["0", "0"], ["1", "0"], ["1", "1"], ["0", "1"]]}],
    "queries": [
      {"id": 4, "point": ["nan", "-inf"], "exit_face": 2,
       "error_accepted": "any", "tol_weights": "1e-11", "tol_deformed": 1e-11,
       "expected": {"phi": ["1", "0", "0", "0"], "psi": ["0", "0", "0", "0"],
                    "deformed": {"half": ["0", "0"]}}}]
  })");
}

TEST(GoldenCase, KeepsEveryNumber) {
  const GoldenCase golden = Parse(TriangleCase())->value();
  EXPECT_EQ(golden.id, "triangle");
  EXPECT_EQ(golden.scheme, "s_cc");
  EXPECT_EQ(golden.rig.kind, RigKind::kHandles);
  EXPECT_EQ(golden.rig.vertices(2, 1), 3);
  EXPECT_EQ(golden.options.lambda, 1.5);
  EXPECT_DOUBLE_EQ(golden.diagonal, std::sqrt(18));
  ASSERT_EQ(golden.queries.size(), 2u);
  EXPECT_TRUE(golden.queries[0].HasTag("inside"));
  EXPECT_EQ(golden.queries[0].vertex_weights[1], 1.0 / 3);
  EXPECT_EQ(golden.queries[0].deformed[0].second, Vec3(2, 1, 0));
  EXPECT_EQ(golden.queries[1].expected_error, "outside_hull");
}

TEST(GoldenCase, KnowsCagesBlendsAndExitFaces) {
  const GoldenCase golden = Parse(CageCase())->value();
  EXPECT_EQ(golden.scheme, "green");
  EXPECT_EQ(golden.rig.faces(3, 0), 3);
  EXPECT_EQ(golden.deformations[0].stretch_blend, 0.5);
  EXPECT_EQ(golden.queries[0].exit_face, 2);
  EXPECT_TRUE(golden.queries[0].any_error_accepted);
  EXPECT_DOUBLE_EQ(golden.diagonal, std::sqrt(2)) << "computed if not given";
}

TEST(GoldenCase, ReadsNumbersThatAreNotFinite) {
  const GoldenCase golden = Parse(CageCase())->value();
  EXPECT_TRUE(std::isnan(golden.queries[0].point.x()));
  EXPECT_EQ(golden.queries[0].point.y(),
            -std::numeric_limits<double>::infinity());
}

TEST(GoldenCase, PassesOverWhatIsNoCase) {
  EXPECT_FALSE(Parse(json::array({1, 2}))->has_value());
  EXPECT_FALSE(Parse({{"schema", "something-else"}})->has_value());
}

struct BadCase {
  const char* name;
  std::function<json()> make;
  const char* message;
};
void PrintTo(const BadCase& test, std::ostream* out) { *out << test.name; }

class GoldenCaseRefuses : public testing::TestWithParam<BadCase> {};

TEST_P(GoldenCaseRefuses, NamingFileAndField) {
  const auto golden = Parse(GetParam().make());
  ASSERT_FALSE(golden.ok());
  EXPECT_EQ(std::string(golden.status().message()),
            std::string("case.json: ") + GetParam().message);
}

// The triangle with `value` at `pointer`.
std::function<json()> With(const char* pointer, const json& value) {
  return [=] {
    json result = TriangleCase();
    result[json::json_pointer(pointer)] = value;
    return result;
  };
}
std::function<json()> CageWith(const char* pointer, const json& value) {
  return [=] {
    json result = CageCase();
    result[json::json_pointer(pointer)] = value;
    return result;
  };
}
std::function<json()> Without(const char* object, const char* key) {
  return [=] {
    json result = TriangleCase();
    result[json::json_pointer(object)].erase(key);
    return result;
  };
}

INSTANTIATE_TEST_SUITE_P(
    Cases, GoldenCaseRefuses,
    testing::ValuesIn<BadCase>({
        {"OtherSchema", With("/schema", "deform-golden/9"),
         "schema: is not \"deform-golden/1\""},
        {"NoId", Without("", "id"), "has no field 'id'"},
        {"UnknownScheme", With("/scheme", "XYZ"),
         "scheme: 'XYZ' is none of GC, MVC, TCC, SCC"},
        {"Dimension", With("/dimension", 4), "dimension: is neither 2 nor 3"},
        {"NoRig", Without("", "control_points"),
         "has no field 'control_points'"},
        {"Point", With("/control_points/1/0", "x"),
         "control_points[1][0]: 'x' is not a number"},
        {"EmptyNumber", With("/control_points/1/0", ""),
         "control_points[1][0]: '' is not a number"},
        {"SpacedNumber", With("/control_points/1/0", " 1"),
         "control_points[1][0]: ' 1' is not a number"},
        {"PointLength", With("/queries/0/point", {"1"}),
         "queries[0].point: has 1 numbers, not 2"},
        {"WeightNumber", With("/queries/0/expected/alpha/2", true),
         "queries[0].expected.alpha[2]: is not a string"},
        {"NoWeights", Without("/queries/0/expected", "alpha"),
         "queries[0].expected: has no field 'alpha'"},
        {"NoTolerance", Without("/queries/0", "tol_weights"),
         "queries[0]: has no field 'tol_weights'"},
        {"NoExpectation", Without("/queries/1", "expected"),
         "queries[1]: has no field 'expected'"},
        {"UnknownDeformation",
         With("/queries/0/expected/deformed", {{"bent", {"1", "1"}}}),
         "queries[0].expected.deformed: there is no deformation 'bent'"},
        {"DeformationRows",
         With("/deformations/0/vertices",
              json::array({json::array({"1", "0"})})),
         "deformations[0].vertices: has 1 rows, the rig has 3"},
        {"StretchMode", CageWith("/deformations/0/s_mode", "blend:x"),
         "deformations[0].s_mode: 'blend:x' is none of stretch, unit, blend:t"},
        {"StretchCount", CageWith("/deformations/0/s", {"1"}),
         "deformations[0].s: has 1 numbers, the cage has 4 faces"},
        {"FaceCorners", CageWith("/cage/faces/2", {1, 2, 3}),
         "cage.faces[2]: has 3 corners, not 2"},
        {"FaceIndex", CageWith("/cage/faces/2/1", 1.5),
         "cage.faces[2][1]: is not an index"},
        {"HugeIndex", CageWith("/cage/faces/2/1", 4294967296),
         "cage.faces[2][1]: is not an index"},
        {"NoQueries", With("/queries", json::array()), "queries: is empty"},
        {"QueriesNoList", With("/queries", 3), "queries: is not a list"},
        {"Accepted", With("/queries/0/error_accepted", {1}),
         "queries[0].error_accepted[0]: is not a string"},
    }),
    [](const auto& test) { return test.param.name; });

TEST(GoldenCase, NamesAFileThatIsNoJson) {
  EXPECT_EQ(ParseGoldenCase("{\"a\": ", "x.json").status().message(),
            "x.json: is not JSON");
}

}  // namespace
}  // namespace deform
