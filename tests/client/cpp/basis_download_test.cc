#include "client/cpp/basis_download.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/base/error.h"
#include "core/frames/leaf_basis.h"
#include "tests/client/cpp/chunks.h"
#include "tests/core/frames/leaf_bases.h"

namespace deform {
namespace {

using testing::HasSubstr;

v1::DownloadBasisResponse Header(const std::string& id, uint64_t bytes) {
  v1::DownloadBasisResponse part;
  part.mutable_header()->set_basis_id(id);
  part.mutable_header()->set_byte_count(bytes);
  return part;
}

v1::DownloadBasisResponse Chunk(uint64_t offset, const std::string& data) {
  return ChunkOf<v1::DownloadBasisResponse>(offset, data);
}

// Why the last part is refused.
absl::Status Refusal(const std::vector<v1::DownloadBasisResponse>& parts) {
  BasisDownload download;
  absl::Status status;
  for (const auto& part : parts) {
    EXPECT_TRUE(status.ok()) << status;
    status = download.Add(part);
  }
  return status.ok() ? download.Finish({}).status() : status;
}

std::string MessageOf(const absl::Status& status) {
  EXPECT_EQ(DetailOf(status).reason, "BAD_ANSWER");
  return std::string(status.message());
}

TEST(BasisDownload, PutsThePartsTogether) {
  const std::vector<uint8_t> bytes = LeafBasis::Of(TinyBinding())->ToBytes();
  const std::string text(bytes.begin(), bytes.end());
  BasisDownload download;
  ASSERT_TRUE(download.Add(Header("x", text.size())).ok());
  for (size_t at = 0; at < text.size(); at += 100) {
    ASSERT_TRUE(download.Add(Chunk(at, text.substr(at, 100))).ok());
  }
  EXPECT_EQ(download.received(), download.total());
  const HeldBasis held = download.Finish({}).value();
  EXPECT_EQ(held.basis_id, "x");
  EXPECT_EQ(held.basis->ToBytes(), bytes);
}

TEST(BasisDownload, KeepsWhatIsKnown) {
  const HeldBasis known{"x", LeafBasis::Of(TinyBinding())};
  BasisDownload download;
  ASSERT_TRUE(download.Add(Header("x", known.basis->byte_count())).ok());
  EXPECT_EQ(download.Finish(known)->basis, known.basis);
  // Of another there is more to come.
  EXPECT_THAT(MessageOf(download.Finish({"y", known.basis}).status()),
              HasSubstr("a basis ends after 0 of 320 bytes"));
}

TEST(BasisDownload, RefusesWhatCannotBe) {
  EXPECT_THAT(MessageOf(Refusal({Chunk(0, "x")})),
              HasSubstr("does not begin with a basis"));
  EXPECT_THAT(MessageOf(Refusal({Header("", 7)})),
              HasSubstr("does not begin with a basis, but \"\" of 7 bytes"));
  EXPECT_THAT(MessageOf(Refusal({Header("x", uint64_t{1} << 60)})),
              HasSubstr("1152921504606846976 bytes"));
  EXPECT_THAT(MessageOf(Refusal({Header("x", 8), Chunk(1, "1234")})),
              HasSubstr("a chunk of 4 bytes comes at 1, where 0 of 8"));
  EXPECT_THAT(MessageOf(Refusal({Header("x", 8), Chunk(0, "123456789")})),
              HasSubstr("a chunk of 9 bytes comes at 0"));
  v1::DownloadBasisResponse wrong = Chunk(0, "12345678");
  wrong.mutable_chunk()->set_crc32(7);
  EXPECT_THAT(MessageOf(Refusal({Header("x", 8), wrong})),
              HasSubstr("the chunk at 0 has another checksum"));
  EXPECT_THAT(MessageOf(Refusal({Header("x", 8), Chunk(0, "1234")})),
              HasSubstr("a basis ends after 4 of 8 bytes"));
  EXPECT_THAT(MessageOf(Refusal({})), HasSubstr("the server sent no basis"));
  const absl::Status status = Refusal({Header("x", 4), Chunk(0, "1234")});
  EXPECT_EQ(DetailOf(status).reason, "BAD_BASIS");
}

}  // namespace
}  // namespace deform
