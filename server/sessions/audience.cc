#include "server/sessions/audience.h"

#include <algorithm>
#include <utility>

namespace deform::server {

int64_t Audience::Add(Delivery delivery, const FrameEncoding& encoding,
                      std::weak_ptr<Receiver> receiver) {
  Seat seat{.outbox = Outbox(delivery),
            .encoding = &encoding,
            .receiver = std::move(receiver)};
  Serve(seat);
  const int64_t number = next_seat_++;
  seats_.emplace(number, std::move(seat));
  return number;
}

Outbox* Audience::Find(int64_t seat) {
  const auto found = seats_.find(seat);
  return found == seats_.end() ? nullptr : &found->second.outbox;
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
  return std::any_of(seats_.begin(), seats_.end(),
                     [](const auto& seat) { return seat.second.needs_frame; });
}

std::vector<const FrameEncoding*> Audience::Wanted(bool by_all) const {
  std::vector<const FrameEncoding*> wanted;
  for (const auto& [number, seat] : seats_) {
    if ((by_all || seat.needs_frame) &&
        std::find(wanted.begin(), wanted.end(), seat.encoding) ==
            wanted.end()) {
      wanted.push_back(seat.encoding);
    }
  }
  return wanted;
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
    if (newer || seat.needs_frame) Serve(seat);
  }
}

void Audience::Serve(Seat& seat) {
  const auto frame = frames_.find(seat.encoding);
  // Who joined while frames were encoded may want one that was not in use.
  seat.needs_frame = frame == frames_.end();
  if (!seat.needs_frame) seat.outbox.Offer(frame->second, seat.contained);
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

}  // namespace deform::server
