// A LeafBasis from outside: every number is checked before it is believed.
#include <cmath>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/frames/leaf_basis.h"
#include "core/frames/leaf_basis_format.h"
#include "core/kernels/zeroed_array.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

absl::Status Bad(absl::string_view message) {
  return InvalidInput("BAD_BASIS", "leaf_basis", message);
}

absl::Status CheckHead(const LeafBasisHead& head) {
  if (head.version != kLeafBasisVersion) {
    return Bad(absl::StrCat("the basis is of format ", head.version, ", only ",
                            kLeafBasisVersion, " is known"));
  }
  if (head.dimension != 2 && head.dimension != 3) {
    return Bad(absl::StrCat("the basis is of dimension ", head.dimension,
                            ", not 2 or 3"));
  }
  if (head.points == 0 || head.points > INT32_MAX) {
    return Bad(absl::StrCat("the basis is of ", head.points,
                            " points, not 1 to ", INT32_MAX));
  }
  if (head.slots > head.points) {
    return Bad(absl::StrCat("the basis has ", head.slots, " slots for ",
                            head.points, " points"));
  }
  if (head.leaves > BlocksOf(head.slots)) {
    return Bad(absl::StrCat("the basis has ", head.leaves, " leaves for ",
                            BlocksOf(head.slots), " blocks"));
  }
  if (head.zero != 0) {
    return Bad("bytes 20 to 23 of the basis are not 0");
  }
  return absl::OkStatus();
}

int64_t ColumnsOf(const std::vector<LeafHead>& leaves) {
  int64_t columns = 0;
  for (const LeafHead& leaf : leaves) columns += leaf.columns().count();
  return columns;
}

// The table behind the head. Afterwards counts are in proportion to the bytes.
absl::StatusOr<std::vector<LeafHead>> TakeLeafHeads(
    std::span<const uint8_t> bytes, const LeafBasisHead& head) {
  const auto size = static_cast<int64_t>(bytes.size());
  if (LeafBasisLayout(0, head.leaves, 0).rest > size) {
    return Bad(absl::StrCat("the basis ends within its ", head.leaves,
                            " leaves, after ", size, " bytes"));
  }
  std::vector<LeafHead> leaves(head.leaves);
  int64_t blocks = 0;
  for (size_t i = 0; i < leaves.size(); ++i) {
    std::memcpy(&leaves[i],
                bytes.data() + sizeof(LeafBasisHead) + i * sizeof(LeafHead),
                sizeof(LeafHead));
    if (leaves[i].blocks == 0) {
      return Bad(absl::StrCat("leaf ", i, " of the basis has no block"));
    }
    blocks += leaves[i].blocks;
  }
  if (blocks != BlocksOf(head.slots)) {
    return Bad(absl::StrCat("the leaves of the basis have ", blocks,
                            " blocks, its ", head.slots, " slots fill ",
                            BlocksOf(head.slots)));
  }
  const int64_t columns = ColumnsOf(leaves);
  const LeafBasisLayout layout(head.points, head.leaves, columns);
  int64_t left = size - layout.blocks;
  for (const LeafHead& leaf : leaves) {
    if (left < 0) break;
    const int64_t block_bytes = leaf.columns().block_bytes();
    left = block_bytes > 0 && leaf.blocks > left / block_bytes
               ? -1
               : left - leaf.blocks * block_bytes;
  }
  if (left != 0) {
    return Bad(absl::StrCat("the basis has ", size, " bytes, ",
                            left > 0 ? "more" : "fewer", " than its ",
                            head.points, " points and ", head.leaves,
                            " leaves of ", columns, " columns need"));
  }
  return leaves;
}

