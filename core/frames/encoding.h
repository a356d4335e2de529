// The seam for frame encodings: how deformed vertices become bytes, and back.
//
// To add one: write encodings/<name>.cc, with its format, bit by bit, in
// encodings/<name>.h, then add one line to builtin_encodings.cc. Server and C++
// client share both directions.
//
// A frame is cut into chunks, each encoded by itself. The bytes depend on what
// is passed in and on nothing else, so they may be made on any thread, and are
// shared by all receivers that agree on (revision, encoding, tolerance,
// reference).
//
// Encodings are of three kinds. Those of positions are stateless: a chunk holds
// vertices in the order of the model. Those on a grid (uses_grid()) write
// integers (grid.h) in an order of their own (point_order.h), losslessly. Those
// that need something (needs()) write, in one chunk, what the vertices are made
// of; the receiver makes them from what it holds.
//
// A frame may tell what differs from a reference (refers()): another revision
// that the receiver has, as a grid or a pose. Without one it is a keyframe. As
// these arrive as they were, errors never accumulate.
//
// The tolerance is one: no decoded point is farther than it, in model units,
// from the point that was given, roundings to float on both sides included.
// Who deforms with compressed weights passes what their error bound leaves.
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/frames/grid.h"
#include "core/mesh/types.h"

namespace deform {

class Deformer;
class LeafBasis;
class ThreadPool;
struct Pose;

// Chunks of a frame hold at most this many bytes.
inline constexpr int64_t kMaxChunkBytes = int64_t{1} << 20;

// A chunk to be encoded: points [first, first + count) of the frame, in the
// order of the model, or, on a grid, of its PointOrder.
struct ChunkSource {
  int dimension = 3;
  int64_t first = 0;
  int64_t count = 0;
  // For encodings of positions: these points relative to the frame's origin,
  // count x dimension, and the tolerance.
  std::span<const float> positions;
  double tolerance = 0;
  // For encodings on a grid, whose step is the tolerance: the whole frame, and
  // its reference, of as many points; null in a keyframe.
  const Grid* grid = nullptr;
  const Grid* reference = nullptr;
  // For encodings that need something: what the frame shows, and the pose that
  // is its reference, of the same rig; null in a keyframe.
  const Deformer* deformer = nullptr;
  const Pose* reference_pose = nullptr;
  // That of the deformer's binding; null if its weights are dense.
  const LeafBasis* basis = nullptr;
  // Borrowed, for those that write the frame as one chunk; may be null.
  ThreadPool* pool = nullptr;
};

// Where a chunk is decoded to. As above; grids of another size than the frame's
// are our mistake.
struct ChunkTarget {
  int dimension = 3;
  int64_t first = 0;
  int64_t count = 0;
  std::span<float> positions;
  Grid* grid = nullptr;
  const Grid* reference = nullptr;
  // With the weights of the receiver; null if it holds none. It is moved to the
  // pose of the frame; positions are then relative to `origin`, and
  // `error_bound` (may be null) is what DeformReport says.
  Deformer* deformer = nullptr;
  const Pose* reference_pose = nullptr;
  // That of the receiver, of as many points as the frame; null if it holds none
  // that the frame is of. Positions are then relative to `origin`, too.
  const LeafBasis* basis = nullptr;
  ThreadPool* pool = nullptr;  // Borrowed; may be null.
  Vec3 origin = Vec3::Zero();
  double* error_bound = nullptr;
};

// What a receiver has to hold, beside earlier frames.
enum class Needs {
  kNothing,
  kWeights,  // Of the binding.
  kBasis,    // The LeafBasis of these, as they are compressed.
};

class FrameEncoding {
 public:
  virtual ~FrameEncoding() = default;

  // Name on the wire; it never changes meaning.
  virtual absl::string_view id() const = 0;

  // Gives back the very floats it was given: needs no tolerance.
  virtual bool is_exact() const { return false; }
  // Writes the positions as they lie in memory: they may be where it writes.
  virtual bool is_verbatim() const { return false; }
  virtual bool uses_grid() const { return false; }
  virtual Needs needs() const { return Needs::kNothing; }
  // A frame may have a reference.
  virtual bool refers() const { return uses_grid(); }
  // The least tolerance that can be kept for points whose coordinates reach
  // this far from the origin; 0 if it is exact.
  virtual double FinestTolerance(double reach) const = 0;

  // Points that a chunk holds at most: then it never exceeds kMaxChunkBytes. On
  // a grid a multiple of kGridBlock, as is the beginning of every chunk. More
  // than there are, if one chunk holds the frame.
  virtual int64_t PointsPerChunk(int dimension) const = 0;

  // Writes a chunk to `out`, which holds kMaxChunkBytes. Returns the bytes
  // written, or
  //   FailedPrecondition TOLERANCE_NOT_MET  says what can be met; the caller
  //     picks another encoding
  //   FailedPrecondition FRAME_TOO_LARGE  for one chunk; likewise
  //   InvalidArgument NON_FINITE
  virtual absl::StatusOr<int64_t> Encode(const ChunkSource& source,
                                         uint8_t* out) const = 0;

  // The reverse. `bytes` come from outside: InvalidArgument (BAD_FRAME) if they
  // are not as Encode writes them; what the target holds then is not specified.
  virtual absl::Status Decode(std::span<const uint8_t> bytes,
                              const ChunkTarget& target) const = 0;
};

// From the one that takes most bytes to the cheapest.
std::span<const FrameEncoding* const> AllEncodings();

// Null if there is none of this name.
const FrameEncoding* FindEncoding(absl::string_view id);

// BAD_FRAME, as decoders say it.
absl::Status BadFrameData(absl::string_view message);

}  // namespace deform
