#include "core/kernels/measure_weights.h"

#include <gtest/gtest.h>

#include <hwy/targets.h>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace deform {
namespace {

constexpr int64_t kVertices = 7;
constexpr int64_t kColumns = 19;

class MeasureWeightsOn : public testing::TestWithParam<int64_t> {
 protected:
  MeasureWeightsOn() : tile_(kTilePoints, kColumns) {
    Choose(GetParam());
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int64_t c = 0; c < kColumns; ++c) {
      for (int64_t i = 0; i < kTilePoints; ++i) {
        tile_.set(i, c, static_cast<float>(uniform(random)));
      }
    }
    for (int64_t k = 0; k < 3 * kColumns; ++k) {
      column_.push_back(uniform(random));
    }
  }
  ~MeasureWeightsOn() override { Choose(0); }  // The best again.

  static void Choose(int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }

  void ExpectAsPlain(int64_t columns, int64_t vertices) {
    TileMeasures fast, plain;
    MeasureTile(tile_.tile(0), columns, vertices, column_.data(), fast);
    MeasureTilePlain(tile_.tile(0), columns, vertices, column_.data(), plain);
    for (int64_t i = 0; i < kTilePoints; ++i) {
      // Sums of at most 19 in double.
      for (int d = 0; d < 3; ++d) {
        EXPECT_NEAR(fast.position[d][i], plain.position[d][i], 1e-14);
      }
      EXPECT_NEAR(fast.vertex_sum[i], plain.vertex_sum[i], 1e-14);
      EXPECT_NEAR(fast.normal_sum[i], plain.normal_sum[i], 1e-14);
      EXPECT_NEAR(fast.vertex_total[i], plain.vertex_total[i], 1e-14);
      EXPECT_EQ(fast.vertex_min[i], plain.vertex_min[i]);
      EXPECT_EQ(fast.vertex_max[i], plain.vertex_max[i]);
    }
  }

  WeightTiles tile_;
  std::vector<double> column_;
};

TEST_P(MeasureWeightsOn, AgreesWithThePlainVersion) {
  ExpectAsPlain(kColumns, kVertices);
  ExpectAsPlain(kVertices, kVertices);
  ExpectAsPlain(1, 1);
  ExpectAsPlain(0, 0);
}

TEST_P(MeasureWeightsOn, FindsTheEndsAmongTheVerticesAlone) {
  for (int64_t c = 0; c < kColumns; ++c) {
    tile_.set(5, c, static_cast<float>(c + 1));
    tile_.set(6, c, static_cast<float>(-c - 1));
  }
  TileMeasures measures;
  MeasureTile(tile_.tile(0), kColumns, kVertices, column_.data(), measures);
  EXPECT_EQ(measures.vertex_min[5], 1);
  EXPECT_EQ(measures.vertex_max[5], kVertices);
  EXPECT_EQ(measures.vertex_total[5], kVertices * (kVertices + 1) / 2);
  EXPECT_EQ(measures.vertex_min[6], -kVertices);
  EXPECT_EQ(measures.vertex_max[6], -1);
}

TEST_P(MeasureWeightsOn, ShowsWhichPointHasAWeightThatIsNotFinite) {
  tile_.set(3, 2, std::numeric_limits<float>::infinity());
  tile_.set(9, kVertices + 4, std::numeric_limits<float>::quiet_NaN());
  tile_.set(12, kVertices, std::numeric_limits<float>::max());
  tile_.set(12, kVertices + 1, -std::numeric_limits<float>::max());
  TileMeasures measures;
  MeasureTile(tile_.tile(0), kColumns, kVertices, column_.data(), measures);
  for (int64_t i = 0; i < kTilePoints; ++i) {
    EXPECT_EQ(std::isfinite(measures.vertex_sum[i]), i != 3) << i;
    EXPECT_EQ(std::isfinite(measures.normal_sum[i]), i != 9) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(, MeasureWeightsOn,
                         testing::ValuesIn(hwy::SupportedAndGeneratedTargets()),
                         [](const auto& test) {
                           return hwy::TargetName(test.param);
                         });

}  // namespace
}  // namespace deform
