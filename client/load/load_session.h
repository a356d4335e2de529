// One session under load: its editors and viewers, and the frames of it that
// are looked at.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/cpp/client.h"
#include "client/cpp/deform_call.h"
#include "client/load/answer_book.h"
#include "client/load/pose_pattern.h"
#include "client/load/pose_schedule.h"
#include "client/load/recorder.h"
#include "core/base/mutex.h"

namespace deform {

// A frame whose pose is known, to be compared.
struct FrameToCheck {
  int64_t session = 0;              // By number.
  std::vector<uint64_t> sequences;  // Newest pose of each editor in it.
  Frame frame;
};

// What all sessions of a run share. All is borrowed and thread-safe.
struct LoadRoom {
  struct Timing {
    PoseSchedule schedule;
    LoadRecorder* recorder;
  };
  std::function<std::chrono::steady_clock::time_point()> now;
  // 0: no frame is looked at.
  std::chrono::nanoseconds check_interval{0};
  std::function<void(FrameToCheck)> check;
  // Something changed that the run may wait for: a participant has joined, or
  // ended.
  std::function<void()> changed;
  // The run is to end with this.
  std::function<void(const absl::Status&)> fail;
  // Set when poses begin to be due.
  std::atomic<const Timing*> timing{nullptr};
};

class LoadSession {
 public:
  // `editors` of a run are numbered through: those of this session are
  // number, number + sessions, number + 2 sessions ..., so that their phases
  // are far apart.
  LoadSession(LoadRoom& room, int64_t number, int64_t sessions,
              std::string session_id, const PosePattern& pattern, int viewers);
  // Cancels what is under way.
  ~LoadSession();

  // Participants join through `client`, in the order of their number; editors
  // come first.
  void Start(Client& client, int participant, const DeformOptions& options);
  int participants() const { return static_cast<int>(participants_.size()); }

  const std::string& id() const { return id_; }
  const PosePattern& pattern() const { return pattern_; }
  int joined() const;  // Participants that have.
  int ended() const;

  // The editor's pose `sequence` is due: it is sent as soon as those before it
  // are. True if that is not at once.
  bool Due(int editor, uint64_t sequence);
  // No more poses are due: editors end when theirs are answered.
  void CloseEditors();
  void CloseViewers();

  struct Counts {
    int64_t due = 0;
    int64_t sent = 0;
    int64_t answered = 0;
  };
  Counts counts() const;  // Of poses, of the whole run.

 private:
  class Participant;

  void Look(int participant, int editor, const Frame& frame);
  void Resolve() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Fail(const absl::Status& status);

  LoadRoom& room_;
  const int64_t number_;
  const int64_t sessions_;
  const std::string id_;
  const PosePattern& pattern_;
  std::vector<std::unique_ptr<Participant>> participants_;

  Mutex mutex_;
  AnswerBook book_ ABSL_GUARDED_BY(mutex_);
  std::optional<FrameToCheck> candidate_ ABSL_GUARDED_BY(mutex_);
  std::chrono::steady_clock::time_point next_check_ ABSL_GUARDED_BY(mutex_);
  int turn_ ABSL_GUARDED_BY(mutex_) = 0;  // Whose frame is looked at next.
};

}  // namespace deform
