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

TEST(FrameEncodings, GiveBackWhatTheyWereGiven) {
  for (const FrameEncoding* encoding : AllEncodings()) {
    for (const int dimension : {2, 3}) {
      for (const int64_t vertices :
           {int64_t{0}, int64_t{1}, encoding->VerticesPerChunk(dimension)}) {
        std::vector<float> positions;
        for (int64_t i = 0; i < vertices * dimension; ++i) {
          positions.push_back(static_cast<float>(i) * 0.37f - 5.0f);
        }
        std::vector<uint8_t> bytes(kMaxChunkBytes);
        const int64_t size =
            encoding->Encode(positions, dimension, bytes.data());
        ASSERT_LE(size, kMaxChunkBytes);
        bytes.resize(size);
        std::vector<float> decoded(positions.size());
        ASSERT_TRUE(encoding->Decode(bytes, dimension, decoded).ok());
        EXPECT_EQ(decoded, positions);  // float32 is exact.
      }
    }
  }
}

TEST(Float32, RefusesBytesOfAnotherLength) {
  const FrameEncoding* encoding = FindEncoding("float32");
  ASSERT_NE(encoding, nullptr);
  const std::vector<uint8_t> bytes(23);
  std::vector<float> positions(6);
  const absl::Status status = encoding->Decode(bytes, 3, positions);
  EXPECT_EQ(status.message(), "chunk has 23 bytes, its vertices need 24");
  EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
}

}  // namespace
}  // namespace deform
