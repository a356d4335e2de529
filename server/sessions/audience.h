// Those who receive a session's frames: who sits there, what waits for each,
// what each holds, and the frames of the present revision.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "server/sessions/frame.h"
#include "server/sessions/frame_maker.h"
#include "server/sessions/frame_wishes.h"
#include "server/sessions/outbox.h"
#include "server/sessions/rig_change.h"

namespace deform::server {

// Where a participant's frames go: the other end of a stream. Called on any
// thread, with no lock of the session held; must not block.
class Receiver {
 public:
  virtual ~Receiver() = default;
  // There may be something to take, or room for poses again.
  virtual void Wake() = 0;
};

// Where somebody goes on who was here before, on another stream.
struct Rejoining {
  uint64_t last_pose = 0;  // Frames are to answer up to this one.
  uint64_t contained = 0;  // Of them, what the present revision contains.
  // The last that it received; none if it received none.
  std::optional<uint64_t> revision;
  // Of the rig, that it was not told of. No more than an outbox takes.
  std::vector<std::shared_ptr<const RigChange>> changes;
  std::vector<Notice> notices;  // Again: they may be lost.
};

// A receiver holds one revision that frames may refer to: the last such that it
// was offered, since streams lose nothing. So a frame that refers to another
// may not be replaced in the outbox: with delivery LATEST such a seat is
// offered one only when nothing is under way to it, and is served late
// otherwise. So is one that wants few frames, and only when its interval is
// over. Others are always offered the newest, in which they share.
//
// Who is to have frames that need weights has them as long as it holds those of
// the present revision, and others else.
//
// Not thread-safe. A seat that is not there (any more) takes nothing in.
class Audience {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  using Receivers = std::vector<std::weak_ptr<Receiver>>;

  // Gives a seat, which gets a frame of the present revision: at once if there
  // is one, else it needs one.
  int64_t Add(const Subscription& wanted, std::weak_ptr<Receiver> receiver,
              TimePoint now, const Rejoining& from = {});
  // Of whom is added next.
  int64_t next_seat() const { return next_seat_; }
  void Remove(int64_t seat) { seats_.erase(seat); }
  int size() const { return static_cast<int>(seats_.size()); }
  // Null if there is none. Its frames come by Publish() and go by Take().
  Outbox* Find(int64_t seat);
  // The seat has lost what it held: it needs a frame that refers to no other.
  void WantKeyframe(int64_t seat);
  // The weights that its receiver has from now on.
  void Hold(int64_t seat, WeightsId weights);
  // Those of frames that are published from now on.
  void SetWeights(WeightsId weights);

  // Everybody has room for the frame of a next revision.
  bool HasRoom() const;
  // And for a change of the rig before it.
  bool HasRoomForRigChange() const;
  // Somebody who can be served lacks a frame of the present revision.
  bool NeedsFrame(TimePoint now) const;
  // And must see this one: a next revision would come too early.
  bool MustSeeThis(TimePoint now) const;
  // What is to be made for those who can be served: of the present revision, as
  // far as it is not there, for who lacks a frame; or of the next, for all.
  std::vector<FrameKey> Wanted(bool by_all, TimePoint now) const;
  bool WantsNormals(bool by_all, TimePoint now) const;
  // When somebody can be served next who lacks a frame, has nothing under way
  // and waits for his interval to be over; none if nobody does.
  std::optional<TimePoint> NextDue() const;

  // The revision that is published next contains this pose of the seat's.
  void Contain(int64_t seat, uint64_t sequence);
  // Frames that are published from now on are of the changed rig. Needs
  // HasRoomForRigChange().
  void Announce(const std::shared_ptr<const RigChange>& change);
  // Frames of the present revision, or of the next, for which there is room,
  // and its normals if they were wanted. Who can be served gets his, as far as
  // it is there; others lack one.
  void Publish(uint64_t revision, Frames frames, TimePoint now,
               std::shared_ptr<const FrameNormals> normals = nullptr);
  // Who lacks a frame of the present revision and can be served by now gets
  // his, as far as it is there. Tells who.
  Receivers Serve(TimePoint now);

  // See Outbox.
  void EndNow(const absl::Status& status);
  void EndWhenAnswered(const absl::Status& status);

  // What the seat is to be sent next; what it took before has been sent, so
  // that it may be served by now.
  std::optional<Outgoing> Take(int64_t seat, TimePoint now);
  // Part of what it took has been sent.
  void Progressed(int64_t seat, TimePoint now);
  // Since when it takes no message; none if nothing is under way.
  std::optional<TimePoint> WaitingSince(int64_t seat) const;

  Receivers receivers() const;
  Receivers receivers(std::span<const int64_t> seats) const;

 private:
  struct Seat {
    Outbox outbox;
    FrameFormat wanted;
    FrameFormat otherwise;
    WeightsId weights;   // That the receiver has.
    FrameFormat format;  // One of the two: that of the next frame.
    bool normals = false;
    std::chrono::nanoseconds interval{0};
    std::weak_ptr<Receiver> receiver;
    uint64_t contained = 0;  // Newest pose that the revision contains.
    bool needs_frame = true;
    bool offered_any = false;
    std::shared_ptr<const HeldRevision> held;
    std::optional<TimePoint> waiting_since;
    TimePoint due = TimePoint::min();  // No frame before, unless in a hurry.

    FrameKey key() const;
    void PickFormat(const WeightsId& present) {
      format = weights.Serves(*wanted.encoding, present) ? wanted : otherwise;
    }
    bool HasRoom() const;
    bool CanBeServed(TimePoint now) const {
      return HasRoom() && (now >= due || outbox.in_a_hurry());
    }
    bool LacksFrame(TimePoint now) const {
      return needs_frame && CanBeServed(now);
    }
  };

  // Gives the seat its frame of the present revision. False if it lacks none,
  // cannot be served or it is not there.
  bool Serve(Seat& seat, TimePoint now);

  std::map<int64_t, Seat> seats_;
  int64_t next_seat_ = 1;
  WeightsId weights_;
  uint64_t revision_ = 0;
  Frames frames_;                                // Of the revision.
  std::shared_ptr<const FrameNormals> normals_;  // Likewise, if wanted.
};

}  // namespace deform::server
