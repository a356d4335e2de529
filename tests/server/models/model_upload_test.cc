#include "server/models/model_upload.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>
#include <functional>
#include <limits>
#include <string>

#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform::server {
namespace {

using testing::HasSubstr;

constexpr int64_t kMaxBytes = 64 << 20;

std::string BytesOf(const Shape& shape, int dimension) {
  std::string bytes;
  for (int64_t i = 0; i < shape.positions.rows(); ++i) {
    bytes.append(reinterpret_cast<const char*>(shape.positions.row(i).data()),
                 dimension * sizeof(double));
  }
  bytes.append(reinterpret_cast<const char*>(shape.faces.data()),
               shape.faces.size() * sizeof(int32_t));
  return bytes;
}

uint32_t Crc(absl::string_view data) {
  return ::crc32(0, reinterpret_cast<const Bytef*>(data.data()), data.size());
}

ModelUpload::Header HeaderOf(const Shape& shape, uint32_t dimension) {
  return {.dimension = dimension,
          .vertex_count = static_cast<uint64_t>(shape.positions.rows()),
          .face_count = static_cast<uint64_t>(shape.faces.rows())};
}

absl::Status AppendAll(ModelUpload& upload, const std::string& bytes,
                       size_t chunk_bytes) {
  for (size_t offset = 0; offset < bytes.size(); offset += chunk_bytes) {
    const std::string chunk = bytes.substr(offset, chunk_bytes);
    const absl::Status status = upload.Append(offset, Crc(chunk), chunk);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

class UploadInChunks : public testing::TestWithParam<size_t> {};

TEST_P(UploadInChunks, KeepsEveryBitAndTheOrder) {
  MemoryBudget budget(kMaxBytes, "max-models-memory");
  // 10,242 vertices and 20,480 faces: 480 KB; chunk sizes split numbers too.
  const Shape shape = Icosphere(1.234, 5);
  auto upload =
      ModelUpload::Create(HeaderOf(shape, 3), kMaxBytes, budget).value();
  ASSERT_TRUE(AppendAll(upload, BytesOf(shape, 3), GetParam()).ok());
  const Mesh mesh = std::move(upload).Finish().value();
  EXPECT_EQ(mesh.positions(), shape.positions);
  EXPECT_EQ(mesh.faces(), shape.faces);
}
INSTANTIATE_TEST_SUITE_P(Sizes, UploadInChunks,
                         testing::Values(997, 1 << 16, 1 << 20));

TEST(ModelUpload, PutsPlanarModelsIntoThePlane) {
  MemoryBudget budget(kMaxBytes, "max-models-memory");
  const Shape shape = Grid2d(300);  // 90,601 vertices, beyond one block.
  auto upload =
      ModelUpload::Create(HeaderOf(shape, 2), kMaxBytes, budget).value();
  ASSERT_TRUE(AppendAll(upload, BytesOf(shape, 2), 1 << 20).ok());
  const Mesh mesh = std::move(upload).Finish().value();
  EXPECT_EQ(mesh.dimension(), 2);
  EXPECT_EQ(mesh.positions(), shape.positions);
}

TEST(ModelUpload, DoesNotAllocateWhatAHeaderAnnounces) {
  MemoryBudget budget(int64_t{1} << 40, "max-models-memory");
  auto upload = ModelUpload::Create(
      {.dimension = 3, .vertex_count = 1'000'000'000, .face_count = 0},
      int64_t{1} << 40, budget);
  ASSERT_TRUE(upload.ok());
  const std::string chunk(1000, '\0');
  ASSERT_TRUE(upload->Append(0, Crc(chunk), chunk).ok());
  EXPECT_EQ(budget.used(), 1 << 20);
}

TEST(ModelUpload, StopsAtTheMemoryLimitAndGivesAllBack) {
  MemoryBudget budget(1 << 20, "max-models-memory");
  {
    auto upload = ModelUpload::Create(
        {.dimension = 3, .vertex_count = 100'000, .face_count = 0}, kMaxBytes,
        budget);
    const absl::Status status =
        AppendAll(*upload, std::string(2'400'000, '\0'), 1 << 20);
    EXPECT_EQ(DetailOf(status).reason, "MEMORY_LIMIT");
    EXPECT_THAT(std::string(status.message()), HasSubstr("the upload needs"));
  }
  EXPECT_EQ(budget.used(), 0);
}

struct BadHeader {
  const char* name;
  ModelUpload::Header header;
  const char* reason;
  const char* field;
  const char* message;
};

class HeaderRefused : public testing::TestWithParam<BadHeader> {};

TEST_P(HeaderRefused, SaysWhatToMend) {
  MemoryBudget budget(kMaxBytes, "max-models-memory");
  const absl::Status status =
      ModelUpload::Create(GetParam().header, kMaxBytes, budget).status();
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().message));
  EXPECT_EQ(DetailOf(status).reason, GetParam().reason);
  EXPECT_EQ(DetailOf(status).field, GetParam().field);
}
INSTANTIATE_TEST_SUITE_P(Headers, HeaderRefused,
                         testing::ValuesIn<BadHeader>({
                             {"Dimension",
                              {4, 1, 0},
                              "BAD_DIMENSION",
                              "header.dimension",
                              "dimension must be 2 or 3, not 4"},
                             {"Empty",
                              {3, 0, 0},
                              "EMPTY_MODEL",
                              "header.vertex_count",
                              "at least one vertex"},
                             {"TooManyVertices",
                              {3, std::numeric_limits<uint64_t>::max(), 0},
                              "MODEL_TOO_LARGE",
                              "header.vertex_count",
                              "at most 2147483647"},
                             {"TooManyFaces",
                              {3, 1, uint64_t{1} << 31},
                              "MODEL_TOO_LARGE",
                              "header.face_count",
                              "at most 2147483647"},
                             {"TooLarge",
                              {3, 100'000'000, 0},
                              "MODEL_TOO_LARGE",
                              "max-model-bytes",
                              "announces 2.235 GiB; the server takes 64 MiB"},
                         }),
                         [](const auto& test) { return test.param.name; });

struct BadUpload {
  const char* name;
  std::function<absl::Status(ModelUpload&, const std::string&)> send;
  const char* reason;
  const char* message;
};

class UploadRefused : public testing::TestWithParam<BadUpload> {};

TEST_P(UploadRefused, SaysWhatToMend) {
  MemoryBudget budget(kMaxBytes, "max-models-memory");
  const Shape shape = Tetrahedron();
  auto upload =
      ModelUpload::Create(HeaderOf(shape, 3), kMaxBytes, budget).value();
  absl::Status status = GetParam().send(upload, BytesOf(shape, 3));
  if (status.ok()) status = std::move(upload).Finish().status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().message));
  EXPECT_EQ(DetailOf(status).reason, GetParam().reason);
}

absl::Status SendAll(ModelUpload& upload, const std::string& bytes) {
  return upload.Append(0, Crc(bytes), bytes);
}

// `bytes` with the corner `index` of the faces replaced.
std::string WithCorner(std::string bytes, int index, uint32_t corner) {
  std::memcpy(&bytes[4 * 24 + index * 4], &corner, 4);
  return bytes;
}

INSTANTIATE_TEST_SUITE_P(
    Chunks, UploadRefused,
    testing::ValuesIn<BadUpload>({
        {"TooLarge",
         [](ModelUpload& u, const std::string&) {
           return SendAll(u, std::string((1 << 20) + 1, 'x'));
         },
         "CHUNK_TOO_LARGE", "chunk at offset 0 has 1048577 bytes"},
        {"Empty",
         [](ModelUpload& u, const std::string&) { return SendAll(u, ""); },
         "CHUNK_EMPTY", "chunk at offset 0 has no data"},
        {"Gap",
         [](ModelUpload& u, const std::string& b) {
           return u.Append(8, Crc(b), b);
         },
         "CHUNK_OUT_OF_ORDER", "chunk at offset 8 where 0 bytes have come"},
        {"Damaged",
         [](ModelUpload& u, const std::string& b) {
           return u.Append(0, Crc(b) ^ 1, b);
         },
         "CHECKSUM_MISMATCH", "chunk at offset 0 has CRC-32"},
        {"TooMuch",
         [](ModelUpload& u, const std::string& b) {
           return SendAll(u, b + "x");
         },
         "TOO_MANY_BYTES", "chunk ends at byte 145; the header announces 144"},
        {"TooLittle",
         [](ModelUpload& u, const std::string& b) {
           return SendAll(u, b.substr(0, 100));
         },
         "UPLOAD_INCOMPLETE", "ended after 100 of 144 bytes"},
        {"CornerBeyond",
         [](ModelUpload& u, const std::string& b) {
           return SendAll(u, WithCorner(b, 4, 4));
         },
         "INDEX_OUT_OF_RANGE", "face 1 refers to vertex 4 of 4"},
        {"CornerBeyondInt32",
         [](ModelUpload& u, const std::string& b) {
           return SendAll(u, WithCorner(b, 4, 4294967295u));
         },
         "INDEX_OUT_OF_RANGE", "face 1 refers to vertex 4294967295 of 4"},
        {"NotFinite",
         [](ModelUpload& u, const std::string& b) {
           std::string bytes = b;
           const double nan = std::numeric_limits<double>::quiet_NaN();
           std::memcpy(&bytes[24], &nan, 8);
           return SendAll(u, bytes);
         },
         "NON_FINITE", "vertex 1 has a coordinate that is not finite"},
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform::server
