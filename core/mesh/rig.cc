#include "core/mesh/rig.h"

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform {

absl::Status CheckSameDimension(const Mesh& model, int rig_dimension) {
  if (model.dimension() == rig_dimension) return absl::OkStatus();
  return InvalidInput("DIMENSION_MISMATCH", "rig",
                      absl::StrCat("the model is ", model.dimension(),
                                   "D and its rig ", rig_dimension, "D"));
}

}  // namespace deform
