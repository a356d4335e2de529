// Weights as few numbers: nested bases of clusters of neighbouring points.
//
// Coordinates are smooth, so the rows of neighbours span few directions. Points
// are grouped three times, into clusters, their branches, and the leaves of
// these; each level expresses its rows in few coefficients of the level above:
//
//   weights of a leaf = (1 mean + U) T_leaf T_branch Z
//
// with U in small integers. So the sums over all columns come in four steps,
// from some thousand numbers to the displacements of all points:
//
//   g = Z x,  g' = T_branch g,  h = T_leaf g',  sums = h_mean + U h
//
// The first is linear in x, so that it follows moved columns alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/kernels/apply_mixed.h"
#include "core/kernels/weight_tiles.h"
#include "core/kernels/zeroed_array.h"

namespace deform {

// Immutable once made (compress_weights.h). Sums are in tiles of points by
// slot: neighbours in space have neighbouring slots.
class CompressedWeights {
 public:
  struct Cluster {
    WeightTiles basis;      // Z: rank x C.
    int64_t first_top = 0;  // Tile of its g among those of all clusters.
  };
  struct Leaf {
    int64_t first_slot = 0;  // Divisible by 64.
    int64_t blocks = 0;
    MixedColumns columns;
    double step = 0;         // What 1 of an integer column stands for.
    int64_t first_row = 0;   // Its mean among the leaf rows of the branch.
    int64_t first_byte = 0;  // Of its U among the numbers of the branch.
  };
  struct Branch {
    int64_t cluster = 0;
    WeightTiles basis;      // T_branch: rank x rank of the cluster.
    WeightTiles leaf_rows;  // Mean and T_leaf of each leaf x rank.
    std::vector<Leaf> leaves;
    ZeroedArray<std::byte> numbers;
  };
  struct Parts {
    int64_t columns = 0;
    std::vector<int32_t> slots;  // N; -1 for points without weights.
    std::vector<Cluster> clusters;
    std::vector<Branch> branches;
    double tolerance = 0;
    double bound = 0;
  };

  explicit CompressedWeights(Parts parts);

  // What it was made of.
  const Parts& parts() const { return parts_; }
  int64_t points() const { return static_cast<int64_t>(parts_.slots.size()); }
  int64_t columns() const { return parts_.columns; }
  int64_t bytes() const { return bytes_; }
  // Of the same weights in dense tiles.
  int64_t dense_bytes() const;

  // Proved while compressing: for any displacements x of the columns, no point
  // is farther than bound() x max over c of |x_c| / R_c from where the weights
  // that were compressed put it. R_c: compress_weights.h. The last sums are
  // made in float; for them it holds 3 roundings of the largest terms there can
  // be, several times what adversarial poses were seen to lose.
  double bound() const { return parts_.bound; }
  // What was asked for. The bound exceeds it only where float does.
  double tolerance() const { return parts_.tolerance; }
  // Means of the ranks of the three levels.
  struct Ranks {
    double cluster = 0;
    double branch = 0;
    double leaf = 0;
  };
  Ranks ranks() const;

  // Where the sums of a point are; -1 if it has no weights.
  int64_t slot(int64_t point) const { return parts_.slots[point]; }
  int64_t slot_count() const { return slot_count_; }  // Divisible by 64.
  // Doubles of the g of all clusters.
  int64_t top_size() const;

  int64_t cluster_count() const {
    return static_cast<int64_t>(parts_.clusters.size());
  }
  int64_t branch_count() const {
    return static_cast<int64_t>(parts_.branches.size());
  }

  // Adds `changed` columns (all or `index`) times delta, 3 each, to the g of a
  // cluster. `top` has top_size() doubles.
  void AddToTop(int64_t cluster, const int32_t* index, int64_t changed,
                const double* delta, double* top) const;
  // What U of the leaves is multiplied with: h_mean, then one row a column, of
  // leaf after leaf, branch after branch.
  int64_t coefficient_rows() const { return coefficient_rows_; }
  int64_t coefficient_rows(int64_t branch) const {
    return parts_.branches[branch].leaf_rows.points();
  }
  // Those of a branch from g: 3 floats a row. A leaf's step is folded into
  // those of its integer columns.
  void CopyCoefficients(int64_t branch, const double* top, float* out) const;
  // Rewrites the sums of a branch's points from g. `sums` has 3 floats per
  // slot, in tiles. Calls for different branches may run in parallel.
  void ApplyBranch(int64_t branch, const double* top, float* sums) const;

  // Weights of points [first, first + count), decompressed: count x C. Points
  // without weights get zeros. O(C) a number and O(100 C) a leaf.
  void CopyRows(int64_t first, int64_t count, float* out) const;

 private:
  struct Place {
    int64_t branch;
    int64_t leaf;
  };
  Place PlaceOf(int64_t slot) const;

  Parts parts_;
  int64_t bytes_ = 0;
  int64_t slot_count_ = 0;
  int64_t coefficient_rows_ = 0;
};

// Number `k` of the U of a slot of a leaf, in units of its coefficient.
double LeafNumber(const CompressedWeights::Leaf& leaf, const std::byte* numbers,
                  int64_t k, int64_t slot);

}  // namespace deform
