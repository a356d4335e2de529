#include "core/frames/encoding.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/base/error.h"

namespace deform {
namespace {

TEST(FrameEncodings, AreFoundByName) {
  for (const FrameEncoding* encoding : AllEncodings()) {
    EXPECT_EQ(FindEncoding(encoding->id()), encoding);
  }
  EXPECT_EQ(FindEncoding("smoke"), nullptr);
}

// A grid whose residuals need all bits.
Grid Wild(int64_t points, int dimension) {
  Grid grid(points);
  for (int d = 0; d < dimension; ++d) {
    for (int64_t i = 0; i < points; ++i) {
      grid.coordinate(d)[i] = i % 2 == 0 ? kGridLimit : -kGridLimit;
    }
  }
  grid.Pad();
  return grid;
}

TEST(FrameEncodings, FillNoChunkBeyondItsSize) {
  for (const FrameEncoding* encoding : AllEncodings()) {
    if (encoding->needs() != Needs::kNothing) continue;
    for (const int dimension : {2, 3}) {
      for (const int64_t points :
           {int64_t{0}, int64_t{1}, encoding->PointsPerChunk(dimension)}) {
        const std::vector<float> positions(points * dimension, 0.5F);
        const Grid grid = Wild(points, dimension);
        std::vector<uint8_t> bytes(kMaxChunkBytes + 1, 0xEE);
        const absl::StatusOr<int64_t> size =
            encoding->Encode({.dimension = dimension,
                              .count = points,
                              .positions = positions,
                              .tolerance = 1,
                              .grid = &grid},
                             bytes.data());
        ASSERT_TRUE(size.ok());
        EXPECT_LE(*size, kMaxChunkBytes);
        EXPECT_EQ(bytes.back(), 0xEE);
        if (encoding->uses_grid()) {
          EXPECT_EQ(encoding->PointsPerChunk(dimension) % kGridBlock, 0);
        }
      }
    }
  }
}

TEST(FrameEncodings, RefuseChunksThatAreTooLongOrTooShort) {
  for (const FrameEncoding* encoding : AllEncodings()) {
    if (encoding->needs() != Needs::kNothing) continue;
    for (const int dimension : {2, 3}) {
      const int64_t points = 300;
      const std::vector<float> positions(points * dimension, 0.5F);
      const Grid grid = Wild(points, dimension);
      std::vector<uint8_t> bytes(kMaxChunkBytes);
      const int64_t size = encoding
                               ->Encode({.dimension = dimension,
                                         .count = points,
                                         .positions = positions,
                                         .tolerance = 1,
                                         .grid = &grid},
                                        bytes.data())
                               .value();
      std::vector<float> decoded(positions.size());
      Grid decoded_grid(points);
      const auto decode = [&](int64_t length) {
        return encoding->Decode({bytes.data(), static_cast<size_t>(length)},
                                {.dimension = dimension,
                                 .count = points,
                                 .positions = decoded,
                                 .grid = &decoded_grid});
      };
      EXPECT_TRUE(decode(size).ok());
      EXPECT_EQ(DetailOf(decode(size + 1)).reason, "BAD_FRAME");
      for (int64_t length = 0; length < size; ++length) {
        ASSERT_EQ(DetailOf(decode(length)).reason, "BAD_FRAME")
            << length << " of " << size << " bytes of " << encoding->id();
      }
    }
  }
}

TEST(Float32, GivesBackWhatItWasGiven) {
  const FrameEncoding* encoding = FindEncoding("float32");
  for (const int dimension : {2, 3}) {
    for (const int64_t points :
         {int64_t{0}, int64_t{1}, encoding->PointsPerChunk(dimension)}) {
      std::vector<float> positions;
      for (int64_t i = 0; i < points * dimension; ++i) {
        positions.push_back(static_cast<float>(i) * 0.37f - 5.0f);
      }
      std::vector<uint8_t> bytes(kMaxChunkBytes);
      const absl::StatusOr<int64_t> size = encoding->Encode(
          {.dimension = dimension, .count = points, .positions = positions},
          bytes.data());
      ASSERT_TRUE(size.ok());
      bytes.resize(*size);
      std::vector<float> decoded(positions.size());
      ASSERT_TRUE(encoding
                      ->Decode(bytes, {.dimension = dimension,
                                       .count = points,
                                       .positions = decoded})
                      .ok());
      EXPECT_EQ(decoded, positions);
    }
  }
}

TEST(Float32, SaysHowManyBytesItNeeds) {
  const std::vector<uint8_t> bytes(23);
  std::vector<float> positions(6);
  const absl::Status status = FindEncoding("float32")->Decode(
      bytes, {.count = 2, .positions = positions});
  EXPECT_EQ(status.message(), "chunk has 23 bytes, its vertices need 24");
  EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
}

}  // namespace
}  // namespace deform
