// Whether faces form closed, oriented surfaces (2D: loops).
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/mesh/types.h"

namespace deform {

// `faces` are triangles or directed edges whose corners are below `vertices`
// and differ within a face. Refuses, naming the edge (2D: the vertex) and its
// faces, with CAGE_NOT_CLOSED, CAGE_NOT_MANIFOLD or
// CAGE_INCONSISTENT_ORIENTATION; see Cage::Create. O(F log F).
absl::Status CheckClosed(const Faces& faces, int64_t vertices,
                         absl::string_view field);

// The same for edges that may still be turned: CAGE_NOT_CLOSED and
// CAGE_NOT_MANIFOLD only. `edges` is E x 2.
absl::Status CheckLoopsEitherWay(const Faces& edges, int64_t vertices,
                                 absl::string_view field);

}  // namespace deform
