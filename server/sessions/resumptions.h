// Places in a session that are kept for those whose stream broke.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "server/sessions/edit_history.h"
#include "server/sessions/outbox.h"

namespace deform::server {

// A secret by which a participant proves who it is: 128 random bits of the
// library that makes keys, as hexadecimal digits. Nobody guesses it. Internal
// if there are none.
absl::StatusOr<std::string> MakeResumeToken();

// The name under which the holder of a token is kept: follows from the token,
// but not the token from it, so it may be written down and shown.
std::string ResumeKeyOf(absl::string_view token);

// What a participant needs to go on where it was.
struct Place {
  int64_t participant = 0;
  uint64_t last_sequence = 0;  // Of what was accepted.
  uint64_t last_pose = 0;      // Of that, what a frame will answer.
  uint64_t contained = 0;      // Of what the present revision contains.
  uint64_t first_change = 0;   // Changes of the rig before it joined.
  uint64_t attempt = 0;        // To come back, that succeeded last.
  EditHistory history;
  std::deque<Notice> notices;  // The last of them.
};

// Places by key. Each is kept for the grace time, and no more than a number of
// them: the oldest go. Not thread-safe; time is passed in.
class Resumptions {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  Resumptions(size_t limit, std::chrono::milliseconds grace)
      : limit_(limit), grace_(grace) {}

  void Keep(const std::string& key, Place place, TimePoint now);
  // Gives it back, once.
  std::optional<Place> Take(const std::string& key, TimePoint now);
  // Null if there is none, or no more.
  Place* Find(int64_t participant);
  const Place* Find(const std::string& key, TimePoint now) const;

  void DropExpired(TimePoint now);
  size_t size() const { return places_.size(); }
  // By key.
  template <typename Function>
  void ForEach(Function function) {
    for (auto& [key, kept] : places_) function(key, kept.place);
  }

 private:
  struct Kept {
    Place place;
    TimePoint until;
  };

  const size_t limit_;
  const std::chrono::milliseconds grace_;
  std::map<std::string, Kept> places_;
};

}  // namespace deform::server
