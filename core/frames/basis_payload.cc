#include "core/frames/basis_payload.h"

#include <atomic>
#include <cassert>
#include <cmath>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/frames/encoding.h"
#include "core/frames/leaf_bits.h"
#include "core/frames/leaf_rounding.h"

namespace deform {
namespace {

using Leaf = LeafBasis::Leaf;

// Sums of larger coefficients might be no floats.
constexpr double kLargest = 1e30;

int64_t HeadBytes(int dimension) {
  return (dimension * dimension + 2 * dimension + 1) * int64_t{sizeof(double)};
}

template <typename Number>
void Append(Number number, std::vector<uint8_t>& bytes) {
  const auto* from = reinterpret_cast<const uint8_t*>(&number);
  bytes.insert(bytes.end(), from, from + sizeof(number));
}

// There are so many bytes.
template <typename Number>
Number Take(std::span<const uint8_t>& bytes) {
  Number number;
  std::memcpy(&number, bytes.data(), sizeof(number));
  bytes = bytes.subspan(sizeof(number));
  return number;
}

// Calls visit(number) for all of T, in the order of the format.
template <typename Map, typename Visit>
void ForEachNumber(Map& map, int dimension, Visit visit) {
  for (int i = 0; i < dimension; ++i) {
    for (int j = 0; j < dimension; ++j) visit(map.linear(i, j));
  }
  for (int d = 0; d < dimension; ++d) visit(map.from(d));
  for (int d = 0; d < dimension; ++d) visit(map.to(d));
}

absl::Status CheckNumbers(const LeafPose& pose, int dimension) {
  bool good = true;
  ForEachNumber(pose.map, dimension, [&](double number) {
    good = good && std::abs(number) <= kLargest;
  });
  for (const float number : pose.coefficients) {
    good = good && std::abs(number) <= kLargest;
  }
  if (good) return absl::OkStatus();
  return InvalidInput("NON_FINITE", "pose",
                      absl::StrCat("a pose has coefficients that are not "
                                   "finite, or beyond ",
                                   kLargest));
}

// Empty if a leaf cannot be rounded.
std::vector<RoundedLeaf> RoundAll(const LeafPose& pose, const LeafBasis& basis,
                                  double tolerance, ThreadPool* pool) {
  std::vector<RoundedLeaf> rounded(basis.leaves().size());
  std::atomic<bool> all = true;
  ParallelFor(pool, std::ssize(rounded), nullptr, [&](int64_t l) {
    const Leaf& leaf = basis.leaves()[l];
    if (!RoundLeaf(leaf, basis.dimension(),
                   pose.coefficients.data() + leaf.first_row * 3, tolerance,
                   rounded[l])) {
      all = false;
    }
  });
  if (!all) rounded.clear();
  return rounded;
}

absl::Status TakeMap(std::span<const uint8_t>& bytes, int dimension,
                     AffineMap& map) {
  bool finite = true;
  ForEachNumber(map, dimension, [&](double& number) {
    number = Take<double>(bytes);
    finite = finite && std::isfinite(number);
  });
  if (finite) return absl::OkStatus();
  return BadFrameData("the frame's map is not finite");
}

// There are as many bytes as floats are.
void TakeFloats(std::span<const uint8_t> bytes, int dimension,
                std::vector<float>& coefficients) {
  for (size_t at = 0; at < coefficients.size(); at += 3) {
    for (int d = 0; d < dimension; ++d) {
      coefficients[at + d] = Take<float>(bytes);
    }
  }
}

absl::Status TakeBits(std::span<const uint8_t> bytes, double unit,
                      const LeafBasis& basis,
                      std::vector<float>& coefficients) {
  LeafBitReader reader(bytes, unit, basis.dimension());
  for (int64_t l = 0; l < std::ssize(basis.leaves()); ++l) {
    const Leaf& leaf = basis.leaves()[l];
    DEFORM_RETURN_IF_ERROR(
        reader.Take(leaf, l, coefficients.data() + leaf.first_row * 3));
  }
  if (reader.done()) return absl::OkStatus();
  return BadFrameData("the frame goes on behind its last leaf");
}

}  // namespace

int64_t MaxLeafPoseBytes(const LeafBasis& basis) {
  return HeadBytes(basis.dimension()) +
         basis.coefficient_rows() * basis.dimension() * int64_t{sizeof(float)};
}

absl::StatusOr<std::vector<uint8_t>> EncodeLeafPose(const LeafPose& pose,
                                                    const LeafBasis& basis,
                                                    double tolerance,
                                                    ThreadPool* pool) {
  assert(std::ssize(pose.coefficients) == basis.coefficient_rows() * 3);
  assert(tolerance >= 0);
  const int dimension = basis.dimension();
  DEFORM_RETURN_IF_ERROR(CheckNumbers(pose, dimension));
  std::vector<uint8_t> bytes;
  ForEachNumber(pose.map, dimension,
                [&](double number) { Append(number, bytes); });
  const size_t begin = bytes.size();
  if (const double unit = UnitFor(tolerance); std::isnormal(unit)) {
    const auto rounded = RoundAll(pose, basis, tolerance, pool);
    if (rounded.size() == basis.leaves().size()) {
      Append(unit, bytes);
      AppendLeafBits(rounded, dimension, bytes);
      if (std::ssize(bytes) <= MaxLeafPoseBytes(basis)) return bytes;
      bytes.resize(begin);
    }
  }
  Append(0.0, bytes);
  for (int64_t k = 0; k < basis.coefficient_rows(); ++k) {
    for (int d = 0; d < dimension; ++d) {
      Append(pose.coefficients[k * 3 + d], bytes);
    }
  }
  return bytes;
}

absl::StatusOr<LeafPose> DecodeLeafPose(std::span<const uint8_t> bytes,
                                        const LeafBasis& basis) {
  const int dimension = basis.dimension();
  const auto size = static_cast<int64_t>(bytes.size());
  const int64_t least = HeadBytes(dimension), most = MaxLeafPoseBytes(basis);
  if (size < least || size > most) {
    return BadFrameData(absl::StrCat("the frame has ", size,
                                     " bytes, its basis needs ", least, " to ",
                                     most));
  }
  LeafPose pose;
  DEFORM_RETURN_IF_ERROR(TakeMap(bytes, dimension, pose.map));
  const auto unit = Take<double>(bytes);
  if (!(unit >= 0 && std::isfinite(unit))) {
    return BadFrameData(
        absl::StrCat("the frame's unit is ", unit, ", not 0 or positive"));
  }
  pose.coefficients.assign(basis.coefficient_rows() * 3, 0.0F);
  if (unit > 0) {
    DEFORM_RETURN_IF_ERROR(TakeBits(bytes, unit, basis, pose.coefficients));
  } else if (size == most) {
    TakeFloats(bytes, dimension, pose.coefficients);
  } else {
    return BadFrameData(
        absl::StrCat("the frame has ", size, " bytes, its floats need ", most));
  }
  for (const float coefficient : pose.coefficients) {
    if (!std::isfinite(coefficient)) {
      return BadFrameData("the frame has a coefficient that is not finite");
    }
  }
  return pose;
}

}  // namespace deform
