#include "client/verify/judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/client/verify/hand_made.h"

namespace deform {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class JudgeTest : public testing::Test {
 protected:
  JudgeTest() : golden_(Parse(TriangleCase())->value()) {
    right_.vertex_weights = {1.0 / 3, 1.0 / 3, 1.0 / 3};
    right_.deformed = {Vec3(2, 1, 0)};
    right_.streamed = right_.deformed;
  }

  // The report on `result` as the answer to the first query.
  VerifyReport Judge(const QueryResult& result) {
    VerifyReport report;
    JudgeQuery(golden_, golden_.queries[0], result, report);
    return report;
  }
  std::string Failure(const QueryResult& result) {
    const VerifyReport report = Judge(result);
    return report.failures.empty() ? "" : report.failures[0].message;
  }

  GoldenCase golden_;
  QueryResult right_;
};

TEST_F(JudgeTest, PassesTheRightAnswer) {
  const VerifyReport report = Judge(right_);
  EXPECT_THAT(report.failures, IsEmpty());
  EXPECT_EQ(report.groups.at("scc.hand").queries, 1);
  EXPECT_LT(report.groups.at("scc.hand").worst_ratio, 1e-4);
}

TEST_F(JudgeTest, FailsAWrongWeight) {
  right_.vertex_weights[1] += 2e-11;
  EXPECT_THAT(Failure(right_), HasSubstr("vertex weight 1 is off by 2e-11"));
  right_.vertex_weights[1] -= 1.5e-11;
  EXPECT_EQ(Failure(right_), "");
}

TEST_F(JudgeTest, TellsTheLargestErrorAndItsRatio) {
  right_.vertex_weights[1] += 2e-11;
  const GroupReport group = Judge(right_).groups.at("scc.hand");
  EXPECT_NEAR(group.weight_error, 2e-11, 1e-15);
  EXPECT_NEAR(group.worst_ratio, 2, 1e-4);
  EXPECT_EQ(group.failures, 1);
}

TEST_F(JudgeTest, FailsWeightsThatAreNotFinite) {
  right_.vertex_weights[2] = std::nan("");
  EXPECT_THAT(Failure(right_), HasSubstr("vertex weight 2 is off by inf"));
}

TEST_F(JudgeTest, FailsAMissingWeight) {
  right_.vertex_weights.pop_back();
  EXPECT_THAT(Failure(right_), HasSubstr("got 2 vertex and 0 normal weights"));
}

TEST_F(JudgeTest, FailsAPositionThatIsOffInDouble) {
  right_.deformed[0].x() += 1e-10;
  EXPECT_THAT(Failure(right_),
              HasSubstr("position in moved is off by 2.36e-11"));
}

TEST_F(JudgeTest, FailsAStreamedPositionOnlyBeyondFloat) {
  right_.streamed[0].x() += 3e-6;  // 7e-7 D
  EXPECT_EQ(Failure(right_), "");
  right_.streamed[0].x() += 3e-6;
  EXPECT_THAT(Failure(right_), HasSubstr("streamed position in moved is off"));
}

TEST_F(JudgeTest, FailsWeightsThatDoNotReproduceThePoint) {
  right_.reproduction_error = Vec3(0, 1e-9, 0);
  EXPECT_THAT(Failure(right_), HasSubstr("the reproduced point is off"));
}

TEST_F(JudgeTest, DoesNotAskRawExteriorPointsToReproduce) {
  golden_.queries[0].vertex_weights = {0.5, -0.25, -0.25};
  right_.vertex_weights = golden_.queries[0].vertex_weights;
  right_.reproduction_error = Vec3(1, 1, 0);
  EXPECT_EQ(Failure(right_), "");
}

TEST_F(JudgeTest, LeavesAnAmbiguousSplitOpen) {
  right_.vertex_weights = {0.5, 0, 0.5};
  EXPECT_NE(Failure(right_), "");
  golden_.queries[0].tags = {"ambiguous_split"};
  EXPECT_EQ(Failure(right_), "");
}

TEST_F(JudgeTest, FailsAnErrorThatIsNotAccepted) {
  const QueryResult refused{.error = "outside_hull"};
  EXPECT_EQ(Failure(refused), "unexpected error outside_hull");
  golden_.queries[0].accepted_errors = {"hull_boundary"};
  EXPECT_EQ(Failure(refused), "unexpected error outside_hull");
  golden_.queries[0].accepted_errors = {"hull_boundary", "outside_hull"};
  EXPECT_EQ(Failure(refused), "");
  golden_.queries[0].accepted_errors.clear();
  golden_.queries[0].any_error_accepted = true;
  EXPECT_EQ(Failure(refused), "");
}

TEST_F(JudgeTest, WantsAnExpectedErrorUnderAnyName) {
  VerifyReport report;
  const GoldenQuery& query = golden_.queries[1];
  JudgeQuery(golden_, query, right_, report);
  ASSERT_THAT(report.failures, SizeIs(1));
  EXPECT_EQ(report.failures[0].message,
            "expected error outside_hull, got a result");
  JudgeQuery(golden_, query, {.error = "outside_hull"}, report);
  JudgeQuery(golden_, query, {.error = "non_finite"}, report);
  EXPECT_THAT(report.failures, SizeIs(1));
  EXPECT_EQ(report.groups.at("scc.hand").errors_as_expected, 2);
  EXPECT_EQ(report.groups.at("scc.hand").errors_named_otherwise, 1);
}

TEST_F(JudgeTest, ComparesStretchFactors) {
  golden_.deformations[0].stretch = {1, 4};
  CaseResult result;
  result.queries = {right_, {.error = "outside_hull"}};
  result.stretch = {{1, 4 * (1 + 5e-12)}};
  VerifyReport report;
  JudgeCase(golden_, result, report);
  EXPECT_THAT(report.failures, IsEmpty());
  result.stretch = {{1, 4 * (1 + 5e-11)}};
  JudgeCase(golden_, result, report);
  ASSERT_THAT(report.failures, SizeIs(1));
  EXPECT_THAT(report.failures[0].message,
              HasSubstr("stretch of face 1 in moved"));
}

TEST_F(JudgeTest, CountsNormalWeightsInUnitsOfTheModel) {
  golden_.queries[0].normal_weights = {0.25};
  golden_.diagonal = 100;
  right_.normal_weights = {0.25 + 3e-9};
  // 2D: D (1 + |log D|) = 560.5; 5.4e-12 of it.
  EXPECT_EQ(Failure(right_), "");
  golden_.dimension = 3;  // 100; 3e-11 of it.
  golden_.queries[0].deformed.clear();
  EXPECT_THAT(Failure(right_), HasSubstr("normal weight 0 is off by 3e-11"));
}

TEST(PositionScale, AllowsForTheRoundingOfLargeCoordinates) {
  Positions rig(2, 3);
  rig << 0, 0, 0, 3, 4, 0;
  EXPECT_EQ(PositionScale(rig, Vec3(100, 0, 0)), 5);
  EXPECT_EQ(PositionScale(rig, Vec3(0, -1e6, 0)), 1000);
}

TEST(StreamedTolerance, GrowsWithTheWeights) {
  GoldenQuery query;
  query.vertex_weights = {0.5, 0.5};
  EXPECT_DOUBLE_EQ(StreamedTolerance(query), 1e-6);
  query.vertex_weights = {-500, 501};
  EXPECT_DOUBLE_EQ(StreamedTolerance(query), 1.001e-4);
  query.vertex_weights = {1};
  query.deformed_tolerance = 0.05;
  EXPECT_DOUBLE_EQ(StreamedTolerance(query), 0.05);
}

}  // namespace
}  // namespace deform
