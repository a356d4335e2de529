// Bindings with compressed weights, large and tiny.
#pragma once

#include <cstring>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "core/deform/deformer.h"
#include "core/weights/binding.h"
#include "tests/support/ball_request.h"
#include "tests/support/shapes.h"

namespace deform {

// InBall(), to be compressed, with points 3 and 5 clamped.
inline BindRequest CompressedInBall(const CoordinateScheme& scheme,
                                    int dimension, int count, double tolerance,
                                    const Vec3& center = Vec3::Zero()) {
  BindRequest request = InBall(scheme, dimension, count, center);
  request.weight_tolerance = tolerance;
  request.clamped = {3, 5};
  return request;
}

// The rest pose with every coordinate moved by up to `size`.
inline Pose Shaken(const BindingFacts& binding, unsigned seed, double size) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-size, size);
  Pose pose = RestPose(binding.rig());
  for (auto vertex : pose.vertices.rowwise()) {
    for (int d = 0; d < binding.dimension(); ++d) vertex(d) += uniform(random);
  }
  return pose;
}

// Three points of the plane: 0 and 2 in one leaf with a column of int16 and one
// of int8, and 1, which is clamped. Its numbers are as in a picture book.
inline std::shared_ptr<const Binding> TinyBinding() {
  Positions points(3, 3);
  points << 0.25, 0.5, 0, 0.5, 0.5, 0, 1, 2, 0;
  points.row(2) /= 4;
  const auto dense = Bind({.model = std::make_shared<const Mesh>(
                               *Mesh::Create(2, points, Faces(0, 3))),
                           .rig = CageOf(Loop2d(std::vector<Eigen::Vector2d>{
                               {0, 0}, {1, 0}, {1, 1}, {0, 1}})),
                           .scheme = "mean_value",
                           .clamped = {1}},
                          {})
                         .value();
  CompressedWeights::Parts parts{.columns = dense->column_count(),
                                 .slots = {1, -1, 0}};
  parts.clusters.push_back({.basis = WeightTiles(1, parts.columns)});
  CompressedWeights::Branch branch{.basis = WeightTiles(1, 1),
                                   .leaf_rows = WeightTiles(3, 1)};
  branch.leaves.push_back(
      {.blocks = 1, .columns = {.shorts = 1, .bytes = 1}, .step = 0.5});
  branch.numbers = ZeroedArray<std::byte>(3 * kBlockPoints);
  const int16_t shorts[] = {-300, 200};
  std::memcpy(branch.numbers.data(), shorts, sizeof(shorts));
  branch.numbers.data()[2 * kBlockPoints] = std::byte{7};
  branch.numbers.data()[2 * kBlockPoints + 1] = std::byte{0xfd};  // -3
  parts.branches.push_back(std::move(branch));
  return std::make_shared<const Binding>(
      *dense, std::make_shared<const CompressedWeights>(std::move(parts)));
}

}  // namespace deform
