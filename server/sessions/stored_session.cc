// A session and its store: asleep at the start, awake when somebody wants it,
// told of every revision, lost to another server.
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/models/losses.h"
#include "server/models/names.h"
#include "server/sessions/session.h"

namespace deform::server {

absl::StatusOr<std::shared_ptr<Session>> Session::Restore(
    StoredStart start, BindingCatalogue::Lease binding,
    MemoryBudget::Reservation memory, const SessionEnvironment& environment) {
  const Rig& rig = binding.record()->facts.rig();
  if (start.at.revision == 0) start.at.pose = RestPose(rig);
  const int64_t rows = start.at.pose.vertices.rows();
  if (rows != RestVertices(rig).rows()) {
    return Damaged("session", start.id,
                   absl::DataLossError(absl::StrCat("its pose has ", rows,
                                                    " rows, its rig ",
                                                    RestVertices(rig).rows())),
                   "create it again");
  }
  return std::shared_ptr<Session>(
      new Session(std::move(start), BindingInUse{.lease = std::move(binding)},
                  std::move(memory), environment));
}

void Session::WakeUp(FindWeights find_weights) {
  std::shared_ptr<const BindingRecord> record;
  Pose pose;
  {
    MutexLock lock(mutex_);
    record = lease_.record();
    if (record == nullptr) return;  // It has ended.
    pose = pose_;  // Nothing moves it while the session sleeps.
  }
  const auto binding = find_weights(record);
  if (binding.ok()) {
    auto deformer =
        std::make_unique<Deformer>(*binding, nullptr, *environment_.drags);
    DeformJob job{.deformer = deformer.get(), .pose = &pose};
    MoveTogether({&job, 1}, nullptr);
    deformer_ = std::move(deformer);
    info_.weight_error = job.report.error_bound;
  }
  Receivers receivers;
  std::deque<RigMove> moves;
  {
    MutexLock lock(mutex_);
    waking_ = false;
    if (binding.ok()) {
      SetWeights(*binding);
      Schedule();
      return;
    }
    queue_.Clear();
    moves.swap(moves_);
    audience_.EndNow(binding.status());
    receivers = audience_.receivers();
  }
  for (const RigMove& move : moves) move.done(binding.status());
  Wake(receivers);
}

void Session::Journal(const Step& step, const Pose& before) {
  const absl::Status status = journal_.Append(
      {.number = revision_,
       .before = &before,
       .now = &pose_,
       .binding_id = binding_id_,
       .rig_changed = step.change != nullptr,
       .answers = environment_.store == nullptr ? AnsweredSequences()
                                                : roster_.Answers()});
  if (!status.ok()) lost_ = status;
}

void Session::EndIfLost() {
  std::optional<absl::Status> lost;
  {
    MutexLock lock(mutex_);
    lost.swap(lost_);
  }
  if (!lost) return;
  if (absl::IsNotFound(*lost)) return End(SessionDeleted(id_));
  End(MakeError(
      absl::StatusCode::kUnavailable,
      absl::StrCat("the session is another server's by now: join it there (",
                   lost->message(), ")"),
      {.reason = "SESSION_TAKEN_OVER",
       .resource_type = "session",
       .resource_name = id_}));
}

absl::Status SessionDeleted(const std::string& id) {
  return MakeError(absl::StatusCode::kNotFound,
                   absl::StrCat("session ", Quoted(id), " was deleted"),
                   {.reason = "SESSION_DELETED",
                    .resource_type = "session",
                    .resource_name = id});
}

}  // namespace deform::server
