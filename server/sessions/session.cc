#include "server/sessions/session.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/frames/normals.h"
#include "server/models/names.h"

namespace deform::server {
namespace {

// The origin of frames follows the rig in steps of this, in units of D: float
// positions relative to it then keep seven digits of the model's size, and most
// frames need no new origin.
constexpr double kOriginStep = 0.25;

// The largest distance between the deformed points of two deformers of a model.
double LargestJump(const Deformer& from, const Deformer& to) {
  return (to.positions() - from.positions()).rowwise().norm().maxCoeff();
}

}  // namespace

std::shared_ptr<Session> Session::Create(
    std::string id, BindingInUse binding, MemoryBudget::Reservation memory,
    const SessionEnvironment& environment) {
  const Rig& rig = binding.lease.record()->facts.rig();
  return std::shared_ptr<Session>(
      new Session({.id = std::move(id),
                   .at = {.epoch = 1, .pose = RestPose(rig)},
                   .create_time = TimeToStore()},
                  std::move(binding), std::move(memory), environment));
}

Session::Session(StoredStart start, BindingInUse use,
                 MemoryBudget::Reservation memory,
                 const SessionEnvironment& environment)
    : id_(std::move(start.id)),
      tenant_(use.lease.record()->tenant),
      dimension_(use.lease.record()->facts.dimension()),
      create_time_(start.create_time),
      environment_(environment),
      frame_maker_(environment.frame_tables),
      memory_(std::move(memory)),
      lease_(std::move(use.lease)),
      binding_id_(lease_.record()->id),
      weights_(std::move(use.binding)),
      queue_(start.at.pose),
      revision_(start.at.revision),
      pose_(std::move(start.at.pose)),
      journal_(environment.store, {tenant_, id_}, start.at.epoch,
               start.at.revision, environment.report),
      roster_(PoseRows(facts().rig()), environment.max_participants,
              environment.resume_grace) {
  roster_.Restore(start.at.answers, environment_.clock());
  if (weights_ != nullptr) {
    deformer_ =
        std::make_unique<Deformer>(weights_, nullptr, *environment_.drags);
  }
  info_.revision = revision_;
  info_.origin = BoxOf(pose_.vertices).center();
  info_.origin_number = 1;
  MutexLock lock(mutex_);
  audience_.SetWeights({.binding = binding_id_});
}

void Session::ProvideBasis() {
  std::shared_ptr<const Binding> weights;
  {
    MutexLock lock(mutex_);
    if (!wants_basis_ || basis_ != nullptr || weights_ == nullptr) return;
    weights = weights_;
  }
  auto basis = environment_.frame_tables->BasisOf(weights);
  if (basis == nullptr) return;
  MutexLock lock(mutex_);
  if (weights_ == weights) SetWeights(std::move(weights), std::move(basis));
}

void Session::SetWeights(std::shared_ptr<const Binding> weights,
                         std::shared_ptr<const NamedBasis> basis) {
  weights_ = std::move(weights);
  basis_ = std::move(basis);
  audience_.SetWeights(
      {.binding = binding_id_, .basis = basis_ != nullptr ? basis_->id : ""});
}

int64_t Session::BytesFor(const BindingFacts& binding) {
  const int64_t columns = binding.column_count();
  // Displacements of double, places of float, two frames of these with normals,
  // two grids, columns and a few poses.
  return binding.point_count() * 3 *
             int64_t{sizeof(double) + 3 * sizeof(float) + 2 * sizeof(int32_t)} +
         binding.point_count() * 2 * kNormalBytes +
         6 * columns * 3 * int64_t{sizeof(double)};
}

SessionState Session::state() const {
  MutexLock lock(mutex_);
  return StateLocked();
}

Session::Posed Session::posed() const {
  MutexLock lock(mutex_);
  return {binding_id_, pose_};
}

SessionState Session::StateLocked() const {
  return {.tenant = tenant_,
          .id = id_,
          .binding_id = binding_id_,
          .revision = revision_,
          .durable_revision = durable_revision(),
          .epoch = epoch(),
          .participants = audience_.size(),
          .create_time = create_time_};
}

void Session::Move(RigMove move) {
  absl::Status closed;
  {
    MutexLock lock(mutex_);
    if (!closed_) {
      moves_.push_back(std::move(move));
      Schedule();
      return;
    }
    closed = *closed_;
  }
  move.done(closed);
}

void Session::Refresh() {
  MutexLock lock(mutex_);
  if (closed_ || weights_ == nullptr) return;
  auto now = lease_.record()->weights->Get();
  if (now == nullptr || now == weights_) return;
  refreshed_ = std::move(now);
  Schedule();
}

void Session::End(const absl::Status& status) {
  Receivers receivers;
  std::deque<RigMove> moves;
  {
    MutexLock lock(mutex_);
    closed_ = status;
    lease_ = {};
    queue_.Clear();
    moves.swap(moves_);
    audience_.EndNow(status);
    receivers = audience_.receivers();
  }
  for (const RigMove& move : moves) move.done(status);
  Wake(receivers);
}

void Session::Drain(const absl::Status& status) {
  Receivers receivers;
  {
    MutexLock lock(mutex_);
    if (!closed_) closed_ = status;
    audience_.EndWhenAnswered(status);
    Schedule();  // Who waited for time to pass does no longer.
    receivers = audience_.receivers();
  }
  Wake(receivers);
}

void Session::Wake(const Receivers& receivers) {
  for (const auto& weak : receivers) {
    if (const auto receiver = weak.lock()) receiver->Wake();
  }
}

bool Session::CanStep() const { return !queue_.empty() && audience_.HasRoom(); }

bool Session::CanMove() const {
  return !moves_.empty() && audience_.HasRoomForRigChange();
}

void Session::Schedule() {
  if (scheduled_) return;
  if (!CanStep() && !CanMove() && refreshed_ == nullptr &&
      !audience_.NeedsFrame(environment_.clock())) {
    return CallWhenDue();
  }
  if (weights_ == nullptr) {
    if (waking_) return;
    waking_ = true;
    environment_.wake(shared_from_this());
    return;
  }
  scheduled_ = true;
  environment_.scheduler->Add(shared_from_this(), *weights_);
}

Session::Step Session::BeginStep() {
  Step step{.deformer = deformer_.get()};
  MutexLock lock(mutex_);
  const auto now = environment_.clock();
  step.binding_id = binding_id_;
  step.basis = basis_;
  // Who has joined sees the state as it was before anything newer.
  if (!audience_.MustSeeThis(now)) {
    if (refreshed_ != nullptr) {
      step.refreshed = std::move(refreshed_);
    } else if (CanMove()) {
      step.move = std::move(moves_.front());
      moves_.pop_front();
    } else if (CanStep()) {
      step.pose = queue_.Pop();
    }
  }
  const bool by_all = step.move || step.pose;
  step.wanted = audience_.Wanted(by_all, now);
  // Nobody has the weights yet that the session changes over to.
  if (step.move || step.refreshed != nullptr) {
    std::erase_if(step.wanted, [](const FrameKey& key) {
      return key.format.encoding->needs() != Needs::kNothing;
    });
  }
  step.wants_normals = audience_.WantsNormals(by_all, now);
  return step;
}

void Session::FinishStep(Step step, ThreadPool* pool) {
  absl::Status moved;
  if (step.move) moved = ChangeRig(step, pool);
  if (step.refreshed != nullptr) ChangeForm(step, pool);
  if (step.pose) Describe(step.pose->pose, step.report, step.deform_time);
  info_.basis_id = step.basis != nullptr ? step.basis->id : "";
  frame_maker_.SetBasis(step.basis);
  ProvideBasis();
  std::shared_ptr<const FrameNormals> normals;
  if (step.wants_normals)
    normals = frame_maker_.Normals(*deformer_, info_, pool);
  Wake(Publish(step, frame_maker_.Make(*deformer_, info_, step.wanted, pool),
               std::move(normals)));
  EndIfLost();
  if (!step.move) return;
  // The binding before is let go before anyone learns of it.
  const auto done = std::move(step.move->done);
  step.move.reset();
  Refresh();
  if (step.change != nullptr) {
    done(RigMoved{step.change->revision, step.change->largest_jump});
  } else {
    done(moved);
  }
}

void Session::Describe(const Pose& pose, const DeformReport& report,
                       std::chrono::microseconds time) {
  info_.deform_time = time;
  info_.columns_applied = report.columns_applied;
  info_.exit_mismatch = report.exit_mismatch;
  info_.weight_error = report.error_bound;
  ++info_.revision;
  const Vec3 center = BoxOf(pose.vertices).center();
  const double far = kOriginStep * DiagonalOf(deformer_->binding().rig());
  if (!((center - info_.origin).norm() <= far)) {
    info_.origin = center;
    ++info_.origin_number;
  }
}

absl::Status Session::ChangeRig(Step& step, ThreadPool* pool) {
  const RigMove& move = *step.move;
  if (move.from != step.binding_id) {
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     absl::StrCat("session ", Quoted(id_), " has binding ",
                                  Quoted(step.binding_id), " by now, not ",
                                  Quoted(move.from)),
                     {.reason = "OTHER_BINDING",
                      .resource_type = "session",
                      .resource_name = id_});
  }
  DEFORM_ASSIGN_OR_RETURN(
      PoseTransfer transfer,
      PoseTransfer::Create(deformer_->binding(), *move.to.binding,
                           move.previous, deformer_->pose()));
  const auto begin = std::chrono::steady_clock::now();
  auto next =
      std::make_unique<Deformer>(move.to.binding, nullptr, *environment_.drags);
  DeformJob job{.deformer = next.get(), .pose = &transfer.pose()};
  MoveTogether({&job, 1}, pool);
  const auto before = std::exchange(deformer_, std::move(next));
  step.basis.reset();
  Describe(transfer.pose(), job.report,
           std::chrono::duration_cast<std::chrono::microseconds>(
               std::chrono::steady_clock::now() - begin));
  const double jump =
      LargestJump(*before, *deformer_) / DiagonalOf(deformer_->binding().rig());
  step.change = std::make_shared<const RigChange>(
      RigChange{.binding_id = move.to.lease.record()->id,
                .dimension = dimension_,
                .transfer = std::move(transfer),
                .revision = info_.revision,
                .largest_jump = jump});
  return absl::OkStatus();
}

