// The arrays everything else is made of. N points, V cage vertices, F faces.
#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace deform {

using Vec3 = Eigen::Vector3d;

// N x 3, model units. In 2D the third column is 0, so that one code serves
// both dimensions.
using Positions = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using PositionsRef = Eigen::Ref<const Positions>;

// F x 3 corners of triangles, or F x 2 of directed edges.
using Faces =
    Eigen::Matrix<int32_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace deform
