#include "server/models/model_upload.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::server {
namespace {

static_assert(std::endian::native == std::endian::little,
              "arrays are copied as they come");

constexpr int64_t kBlockBytes = ModelUpload::kMaxChunkBytes;
// Faces refer to vertices by int32.
constexpr uint64_t kMaxCount = std::numeric_limits<int32_t>::max();

}  // namespace

absl::StatusOr<ModelUpload> ModelUpload::Create(const Header& header,
                                                int64_t max_bytes,
                                                MemoryBudget& budget) {
  if (header.dimension != 2 && header.dimension != 3) {
    return InvalidInput(
        "BAD_DIMENSION", "header.dimension",
        absl::StrCat("dimension must be 2 or 3, not ", header.dimension));
  }
  if (header.vertex_count == 0) {
    return InvalidInput("EMPTY_MODEL", "header.vertex_count",
                        "a model needs at least one vertex");
  }
  if (header.vertex_count > kMaxCount || header.face_count > kMaxCount) {
    return InvalidInput(
        "MODEL_TOO_LARGE",
        header.vertex_count > kMaxCount ? "header.vertex_count"
                                        : "header.face_count",
        absl::StrCat("a model has at most ", kMaxCount, " vertices and faces"));
  }
  ModelUpload upload(header, budget);
  if (upload.total_bytes_ > max_bytes) {
    return MakeError(
        absl::StatusCode::kResourceExhausted,
        absl::StrCat("the header announces ", FormatBytes(upload.total_bytes_),
                     "; the server takes ", FormatBytes(max_bytes),
                     " (max-model-bytes)"),
        {.reason = "MODEL_TOO_LARGE", .field = "max-model-bytes"});
  }
  return upload;
}

ModelUpload::ModelUpload(const Header& header, MemoryBudget& budget)
    : header_(header),
      position_bytes_(static_cast<int64_t>(header.vertex_count) *
                      header.dimension * int64_t{sizeof(double)}),
      total_bytes_(position_bytes_ + static_cast<int64_t>(header.face_count) *
                                         3 * int64_t{sizeof(uint32_t)}),
      budget_(&budget) {}

absl::Status ModelUpload::Append(uint64_t offset, uint32_t crc,
                                 absl::string_view data) {
  const int64_t size = static_cast<int64_t>(data.size());
  if (size > kMaxChunkBytes) {
    return InvalidInput("CHUNK_TOO_LARGE", "chunk.data",
                        absl::StrCat("chunk at offset ", offset, " has ", size,
                                     " bytes; at most ", kMaxChunkBytes));
  }
  if (size == 0) {
    return InvalidInput(
        "CHUNK_EMPTY", "chunk.data",
        absl::StrCat("chunk at offset ", offset, " has no data"));
  }
  if (offset != static_cast<uint64_t>(received_)) {
    return InvalidInput("CHUNK_OUT_OF_ORDER", "chunk.offset",
                        absl::StrCat("chunk at offset ", offset, " where ",
                                     received_, " bytes have come"));
  }
  if (size > total_bytes_ - received_) {
    return InvalidInput("TOO_MANY_BYTES", "chunk.data",
                        absl::StrCat("chunk ends at byte ", received_ + size,
                                     "; the header announces ", total_bytes_));
  }
  const uint32_t found = ::crc32(0, reinterpret_cast<const Bytef*>(data.data()),
                                 static_cast<uInt>(size));
  if (found != crc) {
    return InvalidInput(
        "CHECKSUM_MISMATCH", "chunk.crc32",
        absl::StrCat("chunk at offset ", offset, " has CRC-32 ",
                     absl::Hex(found, absl::kZeroPad8), ", not ",
                     absl::Hex(crc, absl::kZeroPad8)));
  }
  while (!data.empty()) {
    if (received_ % kBlockBytes == 0) {
      const int64_t block = std::min(kBlockBytes, total_bytes_ - received_);
      DEFORM_ASSIGN_OR_RETURN(auto memory,
                              budget_->Reserve(block, "the upload needs"));
      memory_.push_back(std::move(memory));
      blocks_.emplace_back();
    }
    const size_t room = kBlockBytes - blocks_.back().size();
    const absl::string_view part = data.substr(0, room);
    blocks_.back().append(part.data(), part.size());
    received_ += static_cast<int64_t>(part.size());
    data.remove_prefix(part.size());
  }
  return absl::OkStatus();
}

absl::StatusOr<Mesh> ModelUpload::Finish() && {
  if (received_ != total_bytes_) {
    return InvalidInput("UPLOAD_INCOMPLETE", "chunk.data",
                        absl::StrCat("the upload ended after ", received_,
                                     " of ", total_bytes_, " bytes"));
  }
  DEFORM_ASSIGN_OR_RETURN(Faces faces, TakeFaces());
  Positions positions = TakePositions();
  blocks_.clear();
  memory_.clear();
  return Mesh::Create(static_cast<int>(header_.dimension), std::move(positions),
                      std::move(faces));
}

void ModelUpload::Copy(int64_t offset, int64_t size, void* out) const {
  char* to = static_cast<char*>(out);
  while (size > 0) {
    const std::string& block = blocks_[offset / kBlockBytes];
    const int64_t begin = offset % kBlockBytes;
    const int64_t part =
        std::min(size, static_cast<int64_t>(block.size()) - begin);
    std::memcpy(to, block.data() + begin, part);
    to += part;
    offset += part;
    size -= part;
  }
}

Positions ModelUpload::TakePositions() const {
  const int64_t rows = static_cast<int64_t>(header_.vertex_count);
  Positions positions(rows, 3);
  if (header_.dimension == 3) {
    Copy(0, position_bytes_, positions.data());
    return positions;
  }
  positions.col(2).setZero();
  for (int64_t i = 0; i < rows; ++i) {
    Copy(i * 2 * int64_t{sizeof(double)}, 2 * sizeof(double),
         positions.row(i).data());
  }
  return positions;
}

absl::StatusOr<Faces> ModelUpload::TakeFaces() const {
  const int64_t rows = static_cast<int64_t>(header_.face_count);
  Faces faces(rows, 3);
  Copy(position_bytes_, total_bytes_ - position_bytes_, faces.data());
  // As int32 they would be negative; said here with the number that was sent.
  for (int64_t i = 0; i < faces.size(); ++i) {
    if (faces.data()[i] < 0) {
      return InvalidInput("INDEX_OUT_OF_RANGE", "chunk.data",
                          absl::StrCat("face ", i / 3, " refers to vertex ",
                                       static_cast<uint32_t>(faces.data()[i]),
                                       " of ", header_.vertex_count));
    }
  }
  return faces;
}

}  // namespace deform::server
