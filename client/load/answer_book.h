// Which poses a revision of a session holds, as far as its editors were told.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

namespace deform {

// Frames tell each editor the newest of its own poses that they contain, and
// nothing of the others'. Who has several editors knows the pose of a revision
// if it knows the answers of all of them: from their frames of this very
// revision, or from frames before and after it that answer the same pose. Not
// thread-safe.
class AnswerBook {
 public:
  explicit AnswerBook(int editors) : told_(editors) {}

  // `editor` has got `revision`, which answers its pose `sequence`. Revisions
  // of an editor rise, and answers do not fall.
  void Note(int editor, uint64_t revision, uint64_t sequence);

  enum class Known {
    kYes,
    kNotYet,  // An editor has not got this revision, or a later one.
    kNever    // An editor has skipped it, or it is too long ago.
  };
  // With kYes `sequences` is what each editor's newest pose in it is.
  Known Find(uint64_t revision, std::vector<uint64_t>& sequences) const;

 private:
  static constexpr size_t kKept = 64;
  struct Told {
    uint64_t revision;
    uint64_t sequence;
  };
  Known FindOf(const std::deque<Told>& told, uint64_t revision,
               uint64_t& sequence) const;

  std::vector<std::deque<Told>> told_;  // The last of each editor.
};

}  // namespace deform
