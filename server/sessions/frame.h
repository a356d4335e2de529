// The deformed vertices of one revision as bytes, encoded once for all who
// receive the same.
#pragma once

#include <chrono>
#include <compare>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/deform/pose.h"
#include "core/frames/encoding.h"
#include "core/frames/grid.h"
#include "core/frames/point_order.h"
#include "core/mesh/types.h"
#include "server/sessions/chunk_bytes.h"

namespace deform::server {

// What a frame says beside its bytes.
struct FrameInfo {
  uint64_t revision = 0;
  Vec3 origin = Vec3::Zero();
  // Counts the origins: a receiver that was told an older one needs the new.
  uint64_t origin_number = 0;
  int64_t columns_applied = 0;
  double exit_mismatch = 0;
  // How far compressed weights may have moved any point, in model units.
  double weight_error = 0;
  std::chrono::microseconds deform_time{0};
  // Of the weights that deformed it (NamedBasis); empty if they are dense, or
  // nobody has wanted frames of it.
  std::string basis_id;
};

// How a receiver has its frames.
struct FrameFormat {
  const FrameEncoding* encoding = nullptr;
  double tolerance = 0;  // In model units; 0 if the encoding is exact.

  auto operator<=>(const FrameFormat&) const = default;
};

// A revision as those have it who received it on a grid, or as a pose: what a
// later frame may refer to. Immutable; travels as shared_ptr<const
// HeldRevision>.
struct HeldRevision {
  uint64_t revision = 0;
  double step = 0;  // Of the grid.
  std::variant<Grid, Pose> content;

  // Null if it is the other.
  const Grid* grid() const { return std::get_if<Grid>(&content); }
  const Pose* pose() const { return std::get_if<Pose>(&content); }
};

// Which weights there are.
struct WeightsId {
  std::string binding;  // Empty: none.
  std::string basis;    // NamedBasis::id, likewise.

  // Who holds these can read frames of this encoding of a session that has
  // `present`.
  bool Serves(const FrameEncoding& encoding, const WeightsId& present) const {
    switch (encoding.needs()) {
      case Needs::kNothing:
        return true;
      case Needs::kWeights:
        return !binding.empty() && binding == present.binding;
      case Needs::kBasis:
        return !basis.empty() && basis == present.basis;
    }
    return false;
  }
};

// Frames of a revision with the same key are the same bytes.
struct FrameKey {
  FrameFormat format;
  // What the receiver holds; null: a keyframe.
  std::shared_ptr<const HeldRevision> reference;

  auto operator<=>(const FrameKey&) const = default;
};

// Normals of a revision (core/frames/normals.h), in the order of the model: two
// bytes a vertex, for all who want them, whatever their encoding. Immutable;
// travels as shared_ptr<const FrameNormals>.
using FrameNormals = std::vector<uint8_t>;

// Immutable; travels as shared_ptr<const Frame>.
struct Frame {
  struct Chunk {
    int64_t first_vertex = 0;
    int64_t vertex_count = 0;
    int64_t size = 0;
    ChunkBytes bytes;
  };

  FrameInfo info;
  int dimension = 3;
  // Not that of its key if that could not keep the tolerance: then float32.
  const FrameEncoding* encoding = nullptr;
  // How far compressed weights and the encoding may have moved any point, in
  // model units, beside roundings to float.
  double error_bound = 0;
  std::vector<Chunk> chunks;  // In order; at least one.

  // What its receiver holds then, if a frame may refer to it.
  std::shared_ptr<const HeldRevision> held;
  std::shared_ptr<const PointOrder> order;  // Of one on a grid.
  // None: a keyframe, which refers to no other.
  std::optional<uint64_t> reference_revision;
};

}  // namespace deform::server
