// Normals of the vertices of deformed faces, fast.
//
// ComputeNormals() (normals.h) is the plain way, and the judge: it walks over
// the faces. Here each vertex walks over its own, so that blocks of vertices go
// in parallel and the sums are the same on any number of threads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/thread_pool.h"
#include "core/mesh/types.h"

namespace deform {

// The faces around each vertex of a model. Immutable: made once a model, in
// O(N + F); 24 bytes a face and 8 a vertex.
class VertexFans {
 public:
  // `faces` refer to points below `points`.
  VertexFans(const Faces& faces, int64_t points);

  int64_t points() const { return static_cast<int64_t>(begin_.size()) - 1; }

  // The two bytes (normals.h) of each vertex's normal at `positions`, N x 3: 2
  // N bytes. Blocks of vertices in parallel on `pool`, which may be null.
  void EncodeNormals(std::span<const float> positions, std::span<uint8_t> bytes,
                     ThreadPool* pool) const;

 private:
  // A face around a vertex v: (v, next, last), turning as the face does.
  struct Corner {
    int32_t next, last;
  };

  std::vector<Corner> corners_;  // Of a vertex, then of the next.
  std::vector<int64_t> begin_;   // N + 1: where those of a vertex begin.
};

}  // namespace deform
