// What a caller asks for, as plain values: nothing here is checked, so that
// what is wrong reaches the server and is refused there, once and with one
// voice.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"
#include "core/mesh/rig.h"
#include "core/mesh/types.h"
#include "core/weights/binding.h"
#include "core/weights/exit_regions.h"
#include "core/weights/scheme.h"

namespace deform {

// N points, with F triangles or without.
struct ModelArrays {
  ModelArrays() = default;
  ModelArrays(int dim, Positions points, Faces triangles)
      : dimension(dim),
        positions(std::move(points)),
        faces(std::move(triangles)) {}
  // NOLINTNEXTLINE(google-explicit-constructor): a Mesh is one that is right.
  ModelArrays(const Mesh& mesh)
      : ModelArrays(mesh.dimension(), mesh.positions(), mesh.faces()) {}

  int dimension = 3;
  Positions positions;  // N x 3; the third column is not sent in 2D.
  Faces faces;          // F x 3; F may be 0.
};

// A cage (vertices and faces) or handles (vertices only), at rest.
struct RigArrays {
  RigArrays() = default;
  RigArrays(RigKind k, int dim, Positions points, Faces corners)
      : kind(k),
        dimension(dim),
        vertices(std::move(points)),
        faces(std::move(corners)) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  RigArrays(const Cage& cage)
      : RigArrays(RigKind::kCage, cage.dimension(), cage.vertices(),
                  cage.faces()) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  RigArrays(const Handles& handles)
      : RigArrays(RigKind::kHandles, handles.dimension(),
                  handles.positions().topRows(handles.free_count()), Faces()) {
    fixed = handles.positions().bottomRows(handles.fixed_count());
  }

  RigKind kind = RigKind::kCage;
  int dimension = 3;
  Positions vertices;  // V x 3; the third column is not sent in 2D.
  Faces faces;         // F x dimension.
  Positions fixed;     // Rows x 3: handles that no pose moves.
};

// InvalidArgument: what Cage::Create() and Handles::Create() refuse.
absl::StatusOr<Rig> RigOf(const RigArrays& arrays);

// How a model is to be bound.
struct BindingSpec {
  std::string model_id;
  RigArrays rig;
  std::string scheme = "green";
  SchemeOptions options;
  // How points outside a cage are reached; without it they are unbindable.
  ExitRegions exits;
  Unbindable unbindable = Unbindable::kFail;
  // Turn an inside-out cage instead of refusing it.
  bool flip_inside_out = false;
  // Handles: also the corners of the model's box, 1.6 times as large, as fixed
  // handles. Then the whole model lies inside their hull.
  bool add_box_handles = false;
  // Points that stay at rest whatever the pose.
  std::vector<int64_t> clamped;
  // How far compressed weights may move a point, as a fraction of D, as
  // CreateBindingRequest tells: 1e-6 to 1e-2; 0: dense. The server's if not
  // set.
  std::optional<double> weight_tolerance;
};

}  // namespace deform
