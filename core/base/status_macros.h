// Return early on errors.
//
//   DEFORM_RETURN_IF_ERROR(Check(x));
//   DEFORM_ASSIGN_OR_RETURN(const Mesh mesh, Mesh::Create(...));
#pragma once

#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#define DEFORM_RETURN_IF_ERROR(expression)                                \
  do {                                                                    \
    if (absl::Status deform_status = (expression); !deform_status.ok()) { \
      return deform_status;                                               \
    }                                                                     \
  } while (false)

#define DEFORM_ASSIGN_OR_RETURN(declaration, expression)              \
  DEFORM_ASSIGN_OR_RETURN_AS(DEFORM_CONCAT(deform_result_, __LINE__), \
                             declaration, expression)

#define DEFORM_ASSIGN_OR_RETURN_AS(result, declaration, expression) \
  auto result = (expression);                                       \
  if (!result.ok()) return std::move(result).status();              \
  declaration = *std::move(result)

#define DEFORM_CONCAT(a, b) DEFORM_CONCAT_INNER(a, b)
#define DEFORM_CONCAT_INNER(a, b) a##b
