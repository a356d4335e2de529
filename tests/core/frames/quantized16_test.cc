#include "core/frames/encodings/quantized16.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "absl/strings/escaping.h"
#include "core/base/error.h"

namespace deform {
namespace {

std::vector<uint8_t> Encoded(const std::vector<float>& positions, int dimension,
                             double tolerance) {
  std::vector<uint8_t> bytes(kMaxChunkBytes);
  const absl::StatusOr<int64_t> size = Quantized16Encoding().Encode(
      {.dimension = dimension,
       .count = static_cast<int64_t>(positions.size()) / dimension,
       .positions = positions,
       .tolerance = tolerance},
      bytes.data());
  EXPECT_TRUE(size.ok()) << size.status();
  bytes.resize(size.value_or(0));
  return bytes;
}

std::vector<float> Decoded(const std::vector<uint8_t>& bytes, int64_t numbers,
                           int dimension) {
  std::vector<float> positions(numbers);
  const absl::Status status =
      Quantized16Encoding().Decode(bytes, {.dimension = dimension,
                                           .count = numbers / dimension,
                                           .positions = positions});
  EXPECT_TRUE(status.ok()) << status;
  return positions;
}

TEST(Quantized16, KeepsPointsWithinTheTolerance) {
  std::mt19937 random(3);
  for (const int dimension : {2, 3}) {
    // Far from the origin floats add their share.
    for (const double offset : {0.0, 10.0, -1000.0}) {
      // Half a step of a side of 2 in each coordinate, and two roundings.
      const double tolerance =
          std::sqrt(dimension) *
          (1.0 / 65535 + (std::abs(offset) + 1.1) * std::ldexp(1.0, -23));
      std::uniform_real_distribution<double> uniform(offset - 1, offset + 1);
      for (const int64_t points : {0, 1, 255, 256, 257, 5000}) {
        std::vector<double> meant(points * dimension);
        for (double& x : meant) x = uniform(random);
        const std::vector<float> positions(meant.begin(), meant.end());
        const std::vector<float> back =
            Decoded(Encoded(positions, dimension, tolerance),
                    points * dimension, dimension);
        for (int64_t i = 0; i < points; ++i) {
          double squares = 0;
          for (int d = 0; d < dimension; ++d) {
            squares +=
                std::pow(back[i * dimension + d] - meant[i * dimension + d], 2);
          }
          ASSERT_LE(std::sqrt(squares), tolerance);
        }
      }
    }
  }
}

TEST(Quantized16, KeepsTheEndsOfTheBoxAndFlatBoxes) {
  const std::vector<float> positions = {-3, 7, 0.1F, 5, 7, 0.1F};
  EXPECT_EQ(Decoded(Encoded(positions, 3, 1), 6, 3), positions);
}

TEST(Quantized16, SaysWhatItCannotMeet) {
  const std::vector<float> positions = {0, 0, 0, 65535, 0, 0};
  std::vector<uint8_t> bytes(kMaxChunkBytes);
  const absl::Status status =
      Quantized16Encoding()
          .Encode({.count = 2, .positions = positions, .tolerance = 0.5},
                  bytes.data())
          .status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(status).reason, "TOLERANCE_NOT_MET");
  EXPECT_EQ(status.message(),
            "16 bits are off by up to 0.507812 in the box of these vertices, "
            "not 0.5");
  Encoded(positions, 3, 0.508);
}

TEST(Quantized16, RefusesWhatIsNotFinite) {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(),
                          -std::numeric_limits<float>::infinity()}) {
    const std::vector<float> positions = {0, 0, 0, 1, bad, 0};
    std::vector<uint8_t> bytes(kMaxChunkBytes);
    const absl::Status status =
        Quantized16Encoding()
            .Encode({.count = 2, .positions = positions, .tolerance = 1},
                    bytes.data())
            .status();
    EXPECT_EQ(DetailOf(status).reason, "NON_FINITE");
  }
}

// A decoder written after the header alone must read these for ever.
TEST(Quantized16, WritesTheseBytes) {
  const std::vector<float> positions = {-1, 2, 65534, 2, 0.25F, 2};
  const std::vector<uint8_t> bytes = Encoded(positions, 2, 1);
  EXPECT_EQ(absl::BytesToHexString(
                {reinterpret_cast<const char*>(bytes.data()), bytes.size()}),
            "000000000000f0bf000000000000f03f"  // -1, 1
            "00000000000000400000000000000000"  // 2, 0
            "00000000"                          // 0, 0
            "ffff0000"                          // 65535, 0
            "01000000");                        // 1, 0
}

TEST(Quantized16, RefusesBoxesBeyondFloats) {
  const auto message = [](double min, double step) {
    std::vector<uint8_t> bytes = Encoded({1, 1}, 2, 1);
    std::memcpy(bytes.data(), &min, sizeof(min));
    std::memcpy(bytes.data() + sizeof(min), &step, sizeof(step));
    std::vector<float> positions(2);
    const absl::Status status = Quantized16Encoding().Decode(
        bytes, {.dimension = 2, .count = 1, .positions = positions});
    EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
    return std::string(status.message());
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(message(-1, -1),
            "the chunk's box, from -1 in steps of -1, does not fit into "
            "floats");
  for (const auto& [min, step] :
       {std::pair(kNan, 1.0), {0.0, kNan}, {-1e39, 1e39}, {0.0, 1e34}}) {
    EXPECT_FALSE(message(min, step).empty());
  }
}

}  // namespace
}  // namespace deform
