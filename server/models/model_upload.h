// A model on its way in: header first, then bytes in order.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/mesh/mesh.h"
#include "server/models/memory_budget.h"

namespace deform::server {

// Not thread-safe. Memory grows as bytes come, whatever the header says.
class ModelUpload {
 public:
  static constexpr int64_t kMaxChunkBytes = int64_t{1} << 20;

  struct Header {
    uint32_t dimension = 0;
    uint64_t vertex_count = 0;
    uint64_t face_count = 0;
  };

  // `budget` is borrowed. InvalidArgument BAD_DIMENSION, EMPTY_MODEL;
  // ResourceExhausted MODEL_TOO_LARGE beyond `max_bytes`.
  static absl::StatusOr<ModelUpload> Create(const Header& header,
                                            int64_t max_bytes,
                                            MemoryBudget& budget);

  // The next bytes of the arrays: float64 positions by vertex, then uint32
  // corners by face. InvalidArgument CHUNK_TOO_LARGE, CHUNK_EMPTY,
  // CHUNK_OUT_OF_ORDER, CHECKSUM_MISMATCH (CRC-32), TOO_MANY_BYTES;
  // ResourceExhausted MEMORY_LIMIT.
  absl::Status Append(uint64_t offset, uint32_t crc32, absl::string_view data);

  // InvalidArgument UPLOAD_INCOMPLETE, or what Mesh::Create() refuses.
  absl::StatusOr<Mesh> Finish() &&;

 private:
  ModelUpload(const Header& header, MemoryBudget& budget);

  // The bytes [offset, offset + size) of the upload.
  void Copy(int64_t offset, int64_t size, void* out) const;
  Positions TakePositions() const;
  absl::StatusOr<Faces> TakeFaces() const;

  Header header_;
  int64_t position_bytes_;
  int64_t total_bytes_;
  int64_t received_ = 0;
  MemoryBudget* budget_;
  std::vector<MemoryBudget::Reservation> memory_;  // One a block.
  std::vector<std::string> blocks_;                // All full but the last.
};

}  // namespace deform::server
