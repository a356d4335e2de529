// What a client downloads once a binding, so that frames need to bring it leaf
// coefficients only (basis_payload.h): the leaf bases of compressed weights
// (core/weights/compressed_weights.h), and where the points are at rest.
//
// Points with weights have slots, neighbours in space neighbouring ones. 64
// slots are a block, some blocks a leaf, and all points of a leaf move by few
// numbers: for the point of a slot, with the leaf's coefficients c_0, c_1 ...
// of 3 numbers each,
//
//   x = T rest + c_0 + sum over the leaf's columns k = 1, 2 ... of u_k c_k
//
// with u_k the number that the basis has for the slot in column k. T is an
// affine map, the same for all. Points without slot stay at rest.
//
// Bit by bit, all little-endian:
//
//   uint32   1, the version of this format
//   uint32   dimension, 2 or 3
//   uint32   N, points of the model, at least 1
//   uint32   M, points with slots, at most N
//   uint32   L, leaves
//   uint32   0
//   L times  uint32 blocks, at least 1; uint32 F, uint32 S, uint32 B: columns
//            of the leaf that are float32, int16 and int8, in this order
//   N times  3 float64: where a point is at rest, in model units; z is 0 in 2D
//   N times  int32: the slot of a point, each once; -1 if it has none
//   int8     e_k for each column of each leaf: sqrt(mean of u_k^2) is 2^e_k,
//            about; payloads count coefficients in such steps
//   0 to 63  bytes of 0, up to an offset divisible by 64
//   blocks   of leaf after leaf: F times 64 float32, S times 64 int16, B times
//            64 int8, where number i of each 64 is of the block's slot i
//
// The first leaf has slots 0 to 64 blocks - 1, the next goes on from there. All
// blocks are full but the last of the last leaf: M / 64, rounded up, in all.
// Numbers of slots from M on say nothing.
//
// Rest positions are doubles, so that who receives this can place points where
// the server does, to the last bit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/kernels/apply_mixed.h"
#include "core/mesh/types.h"
#include "core/weights/binding.h"

namespace deform {

// Immutable; travels as shared_ptr<const LeafBasis>.
class LeafBasis {
 public:
  struct Leaf {
    int64_t first_slot = 0;
    int64_t blocks = 0;
    MixedColumns columns;
    int64_t first_row = 0;  // Its c_0 among the coefficients of all leaves.
    const int8_t* exponents = nullptr;   // e_k of c_1, c_2 ...
    const std::byte* numbers = nullptr;  // As ApplyMixed() reads them.

    int64_t rows() const { return 1 + columns.count(); }
  };

  // That of a binding with compressed weights (compressed() is not null), which
  // it keeps alive: it shares their numbers and the model's positions, and adds
  // some bytes a leaf. O(N) times the columns of a leaf. Two bindings with the
  // same model and weights have the same bytes.
  static std::shared_ptr<const LeafBasis> Of(
      std::shared_ptr<const Binding> binding);

  // From outside; copies the bytes, takes little more. InvalidArgument
  // BAD_BASIS if there are more than `limit` bytes, or they are not as above.
  static absl::StatusOr<std::shared_ptr<const LeafBasis>> FromBytes(
      std::span<const uint8_t> bytes, int64_t limit);

  // The format above, in pieces of at most `most` bytes that live as long as
  // this: to be sent or hashed one after the other.
  std::vector<std::span<const std::byte>> Pieces(int64_t most) const;
  int64_t byte_count() const;
  std::vector<uint8_t> ToBytes() const;

  int dimension() const { return dimension_; }
  int64_t point_count() const { return point_count_; }
  // N x 3.
  Eigen::Map<const Positions> rest() const { return {rest_, point_count_, 3}; }
  // N; -1 for points that stay at rest.
  std::span<const int32_t> slots() const { return slots_; }
  // 64 for each block.
  int64_t slot_count() const { return slot_count_; }
  const std::vector<Leaf>& leaves() const { return leaves_; }
  // Coefficients of all leaves, of 3 numbers each: as many as
  // Deformer::LeafCoefficients() has.
  int64_t coefficient_rows() const { return coefficient_rows_; }

 private:
  LeafBasis() = default;
  // The next leaf, and what it reads.
  void AddLeaf(int64_t blocks, const MixedColumns& columns,
               const int8_t* exponents, const std::byte* numbers);
  // The next bytes of the format, which live as long as owner_.
  void AddSection(const void* bytes, int64_t count);

  int dimension_ = 3;
  int64_t point_count_ = 0;
  int64_t slot_count_ = 0;
  int64_t coefficient_rows_ = 0;
  const double* rest_ = nullptr;
  std::span<const int32_t> slots_;
  std::vector<Leaf> leaves_;
  std::vector<std::span<const std::byte>> sections_;
  std::shared_ptr<const void> owner_;  // Of what all these point to.
};

}  // namespace deform
