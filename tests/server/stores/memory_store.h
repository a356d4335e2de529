#pragma once

#include <memory>

#include "server/stores/store.h"

namespace deform::server {

// Keeps nothing beyond itself.
inline std::unique_ptr<Store> MemoryStore() {
  return (*FindStoreKind("memory"))->Open({}).value();
}

}  // namespace deform::server
