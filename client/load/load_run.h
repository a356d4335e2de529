// Puts load on a server and measures what comes back.
//
// Open loop: every pose is due at a time that is fixed beforehand, and its
// latency counts from then to the arrival of the first frame that contains it.
// A server that stalls is not spared: what was due meanwhile has waited. (Gil
// Tene calls the mistake of sparing it coordinated omission.)
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cpp/client.h"
#include "client/load/frame_checker.h"
#include "client/load/frame_judge.h"
#include "client/load/pose_pattern.h"
#include "client/load/recorder.h"

namespace deform {

struct LoadOptions {
  int64_t sessions = 1;
  int editors = 1;   // Of each session.
  int viewers = 0;   // Likewise.
  double rate = 60;  // Poses a second of an editor.
  // Frames a second of a viewer, at most, with Delivery::kLatest; 0: as they
  // come.
  double viewer_fps = 0;
  DeformOptions frames;
  std::chrono::nanoseconds duration{std::chrono::seconds(10)};
  std::chrono::nanoseconds warm_up{std::chrono::seconds(1)};
  // Every session is looked at once in this time; 0: never.
  std::chrono::nanoseconds check_interval{std::chrono::seconds(1)};
  // How long the last poses may take to be answered.
  std::chrono::nanoseconds patience{std::chrono::seconds(10)};
};

// What sessions pose; they are shared out among the targets. Immutable.
struct LoadTarget {
  std::string binding_id;
  int64_t point_count = 0;
  std::shared_ptr<const PosePattern> pattern;
  std::shared_ptr<const FrameJudge> judge;  // Null: frames are not checked.
  // That participants hold; may be none.
  HeldBinding weights = {};
  HeldBasis basis = {};
};

// A part of the run as it goes on.
struct LoadProgress {
  double seconds = 0;  // Since poses are due, warm-up included.
  double total = 0;
  LoadFigures figures;
  std::optional<ServerStatus> server;
};

struct LoadControl {
  const std::atomic<bool>* interrupted = nullptr;
  // Called on the calling thread, a few times a second; may be empty.
  std::function<void(const LoadProgress&)> progress;
};

// What the server told of itself, once a second.
struct ServerSample {
  double seconds = 0;  // Since the measured window began.
  int64_t resident_bytes = 0;
  int64_t open_files = 0;
};

struct LoadReport {
  LoadFigures figures;
  double seconds = 0;  // Of the measured window.
  int64_t connections = 0;
  // Of the whole run, warm-up included.
  int64_t poses_due = 0;
  int64_t poses_sent = 0;
  int64_t poses_answered = 0;
  FrameChecker::Findings checks;
  int64_t sessions_unchecked = 0;  // No frame's pose could be told.
  std::string wrong_session;       // The id of checks.wrong.
  // Of the window; 0 if the server does not tell.
  double server_cpus = 0;  // CPU seconds a second.
  std::vector<ServerSample> server_over_time;
  int server_processors = 0;
  double client_cpus = 0;

  // Poses that this program sent later than a millisecond after they were due,
  // as a part of all. If it is more than a hundredth the figures are about this
  // program as much as about the server.
  double LatePart() const;
  bool kept_schedule() const { return LatePart() <= 0.01; }
  bool complete() const { return poses_answered == poses_due; }
};

// Opens the sessions, drives them, deletes them. The participants of all are
// shared out among `clients`, of which there is at least one. `control` of the
// run is its first. Errors:
//   Cancelled  interrupted
//   DeadlineExceeded  not all joined in time
//   what a session ended with, or why the server refused one
// A wrong frame ends the run early, and is no error: the report tells.
absl::StatusOr<LoadReport> RunLoad(std::vector<Client>& clients,
                                   const std::vector<LoadTarget>& targets,
                                   const LoadOptions& options,
                                   const LoadControl& control);

}  // namespace deform
