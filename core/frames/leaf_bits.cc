#include "core/frames/leaf_bits.h"

#include <algorithm>
#include <bit>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/frames/encoding.h"

namespace deform {
namespace {

// Rows of coefficients that share a parameter.
constexpr int64_t kGroupRows = 2;

// With which changes are told.
constexpr int kOfScales = 2;
int OfParameters(bool first_of_leaf) { return first_of_leaf ? 1 : 0; }

// The parameter, plus 1, that takes the fewest bits; 0 for nothing but zeros.
// `k` is the parameter of its change since the last.
int ParameterFor(std::span<const int32_t> numbers, int last, int k) {
  uint64_t sum = 0;
  for (const int32_t number : numbers) sum += Folded(number);
  if (sum == 0) return 0;
  const int about = std::bit_width(sum / numbers.size());
  int best = 0;
  int64_t least = INT64_MAX;
  for (int p = std::max(1, about - 1);
       p <= std::min(about + 2, kMaxFoldedParameter); ++p) {
    int64_t bits = FoldedBits(p - last, k);
    for (const int32_t number : numbers) bits += FoldedBits(number, p - 1);
    if (bits < least) {
      least = bits;
      best = p;
    }
  }
  return best;
}

absl::Status Ends(int64_t index) {
  return BadFrameData(absl::StrCat(
      "the frame's bits end, or go beyond 32 a number, in leaf ", index));
}

// False, and nothing changes, if that would be out of [0, most].
bool Change(int32_t change, int most, int& value) {
  const int64_t next = int64_t{value} + change;
  if (next < 0 || next > most) return false;
  value = static_cast<int>(next);
  return true;
}

}  // namespace

void AppendLeafBits(std::span<const RoundedLeaf> leaves, int dimension,
                    std::vector<uint8_t>& bytes) {
  FoldedBitWriter writer(bytes);
  int last_scale = 0, last_first = 0;
  for (const RoundedLeaf& leaf : leaves) {
    writer.Put(leaf.scale - last_scale, kOfScales);
    last_scale = leaf.scale;
    int last = last_first;
    std::span<const int32_t> left = leaf.numbers;
    for (bool first = true; !left.empty(); first = false) {
      const auto group = left.first(
          std::min(left.size(), static_cast<size_t>(kGroupRows * dimension)));
      left = left.subspan(group.size());
      const int k = OfParameters(first);
      const int p = ParameterFor(group, last, k);
      writer.Put(p - last, k);
      if (p > 0) {
        for (const int32_t number : group) writer.Put(number, p - 1);
      }
      last = p;
      if (first) last_first = p;
    }
  }
  writer.Finish();
}

absl::Status LeafBitReader::TakeScale(int64_t index) {
  int32_t change = 0;
  if (!reader_.Take(kOfScales, change)) return Ends(index);
  if (!Change(change, kMaxScale, scale_)) {
    return BadFrameData(absl::StrCat("leaf ", index, " tells a step of ",
                                     int64_t{scale_} + change, ", not 0 to ",
                                     kMaxScale));
  }
  return absl::OkStatus();
}

absl::Status LeafBitReader::TakeParameter(int64_t k, int64_t index,
                                          int& parameter) {
  int32_t change = 0;
  if (!reader_.Take(OfParameters(k == 0), change)) return Ends(index);
  if (!Change(change, kMaxFoldedParameter, parameter)) {
    return BadFrameData(absl::StrCat("leaf ", index, " tells a parameter of ",
                                     int64_t{parameter} + change, ", not 0 to ",
                                     kMaxFoldedParameter));
  }
  if (k == 0) first_parameter_ = parameter;
  return absl::OkStatus();
}

absl::Status LeafBitReader::Take(const LeafBasis::Leaf& leaf, int64_t index,
                                 float* out) {
  DEFORM_RETURN_IF_ERROR(TakeScale(index));
  int parameter = first_parameter_;
  for (int64_t k = 0; k < leaf.rows(); ++k) {
    if (k % kGroupRows == 0) {
      DEFORM_RETURN_IF_ERROR(TakeParameter(k, index, parameter));
    }
    if (parameter == 0) continue;
    const double step =
        CoefficientStep(unit_, scale_, k == 0 ? 0 : leaf.exponents[k - 1]);
    for (int d = 0; d < dimension_; ++d) {
      int32_t steps = 0;
      if (!reader_.Take(parameter - 1, steps)) return Ends(index);
      out[k * 3 + d] = static_cast<float>(steps * step);
    }
  }
  return absl::OkStatus();
}

}  // namespace deform
