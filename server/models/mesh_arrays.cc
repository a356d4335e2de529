#include "server/models/mesh_arrays.h"

#include <cstring>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "server/stores/bytes.h"

namespace deform::server {
namespace {

constexpr uint64_t kVersion = 1;

absl::Status NotAMesh(absl::string_view how) {
  return MakeError(absl::StatusCode::kDataLoss,
                   absl::StrCat("the stored arrays are not a model: ", how),
                   {.reason = "FILE_DAMAGED", .resource_type = "file"});
}

template <typename Matrix>
std::span<const std::byte> BytesOf(const Matrix& matrix) {
  return std::as_bytes(
      std::span(matrix.data(), static_cast<size_t>(matrix.size())));
}

// True if `bytes` are as many as `matrix` holds.
template <typename Matrix>
bool Fill(std::span<const std::byte> bytes, Matrix& matrix) {
  if (bytes.size() != BytesOf(matrix).size()) return false;
  if (!bytes.empty()) std::memcpy(matrix.data(), bytes.data(), bytes.size());
  return true;
}

}  // namespace

StoredArrays ArraysOf(std::shared_ptr<const Mesh> mesh) {
  struct Owned {
    std::shared_ptr<const Mesh> mesh;
    std::string shape;
  };
  ByteWriter shape;
  shape.Add(kVersion)
      .Add(static_cast<uint64_t>(mesh->dimension()))
      .Add(static_cast<uint64_t>(mesh->size()))
      .Add(static_cast<uint64_t>(mesh->faces().rows()))
      .Add(static_cast<uint64_t>(mesh->faces().cols()));
  const auto owned = std::make_shared<const Owned>(
      Owned{.mesh = std::move(mesh), .shape = shape.Take()});
  return {.arrays = {{"shape", AsBytes(owned->shape)},
                     {"positions", BytesOf(owned->mesh->positions())},
                     {"faces", BytesOf(owned->mesh->faces())}},
          .owner = owned};
}

absl::StatusOr<Mesh> MeshFrom(const StoredArrays& arrays) {
  ByteReader shape(arrays.Find("shape"));
  if (shape.U64() != kVersion) return NotAMesh("another version wrote them");
  const uint64_t dimension = shape.U64();
  const uint64_t points = shape.U64();
  const uint64_t faces = shape.U64();
  const uint64_t corners = shape.U64();
  const auto position_bytes = arrays.Find("positions");
  const auto face_bytes = arrays.Find("faces");
  // Before anything is allocated for them.
  if (!shape.done() || dimension > 3 || corners > 3 ||
      points > position_bytes.size() || faces > face_bytes.size()) {
    return NotAMesh("the shape does not fit the arrays");
  }
  Positions positions(static_cast<int64_t>(points), 3);
  Faces indices(static_cast<int64_t>(faces), static_cast<int64_t>(corners));
  if (!Fill(position_bytes, positions) || !Fill(face_bytes, indices)) {
    return NotAMesh("the arrays are of another size");
  }
  return Mesh::Create(static_cast<int>(dimension), std::move(positions),
                      std::move(indices));
}

}  // namespace deform::server
