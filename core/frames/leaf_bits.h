// Rounded coefficients of leaves as bits; basis_payload.h has the format.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "core/frames/folded_bits.h"
#include "core/frames/leaf_basis.h"
#include "core/frames/leaf_rounding.h"

namespace deform {

// Appends all leaves of a basis.
void AppendLeafBits(std::span<const RoundedLeaf> leaves, int dimension,
                    std::vector<uint8_t>& bytes);

// The reverse, from outside, leaf after leaf.
class LeafBitReader {
 public:
  LeafBitReader(std::span<const uint8_t> bytes, double unit, int dimension)
      : reader_(bytes), unit_(unit), dimension_(dimension) {}

  // Writes the coefficients of the next leaf, rows() x 3; `out` holds zeros.
  // `index` is for messages. InvalidArgument BAD_FRAME.
  absl::Status Take(const LeafBasis::Leaf& leaf, int64_t index, float* out);

  // Nothing is left.
  bool done() const { return reader_.done(); }

 private:
  absl::Status TakeScale(int64_t index);
  // Of the group that begins at row `k`.
  absl::Status TakeParameter(int64_t k, int64_t index, int& parameter);

  FoldedBitReader reader_;
  const double unit_;
  const int dimension_;
  int scale_ = 0;
  int first_parameter_ = 0;  // Of the last leaf's first group.
};

}  // namespace deform
