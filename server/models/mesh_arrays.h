// Models as a store keeps them.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"
#include "server/stores/records.h"

namespace deform::server {

// The arrays of the mesh themselves; nothing is copied.
StoredArrays ArraysOf(std::shared_ptr<const Mesh> mesh);

// DataLoss FILE_DAMAGED if they are not those of a mesh.
absl::StatusOr<Mesh> MeshFrom(const StoredArrays& arrays);

}  // namespace deform::server
