#include "server/sessions/audience.h"

#include <algorithm>
#include <set>
#include <utility>

namespace deform::server {

bool Audience::Seat::CanBeServed() const {
  if (outbox.delivery() == Delivery::kEvery) return !outbox.full();
  if (!format.encoding->uses_grid()) return true;
  return !waiting_since && !outbox.has_frames();
}

bool Audience::Seat::MustSeeThis() const {
  return needs_frame && CanBeServed() &&
         (!offered_any || outbox.delivery() == Delivery::kEvery);
}

int64_t Audience::Add(Delivery delivery, const FrameFormat& format,
                      std::weak_ptr<Receiver> receiver, const Rejoining& from) {
  Seat seat{.outbox = Outbox(delivery),
            .format = format,
            .receiver = std::move(receiver)};
  seat.contained = from.contained;
  seat.outbox.Expect(from.last_pose);
  if (from.revision) seat.outbox.GoOnFrom(*from.revision);
  for (const auto& change : from.changes) seat.outbox.Announce(change);
  for (const Notice& notice : from.notices) seat.outbox.Notify(notice);
  Serve(seat);
  const int64_t number = next_seat_++;
  seats_.emplace(number, std::move(seat));
  return number;
}

Outbox* Audience::Find(int64_t seat) {
  const auto found = seats_.find(seat);
  return found == seats_.end() ? nullptr : &found->second.outbox;
}

void Audience::WantKeyframe(int64_t seat) {
  const auto found = seats_.find(seat);
  if (found == seats_.end()) return;
  found->second.held.reset();
  found->second.needs_frame = true;
}

bool Audience::HasRoom() const {
  return std::none_of(seats_.begin(), seats_.end(), [](const auto& seat) {
    return seat.second.outbox.full();
  });
}

bool Audience::HasRoomForRigChange() const {
  return HasRoom() &&
         std::all_of(seats_.begin(), seats_.end(), [](const auto& seat) {
           return seat.second.outbox.has_room_for_rig_changes();
         });
}

bool Audience::NeedsFrame() const {
  return std::any_of(seats_.begin(), seats_.end(), [](const auto& seat) {
    return seat.second.needs_frame && seat.second.CanBeServed();
  });
}

bool Audience::MustSeeThis() const {
  return std::any_of(seats_.begin(), seats_.end(), [](const auto& seat) {
    return seat.second.MustSeeThis();
  });
}

std::vector<FrameKey> Audience::Wanted(bool by_all) const {
  std::set<FrameKey> wanted;
  for (const auto& [number, seat] : seats_) {
    if ((by_all || seat.needs_frame) && seat.CanBeServed()) {
      wanted.insert(seat.key());
    }
  }
  return {wanted.begin(), wanted.end()};
}

void Audience::Contain(int64_t seat, uint64_t sequence) {
  const auto found = seats_.find(seat);
  if (found != seats_.end()) found->second.contained = sequence;
}

void Audience::Announce(const std::shared_ptr<const RigChange>& change) {
  for (auto& [number, seat] : seats_) seat.outbox.Announce(change);
}

void Audience::Publish(uint64_t revision, Frames frames) {
  const bool newer = revision != revision_;
  if (newer) frames_.clear();
  revision_ = revision;
  frames_.merge(frames);
  for (auto& [number, seat] : seats_) {
    if (newer) seat.needs_frame = true;
    if (seat.needs_frame && seat.CanBeServed()) Serve(seat);
  }
}

void Audience::Serve(Seat& seat) {
  const auto found = frames_.find(seat.key());
  // Who joined while frames were made may want one that nobody asked for.
  if (found == frames_.end()) return;
  const std::shared_ptr<const Frame>& frame = found->second;
  seat.outbox.Offer(frame, seat.contained);
  if (frame->grid != nullptr) seat.held = frame->grid;
  seat.needs_frame = false;
  seat.offered_any = true;
}

void Audience::EndNow(const absl::Status& status) {
  for (auto& [number, seat] : seats_) seat.outbox.EndNow(status);
}

void Audience::EndWhenAnswered(const absl::Status& status) {
  for (auto& [number, seat] : seats_) seat.outbox.EndWhenAnswered(status);
}

std::optional<Outgoing> Audience::Take(int64_t seat, TimePoint now) {
  const auto found = seats_.find(seat);
  if (found == seats_.end()) return std::nullopt;
  std::optional<Outgoing> next = found->second.outbox.Take();
  found->second.waiting_since.reset();
  if (next) found->second.waiting_since = now;
  return next;
}

void Audience::Progressed(int64_t seat, TimePoint now) {
  const auto found = seats_.find(seat);
  if (found != seats_.end()) found->second.waiting_since = now;
}

std::optional<Audience::TimePoint> Audience::WaitingSince(int64_t seat) const {
  const auto found = seats_.find(seat);
  return found == seats_.end() ? std::nullopt : found->second.waiting_since;
}

Audience::Receivers Audience::receivers() const {
  Receivers receivers;
  for (const auto& [number, seat] : seats_) receivers.push_back(seat.receiver);
  return receivers;
}

Audience::Receivers Audience::receivers(std::span<const int64_t> seats) const {
  Receivers receivers;
  for (const int64_t number : seats) {
    const auto found = seats_.find(number);
    if (found != seats_.end()) receivers.push_back(found->second.receiver);
  }
  return receivers;
}

}  // namespace deform::server
