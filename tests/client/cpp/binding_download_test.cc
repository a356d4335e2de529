#include "client/cpp/binding_download.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::HasSubstr;

// A ball of 42 points in a cube of 8 vertices and 12 faces.
Mesh Ball() { return MeshOf(Icosphere(0.5, 1)); }
Cage Cube() { return CageOf(Cuboid(Vec3::Constant(-1), Vec3::Constant(1))); }
BindingInfo InfoOf(const std::string& scheme, int64_t normals) {
  return {.scheme = scheme,
          .dimension = 3,
          .point_count = 42,
          .vertex_count = 8,
          .normal_count = normals};
}

TEST(FactsOf, TellsWhatDeformingNeeds) {
  BindingInfo info = InfoOf("green", 12);
  info.clamped = {3, 41};
  info.exit_parts = {{.exit_face = 11, .crossed_faces = {0, 7}}};
  const BindingFacts facts = FactsOf(info, Ball(), Cube()).value();
  EXPECT_EQ(facts.column_count(), 20);
  EXPECT_EQ(facts.point_count(), 42);
  EXPECT_EQ(facts.clamped(), info.clamped);
}

struct Misfit {
  const char* name;
  BindingInfo info;
  Rig rig = Cube();
};

void PrintTo(const Misfit& misfit, std::ostream* out) { *out << misfit.name; }

class FactsOfRefuses : public testing::TestWithParam<Misfit> {};

TEST_P(FactsOfRefuses, WhatDoesNotFit) {
  const absl::Status status =
      FactsOf(GetParam().info, Ball(), GetParam().rig).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, "BAD_ANSWER");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("a model or a rig that does not fit its binding"));
}

std::vector<Misfit> Misfits() {
  const Handles handles = Handles::Create(3, Cube().vertices()).value();
  std::vector<Misfit> misfits = {
      {"FewerNormals", InfoOf("green", 11)},
      {"NormalsOfASchemeWithout", InfoOf("mean_value", 12)},
      {"HandlesForACage", InfoOf("green", 0), handles},
      {"ACageForHandles", InfoOf("s_cc", 0)},
      {"AnotherDimension", InfoOf("green", 4), CageOf(RegularLoop2d(1, 4))},
      {"ClampedBeyond", InfoOf("green", 12)},
      {"UnboundBeyond", InfoOf("green", 12)},
      {"ExitFaceBeyond", InfoOf("green", 12)},
      {"CrossedFaceBeyond", InfoOf("green", 12)}};
  misfits[5].info.clamped = {42};
  misfits[6].info.unbound = {{.reason = "X", .points = {-1}}};
  misfits[7].info.exit_parts = {{.exit_face = 12}};
  misfits[8].info.exit_parts = {{.exit_face = 3, .crossed_faces = {0, 12}}};
  return misfits;
}

INSTANTIATE_TEST_SUITE_P(Answers, FactsOfRefuses, testing::ValuesIn(Misfits()),
                         [](const auto& info) {
                           return std::string(info.param.name);
                         });

TEST(FactsOf, RefusesASchemeThatIsNotKnown) {
  const absl::Status status =
      FactsOf(InfoOf("harmonious", 0), Ball(), Cube()).status();
  EXPECT_EQ(DetailOf(status).reason, "UNKNOWN_SCHEME");
}

// Rows of 2 vertex weights and 1 of a normal.
WeightRows Rows(int64_t first, int64_t count) {
  return {.first_point = first,
          .vertex = RowMatrix::Constant(count, 2, 0.25),
          .normal = RowMatrix::Constant(count, 1, -1)};
}

TEST(WeightsDownload, PutsTheRowsTogether) {
  WeightsDownload download(5, 3);
  ASSERT_TRUE(download.Add(Rows(0, 2)).ok());
  ASSERT_TRUE(download.Add(Rows(2, 3)).ok());
  EXPECT_EQ(download.received(), download.total());
  const auto weights = std::move(download).Finish().value();
  EXPECT_EQ(weights->at(4, 1), 0.25F);
  EXPECT_EQ(weights->at(4, 2), -1.F);
}

TEST(WeightsDownload, RefusesRowsThatDoNotFollow) {
  const auto refusal = [](const WeightRows& second) {
    WeightsDownload download(5, 3);
    EXPECT_TRUE(download.Add(Rows(0, 2)).ok());
    const absl::Status status = download.Add(second);
    EXPECT_EQ(DetailOf(status).reason, "BAD_ANSWER");
    return std::string(status.message());
  };
  EXPECT_EQ(refusal(Rows(3, 2)),
            "the server sent 2 rows of 3 weights from point 3 on, where 2 of 5 "
            "rows of 3 were reached");
  EXPECT_THAT(refusal(Rows(2, 4)), HasSubstr("sent 4 rows of 3 weights"));
  WeightRows narrow = Rows(2, 3);
  narrow.normal.resize(3, 0);
  EXPECT_THAT(refusal(narrow), HasSubstr("sent 3 rows of 2 weights"));
}

TEST(WeightsDownload, RefusesAnEndBeforeTheLast) {
  WeightsDownload download(5, 3);
  ASSERT_TRUE(download.Add(Rows(0, 2)).ok());
  const absl::Status status = std::move(download).Finish().status();
  EXPECT_EQ(DetailOf(status).reason, "BAD_ANSWER");
  EXPECT_EQ(status.message(), "the server sent the weights of 2 of 5 points");
}

}  // namespace
}  // namespace deform
