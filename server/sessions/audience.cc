#include "server/sessions/audience.h"

#include <algorithm>
#include <set>
#include <utility>

namespace deform::server {

bool Audience::Seat::HasRoom() const {
  if (outbox.delivery() == Delivery::kEvery) return !outbox.full();
  if (!format.encoding->refers() && interval.count() == 0) return true;
  return !waiting_since && !outbox.has_frames();
}

FrameKey Audience::Seat::key() const {
  const FrameEncoding& encoding = *format.encoding;
  const bool fits = encoding.refers() && held != nullptr &&
                    (held->grid() != nullptr) == encoding.uses_grid();
  return {format, fits ? held : nullptr};
}

int64_t Audience::Add(const Subscription& wanted,
                      std::weak_ptr<Receiver> receiver, TimePoint now,
                      const Rejoining& from) {
  Seat seat{.outbox = Outbox(wanted.delivery),
            .wanted = wanted.format,
            .otherwise = wanted.otherwise,
            .weights = wanted.weights,
            .normals = wanted.normals,
            .interval = wanted.interval,
            .receiver = std::move(receiver)};
  seat.PickFormat(weights_);
  seat.contained = from.contained;
  seat.outbox.Expect(from.last_pose);
  if (from.revision) seat.outbox.GoOnFrom(*from.revision);
  for (const auto& change : from.changes) seat.outbox.Announce(change);
  for (const Notice& notice : from.notices) seat.outbox.Notify(notice);
  Serve(seat, now);
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

void Audience::Hold(int64_t seat, WeightsId weights) {
  const auto found = seats_.find(seat);
  if (found == seats_.end()) return;
  Seat& holding = found->second;
  holding.weights = std::move(weights);
  // Poses that it has may be of another rig.
  if (holding.held != nullptr && holding.held->pose() != nullptr) {
    holding.held.reset();
  }
  holding.PickFormat(weights_);
}

void Audience::SetWeights(WeightsId weights) {
  if (weights.basis != weights_.basis) {
    std::erase_if(frames_, [](const auto& frame) {
      return frame.first.format.encoding->needs() == Needs::kBasis;
    });
  }
  weights_ = std::move(weights);
  for (auto& [number, seat] : seats_) seat.PickFormat(weights_);
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

bool Audience::NeedsFrame(TimePoint now) const {
  return std::any_of(seats_.begin(), seats_.end(), [&](const auto& seat) {
    return seat.second.LacksFrame(now);
  });
}

bool Audience::MustSeeThis(TimePoint now) const {
  return std::any_of(seats_.begin(), seats_.end(), [&](const auto& entry) {
    const Seat& seat = entry.second;
    return seat.LacksFrame(now) &&
           (!seat.offered_any || seat.outbox.delivery() == Delivery::kEvery);
  });
}

std::vector<FrameKey> Audience::Wanted(bool by_all, TimePoint now) const {
  std::set<FrameKey> wanted;
  for (const auto& [number, seat] : seats_) {
    if (by_all ? seat.CanBeServed(now)
               : seat.LacksFrame(now) && !frames_.contains(seat.key())) {
      wanted.insert(seat.key());
    }
  }
  return {wanted.begin(), wanted.end()};
}

bool Audience::WantsNormals(bool by_all, TimePoint now) const {
  if (!by_all && normals_ != nullptr) return false;
  return std::any_of(seats_.begin(), seats_.end(), [&](const auto& entry) {
    const Seat& seat = entry.second;
    return seat.normals &&
           (by_all ? seat.CanBeServed(now) : seat.LacksFrame(now));
  });
}

std::optional<Audience::TimePoint> Audience::NextDue() const {
  std::optional<TimePoint> next;
  for (const auto& [number, seat] : seats_) {
    if (seat.interval.count() == 0 || !seat.needs_frame || !seat.HasRoom()) {
      continue;
    }
    next = next ? std::min(*next, seat.due) : seat.due;
  }
  return next;
}

void Audience::Contain(int64_t seat, uint64_t sequence) {
  const auto found = seats_.find(seat);
  if (found != seats_.end()) found->second.contained = sequence;
}

void Audience::Announce(const std::shared_ptr<const RigChange>& change) {
  for (auto& [number, seat] : seats_) seat.outbox.Announce(change);
}

void Audience::Publish(uint64_t revision, Frames frames, TimePoint now,
                       std::shared_ptr<const FrameNormals> normals) {
  const bool newer = revision != revision_;
  if (newer) {
    frames_.clear();
    normals_.reset();
  }
  revision_ = revision;
  frames_.merge(frames);
  if (normals != nullptr) normals_ = std::move(normals);
  for (auto& [number, seat] : seats_) {
    if (newer) seat.needs_frame = true;
    Serve(seat, now);
  }
}

Audience::Receivers Audience::Serve(TimePoint now) {
  Receivers served;
  for (auto& [number, seat] : seats_) {
    if (Serve(seat, now)) served.push_back(seat.receiver);
  }
  return served;
}

bool Audience::Serve(Seat& seat, TimePoint now) {
  if (!seat.LacksFrame(now)) return false;
  const auto found = frames_.find(seat.key());
  // Who joined while frames were made may want one that nobody asked for.
  if (found == frames_.end()) return false;
  if (seat.normals && normals_ == nullptr) return false;
  const std::shared_ptr<const Frame>& frame = found->second;
  seat.outbox.Offer(frame, seat.contained, seat.normals ? normals_ : nullptr);
  if (frame->held != nullptr) seat.held = frame->held;
  seat.needs_frame = false;
  seat.offered_any = true;
  return true;
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
  Seat& taking = found->second;
  taking.waiting_since.reset();
  std::optional<Outgoing> next = taking.outbox.Take();
  if (!next && Serve(taking, now)) next = taking.outbox.Take();
  if (next) taking.waiting_since = now;
  if (taking.interval.count() > 0 && next &&
      std::holds_alternative<FrameToSend>(*next)) {
    taking.due = now + taking.interval;
  }
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
