// A pose taken from one set of handles over to an edited one.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/deform/pose.h"
#include "core/mesh/types.h"
#include "core/weights/binding.h"

namespace deform {

// Where `pose` has carried `places` (k x 3) that need not be points of the
// model: as the coordinates of the binding's handles say, in double. Outside of
// their hull, where there are none, as the similarity that fits the pose best
// says, and as the handles deviate from it, the near ones most (with the
// inverse squares of the distances). Continues the deformation either way: at a
// handle it is where that handle is.
absl::StatusOr<Positions> CarriedPlaces(const Binding& binding,
                                        const Pose& pose,
                                        const PositionsRef& places);

// How poses of handles become poses of the edited ones. A handle that stays
// keeps its place. One that was moved at rest, or is new, is where the pose has
// carried its rest place: then the deformation there is what it was, and the
// model jumps least. Immutable.
class PoseTransfer {
 public:
  // `pose` is the one of `from` to begin with; `previous` tells of each free
  // handle of `to` which one of `from` it is, or -1.
  static absl::StatusOr<PoseTransfer> Create(const Binding& from,
                                             const Binding& to,
                                             std::vector<int32_t> previous,
                                             const Pose& pose);

  // That pose, of the edited handles.
  const Pose& pose() const { return pose_; }
  const std::vector<int32_t>& previous() const { return previous_; }
  // What poses of the handles before look like.
  const PoseShape& from() const { return from_; }

  // Another pose of the handles before, such as one that was to come: handles
  // that were moved at rest are shifted as they were in pose(), new ones stay
  // where they are there.
  Pose Transfer(const Pose& before) const;

  // The same for an update that is right for from(): entries of handles that
  // were removed are dropped. InvalidArgument RIG_CHANGED if none is left.
  absl::StatusOr<PoseUpdate> Transfer(const PoseUpdate& before) const;

 private:
  PoseTransfer(PoseShape from, std::vector<int32_t> previous, Pose pose);

  PoseShape from_;
  std::vector<int32_t> previous_;
  std::vector<int32_t>
      next_;         // Of each free handle before: its row now, or -1.
  Positions shift_;  // Of each free handle now; 0 for new ones.
  Pose pose_;
};

}  // namespace deform
