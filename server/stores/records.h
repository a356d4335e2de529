// What stores keep, as values and bytes.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/deform/pose.h"

namespace deform::server {

// Who has it, and its name among what the tenant has: each 1 to 64 of
// [A-Za-z0-9_-]. Ids of models and bindings are addresses of their content:
// what is stored under one never changes.
struct StoreKey {
  std::string tenant;
  std::string id;
  auto operator<=>(const StoreKey&) const = default;
};

// Times are kept to the microsecond: what is created now.
inline absl::Time TimeToStore() {
  return absl::FromUnixMicros(absl::ToUnixMicros(absl::Now()));
}

// Large arrays by name, each aligned to 64 bytes. Immutable; a copy shares the
// bytes, which live while any copy does.
struct StoredArrays {
  struct Array {
    std::string name;
    std::span<const std::byte> bytes;
  };
  std::vector<Array> arrays;
  std::shared_ptr<const void> owner;

  // Empty if there is none of that name.
  std::span<const std::byte> Find(absl::string_view name) const {
    for (const Array& array : arrays) {
      if (array.name == name) return array.bytes;
    }
    return {};
  }
};

struct StoredModel {
  StoreKey key;
  std::string display_name;
  absl::Time create_time;
};

struct StoredBinding {
  StoreKey key;
  std::string model_id;
  absl::Time create_time;
  std::string request;  // Enough to bind again; bytes of the caller.
  std::string facts;    // What was found out by binding; likewise.
};

// The layout of stored weights: who reads them must know it, or compute them
// again. A name is 1 to 32 of [A-Za-z0-9_-].
struct WeightsForm {
  std::string name;
  uint32_t version = 0;
  bool operator==(const WeightsForm&) const = default;
};

struct StoredWeights {
  WeightsForm form;
  StoredArrays arrays;
};

struct StoredSession {
  StoreKey key;
  std::string binding_id;
  uint64_t epoch = 0;  // Raised by every server that takes the session over.
  std::string resume_token_hash;
  absl::Time create_time;
};

// The newest pose of each client that a revision contains, by a name that the
// client keeps over reconnections.
using AnsweredSequences = std::map<std::string, uint64_t>;

// A session moves on to a revision. A whole pose replaces everything, the
// answers too, so that clients which left are forgotten; a change in part
// replaces the rows and adds or raises the answers that it names.
struct PoseAppend {
  StoreKey session;
  uint64_t epoch = 0;
  uint64_t revision = 0;
  bool whole = true;
  // Of a change in part, each at most once; else empty.
  std::vector<int32_t> rows;
  Positions positions;  // A row for each; V x 3 of a whole pose, model units.
  double stretch_blend = 1;
  AnsweredSequences answers;
  // Where the rig changed: the binding from this revision on. Whole poses only.
  std::string binding_id;
};

// Where a session is.
struct SessionPose {
  std::string binding_id;
  uint64_t epoch = 0;
  uint64_t revision = 0;  // 0: at rest; there is no pose then.
  Pose pose;
  AnsweredSequences answers;
};

// All that a store has, but for arrays and poses.
struct StoreContents {
  std::vector<StoredModel> models;
  std::vector<StoredBinding> bindings;
  std::vector<StoredSession> sessions;
  // DataLoss, each naming what could not be read and is left out above.
  std::vector<absl::Status> damaged;
};

}  // namespace deform::server
