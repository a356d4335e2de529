#include "client/cli/player.h"

#include <algorithm>
#include <thread>

#include "core/base/mutex.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

using Clock = std::chrono::steady_clock;

// One thread sends, one receives; this is what both know.
class Player {
 public:
  Player(DeformStream& stream, const PlayOptions& options)
      : stream_(stream), options_(options) {}

  absl::Status Send(
      const std::function<absl::StatusOr<PoseUpdate>(int64_t)>& pose) {
    const Clock::time_point start = Clock::now();
    for (int64_t i = 0; i < options_.poses; ++i) {
      if (options_.interrupted != nullptr && *options_.interrupted) {
        return absl::CancelledError("interrupted");
      }
      DEFORM_ASSIGN_OR_RETURN(const PoseUpdate update, pose(i));
      if (options_.rate > 0) {
        std::this_thread::sleep_until(
            start + std::chrono::duration_cast<Clock::duration>(
                        std::chrono::duration<double>(static_cast<double>(i) /
                                                      options_.rate)));
      }
      if (!WaitForRoom()) return absl::OkStatus();
      // The receiver knows why, if the stream has ended.
      // Poses are made for the rig as it was at the beginning.
      if (!stream_.Send(update, 0).ok()) return absl::OkStatus();
    }
    return absl::OkStatus();
  }

  absl::Status Receive(
      const std::function<absl::Status(const Frame&)>& frame_done) {
    Frame frame;
    while (true) {
      absl::Status status = stream_.NextFrame(frame);
      if (status.ok() && frame.answers_sequence == 0) continue;
      if (status.ok()) status = frame_done(frame);
      MutexLock lock(mutex_);
      if (status.ok()) {
        Count(frame);
      } else {
        ended_ = true;
      }
      changed_.NotifyAll();
      if (status.ok()) continue;
      return absl::IsOutOfRange(status) && stream_.ended() ? absl::OkStatus()
                                                           : status;
    }
  }

  PlayReport Report() {
    MutexLock lock(mutex_);
    PlayReport report = report_;
    report.poses_sent = static_cast<int64_t>(sent_.size());
    if (!sent_.empty()) {
      report.seconds =
          std::chrono::duration<double>(last_ - sent_.front()).count();
    }
    std::sort(report.latencies_ms.begin(), report.latencies_ms.end());
    return report;
  }

 private:
  // Also notes that a pose is being sent now.
  bool WaitForRoom() {
    MutexLock lock(mutex_);
    while (!ended_ && sent_.size() >= answered_ + options_.in_flight) {
      changed_.Wait(mutex_);
    }
    if (!ended_) sent_.push_back(Clock::now());
    return !ended_;
  }

  void Count(const Frame& frame) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    last_ = Clock::now();
    answered_ = std::max(answered_, frame.answers_sequence);
    if (frame.answers_sequence <= sent_.size()) {
      report_.latencies_ms.push_back(
          std::chrono::duration<double, std::milli>(
              last_ - sent_[frame.answers_sequence - 1])
              .count());
    }
    ++report_.frames;
    report_.skipped_revisions += frame.skipped_revisions;
    report_.bytes += frame.bytes;
    ++report_.encodings[frame.encoding];
    report_.deform_us += frame.deform_us;
    report_.columns_applied += frame.columns_applied;
    report_.exit_mismatch_max =
        std::max(report_.exit_mismatch_max, frame.exit_mismatch);
  }

  DeformStream& stream_;
  const PlayOptions& options_;
  Mutex mutex_;
  CondVar changed_;
  // When each pose was sent, by sequence from 1.
  std::vector<Clock::time_point> sent_ ABSL_GUARDED_BY(mutex_);
  uint64_t answered_ ABSL_GUARDED_BY(mutex_) = 0;
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;
  Clock::time_point last_ ABSL_GUARDED_BY(mutex_);
  PlayReport report_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace

double PlayReport::LatencyMs(double part) const {
  if (latencies_ms.empty()) return 0;
  const auto last = static_cast<double>(latencies_ms.size() - 1);
  return latencies_ms[static_cast<size_t>(std::lround(part * last))];
}

absl::StatusOr<PlayReport> Play(
    DeformStream& stream, const PlayOptions& options,
    const std::function<absl::StatusOr<PoseUpdate>(int64_t)>& pose,
    const std::function<absl::Status(const Frame&)>& frame) {
  Player player(stream, options);
  absl::Status received;
  std::thread receiver([&] {
    received = player.Receive(frame);
    // Whatever the reason, the sender is not to write into the void.
    if (!received.ok()) stream.Cancel();
  });
  const absl::Status sent = player.Send(pose);
  if (sent.ok()) {
    stream.Close();
  } else {
    stream.Cancel();
  }
  receiver.join();
  DEFORM_RETURN_IF_ERROR(sent);
  DEFORM_RETURN_IF_ERROR(received);
  return player.Report();
}

}  // namespace deform::cli
