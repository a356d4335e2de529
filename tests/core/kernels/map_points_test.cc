#include "core/kernels/map_points.h"

#include <gtest/gtest.h>

#include <hwy/targets.h>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/support/instruction_sets.h"

namespace deform {
namespace {

constexpr PointMap kIdentity = {.linear = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                                .from = {1e6, -2e6, 3},
                                .to = {1e6, -2e6, 3},
                                .origin = {1e6, -2e6, 0}};

class MapPointsOn : public testing::TestWithParam<int64_t> {
 protected:
  std::vector<double> Random(int64_t count, double around, double size) {
    std::uniform_real_distribution<double> uniform(around - size,
                                                   around + size);
    std::vector<double> numbers(count);
    for (double& number : numbers) number = uniform(random_);
    return numbers;
  }

  const OnInstructionSet on_{GetParam()};
  std::mt19937 random_{5};
};

TEST_P(MapPointsOn, AgreesWithThePlainVersion) {
  const PointMap map = {
      .linear = {{0.8, -0.6, 0.1}, {0.6, 0.8, -0.2}, {-0.3, 0.1, 1.5}},
      .from = {100, 101, 99},
      .to = {-3, 5, 0.25},
      .origin = {-2.5, 4, 1}};
  for (int64_t count = 0; count <= 40; ++count) {
    const auto rest = Random(3 * count, 100, 2);
    const auto displacements = Random(3 * count, 0, 1);
    std::vector<float> plain(3 * count), fast(3 * count + 1, 7.F);
    MapPointsPlain(map, rest.data(), displacements.data(), count, plain.data());
    MapPoints(map, rest.data(), displacements.data(), count, fast.data());
    for (int64_t i = 0; i < 3 * count; ++i) {
      // They may round to one of two neighbours.
      EXPECT_LE(std::abs(fast[i] - plain[i]),
                std::abs(plain[i]) * 1.2e-7F + 1e-14F)
          << i << " of " << count;
    }
    EXPECT_EQ(fast.back(), 7.F) << "writes no more than it was told";
  }
}

TEST_P(MapPointsOn, LeavesRestPosesExactFarFromTheOrigin) {
  const int64_t count = 100;
  std::vector<double> rest = Random(3 * count, 0, 1);
  for (int64_t i = 0; i < 3 * count; i += 3) {
    rest[i] += 1e6;
    rest[i + 1] -= 2e6;
  }
  const std::vector<double> none(3 * count);
  std::vector<float> placed(3 * count);
  MapPoints(kIdentity, rest.data(), none.data(), count, placed.data());
  for (int64_t i = 0; i < 3 * count; ++i) {
    EXPECT_EQ(placed[i], static_cast<float>(rest[i] - kIdentity.origin[i % 3]));
  }
}

TEST_P(MapPointsOn, KeepsWhatIsNotFiniteToItsPoint) {
  const int64_t count = 9;
  const auto rest = Random(3 * count, 0, 1);
  std::vector<double> displacements(3 * count);
  displacements[13] = std::numeric_limits<double>::quiet_NaN();
  displacements[20] = 1e300;
  std::vector<float> placed(3 * count);
  MapPoints(kIdentity, rest.data(), displacements.data(), count, placed.data());
  for (int64_t i = 0; i < 3 * count; ++i) {
    // What float cannot hold is infinite, or the largest it can.
    const bool in_range =
        std::abs(placed[i]) < std::numeric_limits<float>::max();
    EXPECT_EQ(in_range, i != 13 && i != 20) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, MapPointsOn,
                         testing::ValuesIn(hwy::SupportedAndGeneratedTargets()),
                         [](const auto& info) {
                           return std::string(hwy::TargetName(info.param));
                         });

}  // namespace
}  // namespace deform
