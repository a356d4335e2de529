// Uploads of models: a header and chunks of any kind.
//
// Input: dimension, vertices and faces, one byte each; then chunks: their
// length and what is wrong with them, one byte each, and their bytes.
#include <zlib.h>

#include <algorithm>

#include "core/base/error.h"
#include "server/models/model_upload.h"
#include "tests/fuzz/expect.h"

namespace deform::server {
namespace {

constexpr int64_t kMaxBytes = 1 << 20;

void CheckRefusal(const absl::Status& status) {
  FUZZ_EXPECT(!DetailOf(status).reason.empty());
  FUZZ_EXPECT(!DetailOf(status).field.empty());
  FUZZ_EXPECT(!status.message().empty());
}

absl::Status AppendAll(absl::string_view input, ModelUpload& upload) {
  uint64_t offset = 0;
  while (input.size() >= 2) {
    const size_t length = static_cast<uint8_t>(input[0]);
    const uint8_t wrong = input[1];
    const absl::string_view data = input.substr(2, length);
    input.remove_prefix(2 + data.size());
    const uint32_t crc =
        ::crc32(0, reinterpret_cast<const Bytef*>(data.data()), data.size());
    const absl::Status status =
        upload.Append(offset + (wrong & 1), crc ^ (wrong & 2), data);
    if (!status.ok()) return status;
    offset += data.size();
  }
  return absl::OkStatus();
}

void Check(absl::string_view input) {
  if (input.size() < 3) return;
  MemoryBudget budget(kMaxBytes, "limit");
  const ModelUpload::Header header = {
      .dimension = static_cast<uint8_t>(input[0]),
      .vertex_count = static_cast<uint8_t>(input[1]),
      .face_count = static_cast<uint8_t>(input[2])};
  auto upload = ModelUpload::Create(header, kMaxBytes, budget);
  if (!upload.ok()) return CheckRefusal(upload.status());
  const absl::Status status = AppendAll(input.substr(3), *upload);
  if (!status.ok()) return CheckRefusal(status);
  const auto mesh = std::move(*upload).Finish();
  if (!mesh.ok()) return CheckRefusal(mesh.status());
  FUZZ_EXPECT(mesh->size() == static_cast<int64_t>(header.vertex_count));
  FUZZ_EXPECT(mesh->positions().allFinite());
}

}  // namespace
}  // namespace deform::server

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  deform::server::Check({reinterpret_cast<const char*>(data), size});
  return 0;
}
