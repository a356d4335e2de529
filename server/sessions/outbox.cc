#include "server/sessions/outbox.h"

#include <cassert>
#include <utility>

namespace deform::server {

void Outbox::Offer(std::shared_ptr<const Frame> frame, uint64_t answers,
                   std::shared_ptr<const FrameNormals> normals) {
  assert(!full());
  RigChanges changes;
  if (delivery_ == Delivery::kLatest && !frames_.empty()) {
    changes = std::move(frames_.back().changes);
    frames_.clear();
  }
  changes.insert(changes.end(), announced_.begin(), announced_.end());
  announced_.clear();
  frames_.push_back(
      {std::move(changes), std::move(frame), std::move(normals), answers});
}

void Outbox::Announce(std::shared_ptr<const RigChange> change) {
  assert(has_room_for_rig_changes());
  announced_.push_back(std::move(change));
}

bool Outbox::has_room_for_rig_changes() const {
  size_t waiting = announced_.size();
  for (const Waiting& frame : frames_) waiting += frame.changes.size();
  return waiting < kMaxRigChanges;
}

bool Outbox::full() const {
  return delivery_ == Delivery::kEvery && frames_.size() >= kMaxFrames;
}

void Outbox::Reject(uint64_t sequence, absl::Status status) {
  Notify(Rejection{.sequence = sequence, .status = std::move(status)});
}

void Outbox::Notify(Notice notice) {
  assert(has_room_for_notices());
  notices_.push_back(std::move(notice));
}

void Outbox::GoOnFrom(uint64_t revision) {
  revision_ = revision;
  goes_on_ = true;
}

void Outbox::EndWhenAnswered(absl::Status status) {
  if (!end_) end_ = std::move(status);
}

void Outbox::EndNow(absl::Status status) {
  frames_.clear();
  notices_.clear();
  end_ = std::move(status);
  sent_any_ = true;
  answered_ = expected_;
}

std::optional<Outgoing> Outbox::Take() {
  if (ended_) return std::nullopt;
  if (!notices_.empty()) {
    const Notice notice = std::move(notices_.front());
    notices_.pop_front();
    return std::visit([](auto& any) { return Outgoing(any); }, notice);
  }
  if (end_ && Answered()) {
    ended_ = true;
    frames_.clear();
    return Ended{*end_};
  }
  if (frames_.empty()) return std::nullopt;
  if (RigChanges& changes = frames_.front().changes; !changes.empty()) {
    RigChanged changed{std::move(changes.front())};
    changes.pop_front();
    return changed;
  }
  if (const auto& order = frames_.front().frame->order;
      order != nullptr && !std::exchange(sent_order_, true)) {
    return OrderToSend{order};
  }
  return TakeFrame();
}

FrameToSend Outbox::TakeFrame() {
  const Waiting waiting = std::move(frames_.front());
  frames_.pop_front();
  const FrameInfo& info = waiting.frame->info;
  FrameToSend send{.frame = waiting.frame,
                   .normals = waiting.normals,
                   .answers_sequence = waiting.answers};
  // The same revision comes again to who asked for a keyframe.
  if ((sent_any_ || goes_on_) && info.revision > revision_) {
    send.skipped_revisions = info.revision - revision_ - 1;
  }
  send.tells_origin = !sent_any_ || info.origin_number != origin_number_;
  send.tells_basis = info.basis_id != basis_id_;
  sent_any_ = true;
  answered_ = waiting.answers;
  revision_ = info.revision;
  origin_number_ = info.origin_number;
  basis_id_ = info.basis_id;
  return send;
}

}  // namespace deform::server
