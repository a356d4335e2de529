#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"
#include "server/stores/store.h"

// To add a store: write kinds/<name>.cc, which defines
// `const StoreKind& <Name>StoreKind()`, then add one line here.
#define DEFORM_STORES(X) \
  X(Memory)              \
  X(Sqlite)

namespace deform::server {

#define DEFORM_DECLARE(name) const StoreKind& name##StoreKind();
DEFORM_STORES(DEFORM_DECLARE)
#undef DEFORM_DECLARE

std::span<const StoreKind* const> AllStoreKinds() {
#define DEFORM_ADDRESS(name) &name##StoreKind(),
  static const std::vector<const StoreKind*> kinds = {
      DEFORM_STORES(DEFORM_ADDRESS)};
#undef DEFORM_ADDRESS
  return kinds;
}

absl::StatusOr<const StoreKind*> FindStoreKind(absl::string_view id) {
  for (const StoreKind* kind : AllStoreKinds()) {
    if (kind->id() == id) return kind;
  }
  const std::string known = absl::StrJoin(
      AllStoreKinds(), ", ", [](std::string* out, const StoreKind* kind) {
        absl::StrAppend(out, kind->id());
      });
  return MakeError(
      absl::StatusCode::kNotFound,
      absl::StrCat("no store is called \"", id, "\"; there are ", known),
      {.reason = "UNKNOWN_STORE", .field = "store"});
}

}  // namespace deform::server
