#include "client/cpp/arrays.h"

#include "core/base/status_macros.h"

namespace deform {

absl::StatusOr<Rig> RigOf(const RigArrays& arrays) {
  if (arrays.kind == RigKind::kHandles) {
    DEFORM_ASSIGN_OR_RETURN(
        Handles handles,
        Handles::Create(arrays.dimension, arrays.vertices, arrays.fixed));
    return Rig(std::move(handles));
  }
  DEFORM_ASSIGN_OR_RETURN(
      Cage cage, Cage::Create(arrays.dimension, arrays.vertices, arrays.faces));
  return Rig(std::move(cage));
}

}  // namespace deform
