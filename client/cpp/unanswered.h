// What was asked on a stream and not answered yet, or could still be lost.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>

#include "absl/status/status.h"
#include "deform/v1/session.pb.h"

namespace deform {

// Requests in their order: those that were sent, for which an answer may come
// or which must be sent again on another stream, then those that were not. Of
// poses that were answered the last are kept beside them until the server says
// that they outlive it. Bounded. Not thread-safe.
class Unanswered {
 public:
  static constexpr size_t kMaxRequests = 4096;
  static constexpr size_t kMaxBytes = size_t{64} << 20;
  // Of poses that were answered; the oldest are forgotten. They become durable
  // within milliseconds.
  static constexpr size_t kMaxAnswered = 1024;
  static constexpr size_t kMaxAnsweredBytes = size_t{8} << 20;

  using Request = std::shared_ptr<const v1::DeformRequest>;

  // Rising sequences; 0: wants no answer, and is forgotten when it is sent or
  // the stream breaks. ResourceExhausted UNANSWERED_LIMIT.
  absl::Status Add(uint64_t sequence, v1::DeformRequest request);
  // The next to be sent, which it then has been; null if there is none.
  Request TakeUnsent();
  bool has_unsent() const { return sent_ < entries_.size(); }

  // The frame of this revision contains all up to this one.
  void AnsweredUpTo(uint64_t sequence, uint64_t revision);
  // Of what was answered, so much cannot be lost any more.
  void DurableUpTo(uint64_t revision);
  // This one was told by itself. False if nobody waits for it.
  bool Answered(uint64_t sequence);
  // The sequence up to which all was answered.
  uint64_t answered_up_to() const;

  // There is another stream, whose server has accepted what was sent up to this
  // one: the rest is unsent. If it is not the server of before, that holds for
  // what was answered as well.
  void Rejoined(uint64_t accepted, bool restarted);
  // Changes of the rig are counted from anew. False if a request was made for a
  // rig before those.
  bool CountRigChangesFrom(uint64_t base);
  static bool CountRigChangesFrom(uint64_t base, v1::DeformRequest& request);

  size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    uint64_t sequence = 0;
    Request request;
    size_t bytes = 0;
    uint64_t revision = 0;  // Of the answer.
  };

  void Erase(size_t index);
  void ForgetOldestAnswered();

  std::deque<Entry> entries_;
  size_t sent_ = 0;  // Of the entries.
  size_t bytes_ = 0;
  std::deque<Entry> answered_;  // Poses.
  size_t answered_bytes_ = 0;
  uint64_t last_ = 0;  // Sequence that was added.
};

}  // namespace deform
