#include "client/cpp/model_download.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/base/error.h"
#include "tests/client/cpp/chunks.h"

namespace deform {
namespace {

using testing::HasSubstr;

v1::DownloadModelResponse Header(uint32_t dimension, uint64_t vertices,
                                 uint64_t faces) {
  v1::DownloadModelResponse part;
  part.mutable_model()->set_dimension(dimension);
  part.mutable_model()->set_vertex_count(vertices);
  part.mutable_model()->set_face_count(faces);
  return part;
}

v1::DownloadModelResponse Chunk(uint64_t offset, const std::string& data) {
  return ChunkOf<v1::DownloadModelResponse>(offset, data);
}

template <typename Number>
std::string Bytes(std::vector<Number> numbers) {
  return {reinterpret_cast<const char*>(numbers.data()),
          numbers.size() * sizeof(Number)};
}

// Why the last part is refused.
std::string Refusal(const std::vector<v1::DownloadModelResponse>& parts) {
  ModelDownload download;
  absl::Status status;
  for (const auto& part : parts) {
    EXPECT_TRUE(status.ok()) << status;
    status = download.Add(part);
  }
  if (status.ok()) status = std::move(download).Finish().status();
  EXPECT_EQ(DetailOf(status).reason, "BAD_ANSWER");
  return std::string(status.message());
}

TEST(ModelDownload, PutsThePartsTogether) {
  ModelDownload download;
  ASSERT_TRUE(download.Add(Header(2, 3, 1)).ok());
  EXPECT_EQ(download.total(), 3 * 16 + 12);
  const std::string bytes =
      Bytes<double>({1, 2, 3, 4, 5, 6}) + Bytes<int32_t>({0, 1, 2});
  // Wherever they are cut.
  for (size_t at = 0; at < bytes.size(); at += 7) {
    ASSERT_TRUE(download.Add(Chunk(at, bytes.substr(at, 7))).ok());
  }
  const ModelArrays arrays = std::move(download).Finish().value();
  Positions expected(3, 3);
  expected << 1, 2, 0, 3, 4, 0, 5, 6, 0;
  EXPECT_EQ(arrays.dimension, 2);
  EXPECT_EQ(arrays.positions, expected);
  EXPECT_EQ(arrays.faces, (Faces(1, 3) << 0, 1, 2).finished());
}

TEST(ModelDownload, RefusesWhatCannotBe) {
  EXPECT_THAT(Refusal({Chunk(0, "x")}),
              HasSubstr("chunks come before their model"));
  EXPECT_THAT(Refusal({Header(4, 1, 0)}),
              HasSubstr("a model of 1 vertices and 0 faces in 4D"));
  EXPECT_THAT(Refusal({Header(3, uint64_t{1} << 60, 0)}),
              HasSubstr("1152921504606846976 vertices"));
  EXPECT_THAT(Refusal({Header(2, 1, 0), Chunk(8, "12345678")}),
              HasSubstr("a chunk of 8 bytes comes at 8, where 0 of 16 bytes "
                        "were reached"));
  EXPECT_THAT(Refusal({Header(2, 1, 0), Chunk(0, std::string(17, 'x'))}),
              HasSubstr("a chunk of 17 bytes comes at 0"));
  EXPECT_THAT(Refusal({Header(2, 1, 0), Chunk(0, "")}),
              HasSubstr("a chunk of 0 bytes"));
  v1::DownloadModelResponse wrong = Chunk(0, "12345678");
  wrong.mutable_chunk()->set_crc32(7);
  EXPECT_THAT(Refusal({Header(2, 1, 0), wrong}),
              HasSubstr("the chunk at 0 has another checksum than it tells"));
  EXPECT_THAT(Refusal({Header(2, 1, 0), Chunk(0, "12345678")}),
              HasSubstr("a model ends after 8 of 16 bytes"));
  EXPECT_THAT(Refusal({}), HasSubstr("the server sent no model"));
}

}  // namespace
}  // namespace deform