void Session::ChangeForm(Step& step, ThreadPool* pool) {
  const Pose pose = deformer_->pose();
  auto next =
      std::make_unique<Deformer>(step.refreshed, nullptr, *environment_.drags);
  DeformJob job{.deformer = next.get(), .pose = &pose};
  MoveTogether({&job, 1}, pool);
  deformer_ = std::move(next);
  // The revision's frames may come from either form.
  info_.weight_error = std::max(info_.weight_error, job.report.error_bound);
  step.basis.reset();
  // The former weights go with the step, not under the lock.
  MutexLock lock(mutex_);
  auto former = weights_;
  SetWeights(std::exchange(step.refreshed, std::move(former)));
}

Session::Receivers Session::Publish(
    Step& step, Frames frames, std::shared_ptr<const FrameNormals> normals) {
  MutexLock lock(mutex_);
  Pose before;
  if (step.change != nullptr) PublishChange(step);
  if (step.pose) {
    before = std::exchange(pose_, std::move(step.pose->pose));
    roster_.Published(info_.revision, step.pose->answers);
    for (const PoseQueue::Answer& answer : step.pose->answers) {
      const auto seat = roster_.SeatOf(answer.participant);
      if (seat) audience_.Contain(*seat, answer.sequence);
    }
  }
  const bool newer = revision_ != info_.revision;
  revision_ = info_.revision;
  if (newer) Journal(step, before);
  audience_.Publish(revision_, std::move(frames), environment_.clock(),
                    std::move(normals));
  scheduled_ = false;
  Schedule();
  return audience_.receivers();
}

void Session::PublishChange(Step& step) {
  refreshed_.reset();  // Of the binding before.
  pose_ = step.change->transfer.pose();
  queue_.Transfer(step.change->transfer);
  if (!closed_) lease_ = std::move(step.move->to.lease);
  memory_ = std::move(step.move->memory);
  binding_id_ = step.change->binding_id;
  SetWeights(std::move(step.move->to.binding));
  rig_history_.Add(step.change);
  roster_.Transfer(step.change->transfer, environment_.clock());
  audience_.Announce(step.change);
}

}  // namespace deform::server
