#include "core/frames/leaf_basis.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "core/frames/leaf_basis_format.h"

namespace deform {
namespace {

// e_k, and 0 for a column of zeros.
int8_t ExponentOf(const std::byte* numbers, int64_t blocks,
                  const MixedColumns& columns, int64_t k) {
  double squares = 0;
  for (int64_t b = 0; b < blocks; ++b) {
    const std::byte* block = numbers + b * columns.block_bytes();
    for (int64_t i = 0; i < kBlockPoints; ++i) {
      const double number = MixedNumber(block, columns, k, i);
      squares += number * number;
    }
  }
  if (!(squares > 0)) return 0;
  const int exponent =
      std::ilogb(squares / static_cast<double>(blocks * kBlockPoints));
  // The root's, rounded: mean squares from 4^e / 2 to 2 4^e make e.
  return static_cast<int8_t>(
      std::clamp((exponent + 1) >> 1, -INT8_MAX, INT8_MAX));
}

// What a binding does not have as the format has it.
struct Own {
  std::shared_ptr<const Binding> binding;
  LeafBasisHead head{};
  std::vector<LeafHead> leaves;
  std::vector<int8_t> exponents;  // And the padding behind them.
};

void Describe(const CompressedWeights& weights, Own& own) {
  for (const CompressedWeights::Branch& branch : weights.parts().branches) {
    for (const CompressedWeights::Leaf& leaf : branch.leaves) {
      own.leaves.push_back(
          {.blocks = static_cast<uint32_t>(leaf.blocks),
           .floats = static_cast<uint32_t>(leaf.columns.floats),
           .shorts = static_cast<uint32_t>(leaf.columns.shorts),
           .bytes = static_cast<uint32_t>(leaf.columns.bytes)});
      for (int64_t k = 0; k < leaf.columns.count(); ++k) {
        own.exponents.push_back(
            ExponentOf(branch.numbers.data() + leaf.first_byte, leaf.blocks,
                       leaf.columns, k));
      }
    }
  }
  own.head = {.version = kLeafBasisVersion,
              .dimension = static_cast<uint32_t>(own.binding->dimension()),
              .points = static_cast<uint32_t>(weights.points()),
              .slots = static_cast<uint32_t>(std::ranges::count_if(
                  weights.parts().slots, [](int32_t s) { return s >= 0; })),
              .leaves = static_cast<uint32_t>(own.leaves.size())};
  const LeafBasisLayout layout(weights.points(), std::ssize(own.leaves),
                               std::ssize(own.exponents));
  own.exponents.resize(layout.blocks - layout.exponents);
}

}  // namespace

std::shared_ptr<const LeafBasis> LeafBasis::Of(
    std::shared_ptr<const Binding> binding) {
  auto own = std::make_shared<Own>();
  own->binding = std::move(binding);
  const CompressedWeights& weights = *own->binding->compressed();
  Describe(weights, *own);

  std::shared_ptr<LeafBasis> basis(new LeafBasis);
  basis->owner_ = own;
  basis->dimension_ = own->binding->dimension();
  basis->point_count_ = weights.points();
  basis->rest_ = own->binding->model()->positions().data();
  basis->slots_ = weights.parts().slots;
  assert(weights.points() - own->head.slots ==
         std::ssize(own->binding->fixed_points()));
  basis->AddSection(&own->head, sizeof(own->head));
  basis->AddSection(own->leaves.data(),
                    std::ssize(own->leaves) * int64_t{sizeof(LeafHead)});
  basis->AddSection(basis->rest_,
                    weights.points() * 3 * int64_t{sizeof(double)});
  basis->AddSection(basis->slots_.data(),
                    weights.points() * int64_t{sizeof(int32_t)});
  basis->AddSection(own->exponents.data(), std::ssize(own->exponents));
  const int8_t* exponents = own->exponents.data();
  for (const CompressedWeights::Branch& branch : weights.parts().branches) {
    for (const CompressedWeights::Leaf& leaf : branch.leaves) {
      const std::byte* numbers = branch.numbers.data() + leaf.first_byte;
      basis->AddLeaf(leaf.blocks, leaf.columns, exponents, numbers);
      assert(basis->leaves_.back().first_slot == leaf.first_slot);
      basis->AddSection(numbers, leaf.blocks * leaf.columns.block_bytes());
      exponents += leaf.columns.count();
    }
  }
  assert(basis->coefficient_rows() == weights.coefficient_rows());
  return basis;
}

void LeafBasis::AddLeaf(int64_t blocks, const MixedColumns& columns,
                        const int8_t* exponents, const std::byte* numbers) {
  leaves_.push_back({.first_slot = slot_count_,
                     .blocks = blocks,
                     .columns = columns,
                     .first_row = coefficient_rows_,
                     .exponents = exponents,
                     .numbers = numbers});
  slot_count_ += blocks * kBlockPoints;
  coefficient_rows_ += leaves_.back().rows();
}

void LeafBasis::AddSection(const void* bytes, int64_t count) {
  if (count == 0) return;
  const auto* from = static_cast<const std::byte*>(bytes);
  if (!sections_.empty() &&
      sections_.back().data() + sections_.back().size() == from) {
    from = sections_.back().data();
    count += std::ssize(sections_.back());
    sections_.pop_back();
  }
  sections_.emplace_back(from, static_cast<size_t>(count));
}

std::vector<std::span<const std::byte>> LeafBasis::Pieces(int64_t most) const {
  std::vector<std::span<const std::byte>> pieces;
  for (std::span<const std::byte> left : sections_) {
    while (!left.empty()) {
      pieces.push_back(
          left.first(std::min(left.size(), static_cast<size_t>(most))));
      left = left.subspan(pieces.back().size());
    }
  }
  return pieces;
}

int64_t LeafBasis::byte_count() const {
  int64_t count = 0;
  for (const auto& section : sections_) count += std::ssize(section);
  return count;
}

std::vector<uint8_t> LeafBasis::ToBytes() const {
  std::vector<uint8_t> bytes;
  bytes.reserve(byte_count());
  for (const auto& section : sections_) {
    const auto* from = reinterpret_cast<const uint8_t*>(section.data());
    bytes.insert(bytes.end(), from, from + section.size());
  }
  return bytes;
}

}  // namespace deform
