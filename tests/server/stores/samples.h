// Small values to store.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "core/base/error.h"
#include "server/stores/bytes.h"
#include "server/stores/store.h"

namespace deform::server {

inline StoreKey Key(const std::string& id, const std::string& tenant = "ann") {
  return {tenant, id};
}

// One array that holds `text`, and an empty one.
inline StoredArrays ArraysOf(const std::string& text) {
  auto owner = std::make_shared<const std::string>(text);
  return {.arrays = {{"text", AsBytes(*owner)}, {"none", {}}}, .owner = owner};
}
inline std::string TextOf(const StoredArrays& arrays) {
  const auto bytes = arrays.Find("text");
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

inline StoredModel ModelOf(const StoreKey& key) {
  return {.key = key,
          .display_name = "the " + key.id,
          .create_time = absl::FromUnixSeconds(1700000000)};
}
inline StoredBinding BindingOf(const StoreKey& key,
                               const std::string& model_id) {
  return {.key = key,
          .model_id = model_id,
          .create_time = absl::FromUnixSeconds(1700000001),
          .request = "request of " + key.id,
          .facts = "facts of " + key.id};
}
inline StoredSession SessionOf(const StoreKey& key,
                               const std::string& binding_id) {
  return {.key = key,
          .binding_id = binding_id,
          .epoch = 1,
          .resume_token_hash = "hash of " + key.id,
          .create_time = absl::FromUnixSeconds(1700000002)};
}

// Every coordinate of `rows` rows is `value`.
inline PoseAppend Whole(const StoreKey& session, uint64_t revision,
                        double value, int rows = 3, uint64_t epoch = 1) {
  return {.session = session,
          .epoch = epoch,
          .revision = revision,
          .positions = Positions::Constant(rows, 3, value)};
}
inline PoseAppend Part(const StoreKey& session, uint64_t revision, int row,
                       double value, uint64_t epoch = 1) {
  return {.session = session,
          .epoch = epoch,
          .revision = revision,
          .whole = false,
          .rows = {row},
          .positions = Positions::Constant(1, 3, value)};
}

inline std::string ReasonOf(const absl::Status& status) {
  return DetailOf(status).reason;
}

// "model", a binding "bound" of it and a session "live" of that.
inline void PutChain(Store& store, const std::string& tenant = "ann") {
  ASSERT_TRUE(
      store.PutModel(ModelOf(Key("model", tenant)), ArraysOf("mesh")).ok());
  ASSERT_TRUE(store.PutBinding(BindingOf(Key("bound", tenant), "model")).ok());
  ASSERT_TRUE(store.PutSession(SessionOf(Key("live", tenant), "bound")).ok());
}

}  // namespace deform::server
