// Models as messages of DownloadModel.
#pragma once

#include <cstdint>

#include "core/mesh/mesh.h"
#include "deform/v1/model.pb.h"

namespace deform::server {

// Bytes of the arrays as they are uploaded: float64 positions by vertex, then
// uint32 corners by face.
int64_t BytesOfArrays(const Mesh& mesh);

// The chunk that begins at `offset`, where another ends: as many whole vertices
// or faces as 1 MiB holds.
v1::ModelChunk ChunkOfArrays(const Mesh& mesh, int64_t offset);

}  // namespace deform::server
