// What one participant has edited, to be undone and done again.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "core/deform/pose.h"
#include "core/deform/pose_transfer.h"
#include "core/mesh/types.h"

namespace deform::server {

// An edit is what its poses did together: a drag is one edit of many poses.
// Undoing writes the places from before it, but only of vertices that are still
// where the edit left them: what others, or poses that are no edit, have
// written since stays. Doing it again is the same backwards. Places are
// compared exactly: an edit that somebody has restored by hand is there again.
// Not thread-safe.
class EditHistory {
 public:
  // The oldest edits go when there are more, or when they name more vertices
  // together; the newest always stays.
  static constexpr size_t kMaxEdits = 64;
  static constexpr size_t kMaxVertices = 4096;

  enum class Direction { kUndo, kRedo };

  struct Reversal {
    uint64_t edit = 0;
    PoseUpdate update;              // Names its vertices; may be empty of all.
    std::vector<int32_t> left_out;  // Changed by others since; sorted.
    bool nothing() const {
      return update.vertices.empty() && !update.stretch_blend;
    }
  };

  // `update`, right for the rig, is about to be applied to `pose` as a part of
  // edit number `edit`: of the newest one if that has the number, else of a new
  // one. What was undone can no longer be done again.
  void Record(uint64_t edit, const PoseUpdate& update, const Pose& pose);

  // What undoing the newest edit, or doing the one undone last again, would
  // write to `pose`. None if there is nothing to.
  std::optional<Reversal> Plan(Direction direction, const Pose& pose) const;
  // That was done, or given up: the next one is next.
  void Advance(Direction direction);

  // The rig has changed: places go along, vertices that were removed are
  // forgotten.
  void Transfer(const PoseTransfer& transfer);

 private:
  struct Places {
    Vec3 before;
    Vec3 after;
  };
  struct Blends {
    double before = 1;
    double after = 1;
  };
  struct Edit {
    uint64_t number = 0;
    std::map<int32_t, Places> vertices;
    std::optional<Blends> blend;
  };

  static void TransferEdit(const PoseTransfer& transfer, Edit& edit);
  void Trim();

  std::deque<Edit> done_;     // Oldest first.
  std::vector<Edit> undone_;  // The next to do again last.
};

}  // namespace deform::server
