// What is sent: poses by number, so that whoever knows the number knows the
// pose.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/deform/pose.h"
#include "core/mesh/rig.h"

namespace deform {

// The vertices of a rig are shared out: editor e of E has those whose number is
// e modulo E. Immutable.
class PosePattern {
 public:
  enum class Kind {
    kDrag,     // One vertex of each editor goes around a smooth closed path.
    kJitter,   // All its vertices are at random places within D / 100.
    kSequence  // All take their places in poses that were given, in turn.
  };

  // `rate`: poses a second of an editor; the path of kDrag takes two seconds.
  // `sequence`: of kSequence, at least one, of the rows that a pose moves.
  // Needs 1 <= editors <= PoseRows(rig).
  PosePattern(Kind kind, const Rig& rig, int editors, double rate,
              std::vector<Positions> sequence = {});

  int editors() const { return static_cast<int>(owned_.size()); }

  // Pose `number`, from 1, of an editor. Every one names the same vertices: it
  // depends on no pose before. Sessions differ in what they do.
  PoseUpdate At(int64_t session, int editor, uint64_t number) const;

  // The pose of a session in which the newest pose of each editor is
  // `numbers`; 0: it has sent none.
  Pose Merged(int64_t session, std::span<const uint64_t> numbers) const;

 private:
  Positions Places(int64_t session, std::span<const int32_t> vertices,
                   uint64_t number) const;

  const Kind kind_;
  const int dimension_;
  const double diagonal_;
  const double rate_;
  const Pose rest_;
  const int64_t pose_rows_;
  const std::vector<Positions> sequence_;
  std::vector<std::vector<int32_t>> owned_;  // By editor.
};

}  // namespace deform