absl::Status CheckRest(const Eigen::Map<const Positions>& rest, int dimension) {
  for (int64_t i = 0; i < rest.rows(); ++i) {
    for (int d = 0; d < 3; ++d) {
      if (!(std::abs(rest(i, d)) <= kMaxCoordinate)) {
        return Bad(absl::StrCat("point ", i, " of the basis is at ", rest(i, d),
                                ": not finite, or beyond ", kMaxCoordinate));
      }
    }
    if (dimension == 2 && rest(i, 2) != 0) {
      return Bad(absl::StrCat("point ", i,
                              " of the basis, of dimension 2, has a z of ",
                              rest(i, 2)));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckSlots(std::span<const int32_t> slots, int64_t count) {
  std::vector<bool> taken(count);
  int64_t left = count;
  for (size_t i = 0; i < slots.size(); ++i) {
    const int32_t slot = slots[i];
    if (slot == -1) continue;
    if (slot < 0 || slot >= count) {
      return Bad(absl::StrCat("point ", i, " of the basis has slot ", slot,
                              " of ", count));
    }
    if (taken[slot]) {
      return Bad(absl::StrCat("point ", i, " of the basis has slot ", slot,
                              ", which another has"));
    }
    taken[slot] = true;
    --left;
  }
  if (left == 0) return absl::OkStatus();
  return Bad(absl::StrCat(left, " of the ", count,
                          " slots of the basis have no point"));
}

absl::Status CheckPadding(std::span<const std::byte> padding) {
  for (const std::byte byte : padding) {
    if (byte != std::byte{0}) {
      return Bad("the basis has other bytes than 0 before its blocks");
    }
  }
  return absl::OkStatus();
}

absl::Status CheckFloats(const std::vector<LeafBasis::Leaf>& leaves) {
  for (size_t l = 0; l < leaves.size(); ++l) {
    const MixedColumns& columns = leaves[l].columns;
    if (columns.floats == 0) continue;
    for (int64_t b = 0; b < leaves[l].blocks; ++b) {
      const auto* floats = reinterpret_cast<const float*>(
          leaves[l].numbers + b * columns.block_bytes());
      for (int64_t i = 0; i < columns.floats * kBlockPoints; ++i) {
        if (std::isfinite(floats[i])) continue;
        return Bad(absl::StrCat("leaf ", l,
                                " of the basis has a number that is not "
                                "finite"));
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::shared_ptr<const LeafBasis>> LeafBasis::FromBytes(
    std::span<const uint8_t> bytes, int64_t limit) {
  const auto size = static_cast<int64_t>(bytes.size());
  if (size > limit) {
    return Bad(absl::StrCat("the basis has ", size, " bytes, more than ", limit,
                            " are taken"));
  }
  LeafBasisHead head;
  if (bytes.size() < sizeof(head)) {
    return Bad(absl::StrCat("the basis has ", size, " bytes, its head alone ",
                            sizeof(head)));
  }
  std::memcpy(&head, bytes.data(), sizeof(head));
  DEFORM_RETURN_IF_ERROR(CheckHead(head));
  DEFORM_ASSIGN_OR_RETURN(const std::vector<LeafHead> leaves,
                          TakeLeafHeads(bytes, head));
  auto copy = std::make_shared<ZeroedArray<std::byte>>(size);
  std::memcpy(copy->data(), bytes.data(), bytes.size());

  std::shared_ptr<LeafBasis> basis(new LeafBasis);
  basis->owner_ = copy;
  basis->AddSection(copy->data(), size);
  basis->dimension_ = static_cast<int>(head.dimension);
  basis->point_count_ = head.points;
  const LeafBasisLayout layout(head.points, head.leaves, ColumnsOf(leaves));
  const std::byte* const at = copy->data();
  basis->rest_ = reinterpret_cast<const double*>(at + layout.rest);
  basis->slots_ = {reinterpret_cast<const int32_t*>(at + layout.slots),
                   head.points};
  const auto* exponents =
      reinterpret_cast<const int8_t*>(at + layout.exponents);
  const std::byte* numbers = at + layout.blocks;
  for (const LeafHead& leaf : leaves) {
    const MixedColumns columns = leaf.columns();
    basis->AddLeaf(leaf.blocks, columns, exponents, numbers);
    exponents += columns.count();
    numbers += leaf.blocks * columns.block_bytes();
  }
  DEFORM_RETURN_IF_ERROR(CheckRest(basis->rest(), basis->dimension_));
  DEFORM_RETURN_IF_ERROR(CheckSlots(basis->slots_, head.slots));
  DEFORM_RETURN_IF_ERROR(
      CheckPadding({at + layout.padding, at + layout.blocks}));
  DEFORM_RETURN_IF_ERROR(CheckFloats(basis->leaves_));
  return basis;
}

}  // namespace deform
