#include "core/frames/normals.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "absl/strings/str_cat.h"
#include "core/frames/encoding.h"

namespace deform {
namespace {

constexpr float kLargest = 127;

// The lower half of the octahedron, folded over the upper, and back.
template <typename Real>
void Fold(Real& x, Real& y) {
  const Real folded = (1 - std::abs(y)) * (x < 0 ? Real{-1} : Real{1});
  y = (1 - std::abs(x)) * (y < 0 ? Real{-1} : Real{1});
  x = folded;
}

uint8_t ToByte(double p) {
  // Rounded as by lround(), which is a call.
  const auto i = static_cast<int>(p * kLargest + (p < 0 ? -0.5 : 0.5));
  return static_cast<uint8_t>(static_cast<int8_t>(i));
}

float FromByte(uint8_t byte) {
  return std::max(static_cast<float>(static_cast<int8_t>(byte)) / kLargest,
                  -1.0F);
}

}  // namespace

void ComputeNormals(std::span<const float> positions, const Faces& faces,
                    std::span<float> normals) {
  assert(positions.size() == normals.size());
  const auto points = static_cast<int64_t>(positions.size() / 3);
  std::vector<double> sums(positions.size());
  const auto at = [&](int32_t i) {
    return Vec3(positions[3 * int64_t{i}], positions[3 * int64_t{i} + 1],
                positions[3 * int64_t{i} + 2]);
  };
  for (int64_t f = 0; f < faces.rows(); ++f) {
    const Vec3 a = at(faces(f, 0));
    // Twice the area long.
    const Vec3 normal = (at(faces(f, 1)) - a).cross(at(faces(f, 2)) - a);
    for (int k = 0; k < 3; ++k) {
      Eigen::Map<Vec3>(sums.data() + 3 * int64_t{faces(f, k)}) += normal;
    }
  }
  for (int64_t i = 0; i < points; ++i) {
    const Eigen::Map<const Vec3> sum(sums.data() + 3 * i);
    const double length = sum.norm();
    const Vec3 normal = length > 0 && std::isfinite(length) ? Vec3(sum / length)
                                                            : Vec3::UnitZ();
    for (int d = 0; d < 3; ++d)
      normals[3 * i + d] = static_cast<float>(normal[d]);
  }
}

void EncodeNormal(const Vec3& direction, uint8_t* bytes) {
  const double length =
      std::abs(direction[0]) + std::abs(direction[1]) + std::abs(direction[2]);
  if (!(length > 0 && std::isfinite(length))) {
    bytes[0] = bytes[1] = 0;
    return;
  }
  double x = direction[0] / length, y = direction[1] / length;
  if (direction[2] < 0) Fold(x, y);
  bytes[0] = ToByte(x);
  bytes[1] = ToByte(y);
}

void EncodeNormals(std::span<const float> normals, std::span<uint8_t> bytes) {
  assert(normals.size() / 3 == bytes.size() / 2);
  for (size_t i = 0; i < normals.size() / 3; ++i) {
    EncodeNormal({normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]},
                 bytes.data() + 2 * i);
  }
}

absl::Status DecodeNormals(std::span<const uint8_t> bytes,
                           std::span<float> normals) {
  if (bytes.size() != normals.size() / 3 * 2) {
    return BadFrameData(absl::StrCat("there are ", bytes.size(), " bytes for ",
                                     normals.size() / 3, " normals"));
  }
  for (size_t i = 0; i < normals.size() / 3; ++i) {
    float x = FromByte(bytes[2 * i]), y = FromByte(bytes[2 * i + 1]);
    const float z = 1 - std::abs(x) - std::abs(y);
    if (z < 0) Fold(x, y);
    const float length = std::sqrt(x * x + y * y + z * z);
    normals[3 * i] = x / length;
    normals[3 * i + 1] = y / length;
    normals[3 * i + 2] = z / length;
  }
  return absl::OkStatus();
}

}  // namespace deform
