#include "server/rpc/model_chunks.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <string>

namespace deform::server {
namespace {

static_assert(std::endian::native == std::endian::little,
              "numbers are copied as they lie in memory");

constexpr int64_t kMaxBytes = int64_t{1} << 20;

int64_t RowBytes(const Mesh& mesh) {
  return mesh.dimension() * int64_t{sizeof(double)};
}

// Rows [first, ...) of `rows`, the first `columns` of each.
template <typename Rows>
std::string BytesOfRows(const Rows& rows, int64_t first, int64_t columns) {
  const int64_t row_bytes =
      columns * static_cast<int64_t>(sizeof(typename Rows::Scalar));
  const int64_t count = std::min(rows.rows() - first, kMaxBytes / row_bytes);
  std::string bytes;
  bytes.reserve(count * row_bytes);
  for (int64_t i = first; i < first + count; ++i) {
    bytes.append(reinterpret_cast<const char*>(rows.row(i).data()), row_bytes);
  }
  return bytes;
}

}  // namespace

int64_t BytesOfArrays(const Mesh& mesh) {
  return mesh.size() * RowBytes(mesh) +
         mesh.faces().size() * int64_t{sizeof(uint32_t)};
}

v1::ModelChunk ChunkOfArrays(const Mesh& mesh, int64_t offset) {
  const int64_t position_bytes = mesh.size() * RowBytes(mesh);
  v1::ModelChunk chunk;
  chunk.set_offset(offset);
  if (offset < position_bytes) {
    chunk.set_data(BytesOfRows(mesh.positions(), offset / RowBytes(mesh),
                               mesh.dimension()));
  } else {
    const int64_t face = (offset - position_bytes) /
                         (mesh.faces().cols() * int64_t{sizeof(uint32_t)});
    chunk.set_data(BytesOfRows(mesh.faces(), face, mesh.faces().cols()));
  }
  chunk.set_crc32(static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(chunk.data().data()),
            static_cast<uInt>(chunk.data().size()))));
  return chunk;
}

}  // namespace deform::server
