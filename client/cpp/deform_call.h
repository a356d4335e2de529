// A place in a session without a thread that waits for it: a few threads of
// gRPC's serve thousands. Who has a handful of streams is better off with
// DeformStream.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "client/cpp/deform_stream.h"

namespace deform {

// What happens to a call. One at a time, except that OnSent() may come beside
// the others, on threads that serve other calls too: return soon.
class DeformEvents {
 public:
  virtual ~DeformEvents() = default;
  // The first.
  virtual void OnJoined(const JoinedSession& joined) = 0;
  virtual void OnFrame(const Frame& frame) = 0;
  virtual void OnRejected(uint64_t sequence, const absl::Status& status) = 0;
  virtual void OnRigChange(const RigChange& change) = 0;
  // The pose under way has been sent: there is room for the next.
  virtual void OnSent() = 0;
  // The last. OK: after Close(), once every pose was answered.
  virtual void OnEnd(const absl::Status& status) = 0;
};

// Thread-safe.
class DeformCall {
 public:
  // Cancels what is still under way, and waits until OnEnd() has returned: not
  // to be destroyed by an event.
  virtual ~DeformCall() = default;

  // Sends a pose that is meant for the rig at joining. Its sequence number is
  // one more than that of the pose before, from 1. False, and nothing is sent,
  // while one is under way (OnSent), after Close() and when the call has ended.
  // Never waits.
  virtual bool Send(const PoseUpdate& update) = 0;
  // No more poses come.
  virtual void Close() = 0;
  // Ends at once; OnEnd() tells Cancelled.
  virtual void Cancel() = 0;
};

}  // namespace deform
