// What several conversions need; for convert*.cc only.
#pragma once

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/mesh/types.h"

namespace deform::server {

inline absl::Status UnknownValue(absl::string_view field, int value) {
  return InvalidInput("UNKNOWN_VALUE", field,
                      absl::StrCat(field, " ", value, " is not known"));
}

// `dimension` numbers of each row.
template <typename Out>
void AddRows(const PositionsRef& positions, int dimension, Out* out) {
  out->Reserve(static_cast<int>(positions.rows()) * dimension);
  for (int64_t i = 0; i < positions.rows(); ++i) {
    for (int c = 0; c < dimension; ++c)
      out->AddAlreadyReserved(positions(i, c));
  }
}

}  // namespace deform::server
