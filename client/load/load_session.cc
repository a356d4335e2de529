#include "client/load/load_session.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform {

// Counts what is due and what is sent; a pose is made when it is sent, so that
// a backlog takes no memory.
class LoadSession::Participant final : public DeformEvents {
 public:
  Participant(LoadSession& session, int place, int editor)
      : session_(session), place_(place), editor_(editor) {}

  void Start(Client& client, const DeformOptions& options) {
    call_ = client.StartDeform(session_.id_, options, *this);
  }
  void Stop() {
    {
      MutexLock lock(mutex_);
      stopped_ = true;
    }
    call_.reset();
  }

  bool Due(uint64_t sequence) {
    MutexLock lock(mutex_);
    due_ = sequence;
    Send();
    return sent_ < due_;
  }

  void Close() {
    MutexLock lock(mutex_);
    closing_ = true;
    Send();
  }

  bool joined() const { return joined_; }
  bool ended() const { return ended_; }
  Counts counts() const {
    MutexLock lock(mutex_);
    return {static_cast<int64_t>(due_), static_cast<int64_t>(sent_),
            static_cast<int64_t>(answered_)};
  }

  void OnJoined(const JoinedSession& /*joined*/) override {
    joined_ = true;
    session_.room_.changed();
  }

  void OnFrame(const Frame& frame) override {
    const auto now = session_.room_.now();
    if (const auto* timing = session_.room_.timing.load()) {
      timing->recorder->Arrived(now, frame.bytes, frame.skipped_revisions,
                                frame.answers_sequence > told_,
                                frame.deform_us);
      for (uint64_t s = told_ + 1; s <= frame.answers_sequence; ++s) {
        timing->recorder->Answered(timing->schedule.TimeOf(number(), s), now);
      }
    }
    told_ = frame.answers_sequence;
    {
      MutexLock lock(mutex_);
      answered_ = told_;
    }
    session_.Look(place_, editor_, frame);
  }

  void OnRejected(uint64_t sequence, const absl::Status& status) override {
    session_.Fail(
        Annotate(status, absl::StrCat("pose ", sequence, " was rejected: ")));
  }

  void OnRigChange(const RigChange& /*change*/) override {
    session_.Fail(absl::FailedPreconditionError(
        "its rig was edited by somebody during the run"));
  }

  void OnSent() override {
    MutexLock lock(mutex_);
    under_way_ = false;
    Send();
  }

  void OnEnd(const absl::Status& status) override {
    ended_ = true;
    if (!status.ok() && !stopped()) session_.Fail(status);
    session_.room_.changed();
  }

 private:
  bool stopped() const {
    MutexLock lock(mutex_);
    return stopped_;
  }
  // Of the editors of the run.
  int64_t number() const {
    return session_.number_ + editor_ * session_.sessions_;
  }

  void Send() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (under_way_ || stopped_) return;
    if (sent_ < due_) {
      under_way_ = call_->Send(
          session_.pattern_.At(session_.number_, editor_, sent_ + 1));
      if (under_way_) ++sent_;
    } else if (closing_) {
      call_->Close();
    }
  }

  LoadSession& session_;
  const int place_;
  const int editor_;  // Of the session; -1: a viewer.
  std::unique_ptr<DeformCall> call_;
  std::atomic<bool> joined_{false};
  std::atomic<bool> ended_{false};
  uint64_t told_ = 0;  // The events' own.

  mutable Mutex mutex_;
  uint64_t due_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t sent_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t answered_ ABSL_GUARDED_BY(mutex_) = 0;
  bool under_way_ ABSL_GUARDED_BY(mutex_) = false;
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  bool stopped_ ABSL_GUARDED_BY(mutex_) = false;
};

LoadSession::LoadSession(LoadRoom& room, int64_t number, int64_t sessions,
                         std::string session_id, const PosePattern& pattern,
                         int viewers)
    : room_(room),
      number_(number),
      sessions_(sessions),
      id_(std::move(session_id)),
      pattern_(pattern),
      book_(pattern.editors()),
      // Spread, so that not all sessions are looked at in the same moment.
      next_check_(room.now() + number * room.check_interval /
                                   std::max<int64_t>(1, sessions)) {
  for (int p = 0; p < pattern.editors() + viewers; ++p) {
    participants_.push_back(std::make_unique<Participant>(
        *this, p, p < pattern.editors() ? p : -1));
  }
}

LoadSession::~LoadSession() {
  for (const auto& participant : participants_) participant->Stop();
}

void LoadSession::Start(Client& client, int participant,
                        const DeformOptions& options) {
  participants_[participant]->Start(client, options);
}

int LoadSession::joined() const {
  return static_cast<int>(
      std::count_if(participants_.begin(), participants_.end(),
                    [](const auto& p) { return p->joined(); }));
}

int LoadSession::ended() const {
  return static_cast<int>(
      std::count_if(participants_.begin(), participants_.end(),
                    [](const auto& p) { return p->ended(); }));
}

bool LoadSession::Due(int editor, uint64_t sequence) {
  return participants_[editor]->Due(sequence);
}

void LoadSession::CloseEditors() {
  for (int e = 0; e < pattern_.editors(); ++e) participants_[e]->Close();
}

void LoadSession::CloseViewers() {
  for (int p = pattern_.editors(); p < participants(); ++p) {
    participants_[p]->Close();
  }
}

LoadSession::Counts LoadSession::counts() const {
  Counts all;
  for (const auto& participant : participants_) {
    const Counts counts = participant->counts();
    all.due += counts.due;
    all.sent += counts.sent;
    all.answered += counts.answered;
  }
  return all;
}

void LoadSession::Look(int participant, int editor, const Frame& frame) {
  if (room_.check_interval.count() == 0) return;
  const auto now = room_.now();
  MutexLock lock(mutex_);
  if (editor >= 0) book_.Note(editor, frame.revision, frame.answers_sequence);
  if (candidate_) Resolve();
  if (candidate_ || frame.revision == 0 || now < next_check_) return;
  // Participants take turns; who gets no frames is passed over in time.
  if (participant != turn_ && now < next_check_ + room_.check_interval) return;
  candidate_ = FrameToCheck{.session = number_, .frame = frame};
  Resolve();
}

void LoadSession::Resolve() {
  switch (book_.Find(candidate_->frame.revision, candidate_->sequences)) {
    case AnswerBook::Known::kNotYet:
      return;
    case AnswerBook::Known::kNever:
      break;  // The next frame instead.
    case AnswerBook::Known::kYes:
      next_check_ = room_.now() + room_.check_interval;
      turn_ = (turn_ + 1) % participants();
      room_.check(std::move(*candidate_));
  }
  candidate_.reset();
}

void LoadSession::Fail(const absl::Status& status) {
  room_.fail(Annotate(status, absl::StrCat("session ", id_, ": ")));
}

}  // namespace deform
