// Poses of a session one after the other, and as bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "server/stores/records.h"

namespace deform::server {

// Where a session's appends have come to.
struct PoseHead {
  int64_t session = 0;  // A number that no other session ever has.
  uint64_t epoch = 0;
  uint64_t accepted = 0;  // Revisions.
  uint64_t durable = 0;
  int64_t rows = 0;  // V of the pose accepted last; 0: none yet.
};

// Whether `append`, made after revision `after`, may be next, as
// Store::Append() has it: STALE_EPOCH, STALE_REVISION, REVISION_GAP, BAD_POSE.
absl::Status CheckFollows(const PoseAppend& append, uint64_t after,
                          const PoseHead& head);

// `into`, then `next`, as one append: of the same session and epoch, one right
// after the other.
void Fold(const PoseAppend& next, PoseAppend& into);

// The session once `append` has happened. `append` is whole, or `pose` has its
// rows.
void Apply(const PoseAppend& append, SessionPose& pose);
// All of `pose` as one append.
PoseAppend WholeOf(const StoreKey& session, const SessionPose& pose);

// Memory, roughly.
int64_t BytesOf(const PoseAppend& append);

// Sealed; without the key, which stands beside it.
std::string EncodePose(const PoseAppend& append);
// Nothing if it is not what was written.
std::optional<PoseAppend> DecodePose(std::span<const std::byte> bytes);

}  // namespace deform::server
