#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"
#include "core/weights/scheme.h"

// To add a scheme: write schemes/<name>.cc, which defines
// `const CoordinateScheme& <Name>Scheme()`, then add one line here.
#define DEFORM_SCHEMES(X) \
  X(Green)                \
  X(TranslationCelestial) \
  X(ScalingCelestial)     \
  X(MeanValue)

namespace deform {

#define DEFORM_DECLARE(name) const CoordinateScheme& name##Scheme();
DEFORM_SCHEMES(DEFORM_DECLARE)
#undef DEFORM_DECLARE

std::span<const CoordinateScheme* const> AllSchemes() {
#define DEFORM_ADDRESS(name) &name##Scheme(),
  static const std::vector<const CoordinateScheme*> schemes = {
      DEFORM_SCHEMES(DEFORM_ADDRESS)};
#undef DEFORM_ADDRESS
  return schemes;
}

absl::StatusOr<const CoordinateScheme*> FindScheme(absl::string_view id) {
  for (const CoordinateScheme* scheme : AllSchemes()) {
    if (scheme->id() == id) return scheme;
  }
  const std::string known = absl::StrJoin(
      AllSchemes(), ", ", [](std::string* out, const CoordinateScheme* scheme) {
        absl::StrAppend(out, scheme->id());
      });
  return MakeError(absl::StatusCode::kNotFound,
                   absl::StrCat("no scheme is called \"", id,
                                "\"; this server knows ", known),
                   {.reason = "UNKNOWN_SCHEME",
                    .field = "scheme",
                    .resource_type = "scheme",
                    .resource_name = std::string(id)});
}

}  // namespace deform
