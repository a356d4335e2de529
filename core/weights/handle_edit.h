// Handles added, moved at rest and removed: the open problem that [C16] section
// 8 names.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/handles.h"
#include "core/mesh/types.h"
#include "core/weights/scheme.h"

namespace deform {

struct HandleEdit {
  enum class Kind { kAdd, kMove, kRemove };
  Kind kind = Kind::kAdd;
  // kMove, kRemove: a free handle, by its row before any of the edits.
  int64_t handle = -1;
  // kAdd, kMove: its place at rest; z = 0 in 2D.
  Vec3 position = Vec3::Zero();
  // kAdd: T-CC's user weight s.
  double weight = 0;
};

// A rig of handles as it was edited: those that are left, in their order, then
// the new ones, then the fixed ones.
struct EditedHandles {
  Handles handles;
  SchemeOptions options;
  // Of each free handle: which one it was before, or -1 if it is new.
  std::vector<int32_t> previous;
};

// All edits at once: rows are those before the first of them. InvalidArgument
// NO_EDITS, INDEX_OUT_OF_RANGE, FIXED_HANDLE, HANDLE_EDITED_TWICE, and what
// Handles::Create() refuses. User weights that are out of range are for the
// scheme to refuse.
absl::StatusOr<EditedHandles> EditHandles(const Handles& handles,
                                          const SchemeOptions& options,
                                          std::span<const HandleEdit> edits);

}  // namespace deform
