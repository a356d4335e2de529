// Drives poses through a stream and measures what comes back.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cpp/deform_stream.h"

namespace deform::cli {

struct PlayOptions {
  int64_t poses = 0;
  // Poses sent and not yet answered, at most.
  int in_flight = 4;
  // Poses per second; 0: as fast as the frames come.
  double rate = 0;
  const std::atomic<bool>* interrupted = nullptr;
};

struct PlayReport {
  int64_t poses_sent = 0;
  int64_t frames = 0;  // That answer poses.
  uint64_t skipped_revisions = 0;
  double seconds = 0;  // From the first pose to the last frame.
  int64_t bytes = 0;   // Of positions, encoded.
  std::map<std::string, int64_t> encodings;  // How many frames came in each.
  int64_t deform_us = 0;
  int64_t columns_applied = 0;
  double exit_mismatch_max = 0;
  std::vector<double> latencies_ms;  // Pose sent to frame complete, sorted.

  // Of the latencies, `part` from 0 to 1; 0 if there are none.
  double LatencyMs(double part) const;
};

// Sends pose(0), pose(1), ... and passes every frame that answers one to
// `frame`, which is called on another thread and may return an error to end the
// play. Ends when every pose is answered.
absl::StatusOr<PlayReport> Play(
    DeformStream& stream, const PlayOptions& options,
    const std::function<absl::StatusOr<PoseUpdate>(int64_t)>& pose,
    const std::function<absl::Status(const Frame&)>& frame);

}  // namespace deform::cli
