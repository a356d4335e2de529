#include "core/weights/compressed_weights.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <utility>

#include "core/kernels/apply_weights.h"
#include "core/weights/scheme.h"

namespace deform {
namespace {

// x, y, z of `count` rows out of tiles of sums.
std::vector<double> RowsOf(const double* tiles, int64_t count) {
  std::vector<double> rows(count * 3);
  for (int64_t k = 0; k < count; ++k) {
    const double* tile = tiles + k / kTilePoints * kTileSums + k % kTilePoints;
    for (int64_t d = 0; d < 3; ++d) rows[k * 3 + d] = tile[d * kTilePoints];
  }
  return rows;
}

// `matrix` x column, 3 numbers a row.
std::vector<double> Product(const WeightTiles& matrix,
                            const std::vector<double>& column) {
  std::vector<double> sums(matrix.tiles() * kTileSums, 0.0);
  AddTileColumns(matrix.tile(0), matrix.tiles(), matrix.columns(), nullptr,
                 matrix.columns(), column.data(), sums.data());
  return RowsOf(sums.data(), matrix.points());
}

RowMatrix ToDouble(const WeightTiles& tiles, int64_t first, int64_t count) {
  RowMatrix matrix(count, tiles.columns());
  for (int64_t i = 0; i < count; ++i) {
    for (int64_t c = 0; c < tiles.columns(); ++c) {
      matrix(i, c) = tiles.at(first + i, c);
    }
  }
  return matrix;
}

}  // namespace

CompressedWeights::CompressedWeights(Parts parts) : parts_(std::move(parts)) {
  bytes_ = points() * int64_t{sizeof(int32_t)};
  for (const Cluster& cluster : parts_.clusters) {
    bytes_ += cluster.basis.bytes();
  }
  for (const Branch& branch : parts_.branches) {
    bytes_ += branch.basis.bytes() + branch.leaf_rows.bytes() +
              branch.numbers.bytes() +
              static_cast<int64_t>(branch.leaves.size() * sizeof(Leaf));
    coefficient_rows_ += branch.leaf_rows.points();
    for (const Leaf& leaf : branch.leaves) {
      slot_count_ =
          std::max(slot_count_, leaf.first_slot + leaf.blocks * kBlockPoints);
    }
  }
}

int64_t CompressedWeights::dense_bytes() const {
  return WeightTiles::BytesFor(points(), columns());
}

CompressedWeights::Ranks CompressedWeights::ranks() const {
  Ranks ranks;
  double leaves = 0;
  for (const Cluster& cluster : parts_.clusters) {
    ranks.cluster += static_cast<double>(cluster.basis.points());
  }
  for (const Branch& branch : parts_.branches) {
    ranks.branch += static_cast<double>(branch.basis.points());
    leaves += static_cast<double>(branch.leaves.size());
    for (const Leaf& leaf : branch.leaves) {
      ranks.leaf += static_cast<double>(leaf.columns.count());
    }
  }
  ranks.cluster /= std::max(1.0, static_cast<double>(cluster_count()));
  ranks.branch /= std::max(1.0, static_cast<double>(branch_count()));
  ranks.leaf /= std::max(1.0, leaves);
  return ranks;
}

int64_t CompressedWeights::top_size() const {
  if (parts_.clusters.empty()) return 0;
  const Cluster& last = parts_.clusters.back();
  return (last.first_top + last.basis.tiles()) * kTileSums;
}

void CompressedWeights::AddToTop(int64_t cluster, const int32_t* index,
                                 int64_t changed, const double* delta,
                                 double* top) const {
  const Cluster& c = parts_.clusters[cluster];
  AddTileColumns(c.basis.tile(0), c.basis.tiles(), columns(), index, changed,
                 delta, top + c.first_top * kTileSums);
}

void CompressedWeights::CopyCoefficients(int64_t branch, const double* top,
                                         float* out) const {
  const Branch& b = parts_.branches[branch];
  const Cluster& cluster = parts_.clusters[b.cluster];
  const std::vector<double> g =
      RowsOf(top + cluster.first_top * kTileSums, cluster.basis.points());
  const std::vector<double> h = Product(b.leaf_rows, Product(b.basis, g));
  for (const Leaf& leaf : b.leaves) {
    const int64_t first = leaf.first_row * 3;
    for (int64_t k = 0; k <= leaf.columns.count(); ++k) {
      const double unit = k > leaf.columns.floats ? leaf.step : 1;
      for (int64_t d = first + k * 3; d < first + k * 3 + 3; ++d) {
        out[d] = static_cast<float>(unit * h[d]);
      }
    }
  }
}

void CompressedWeights::ApplyBranch(int64_t branch, const double* top,
                                    float* sums) const {
  const Branch& b = parts_.branches[branch];
  std::vector<float> coefficients(coefficient_rows(branch) * 3);
  CopyCoefficients(branch, top, coefficients.data());
  for (const Leaf& leaf : b.leaves) {
    ApplyMixed(b.numbers.data() + leaf.first_byte, leaf.blocks, leaf.columns,
               coefficients.data() + leaf.first_row * 3,
               sums + leaf.first_slot / kTilePoints * kTileSums);
  }
}

CompressedWeights::Place CompressedWeights::PlaceOf(int64_t slot) const {
  const auto branch =
      std::upper_bound(parts_.branches.begin(), parts_.branches.end(), slot,
                       [](int64_t s, const Branch& b) {
                         return s < b.leaves.front().first_slot;
                       }) -
      1;
  const auto leaf =
      std::upper_bound(
          branch->leaves.begin(), branch->leaves.end(), slot,
          [](int64_t s, const Leaf& l) { return s < l.first_slot; }) -
      1;
  return {branch - parts_.branches.begin(), leaf - branch->leaves.begin()};
}

void CompressedWeights::CopyRows(int64_t first, int64_t count,
                                 float* out) const {
  // Of the leaves that these points lie in: mean and directions, (1 + k) x C.
  std::map<std::pair<int64_t, int64_t>, RowMatrix> bases;
  Eigen::RowVectorXd row;
  for (int64_t i = first; i < first + count; ++i, out += columns()) {
    if (slot(i) < 0) {
      std::fill_n(out, columns(), 0.0f);
      continue;
    }
    const Place place = PlaceOf(slot(i));
    const Branch& branch = parts_.branches[place.branch];
    const Leaf& leaf = branch.leaves[place.leaf];
    RowMatrix& basis = bases[{place.branch, place.leaf}];
    if (basis.size() == 0) {
      const WeightTiles& top = parts_.clusters[branch.cluster].basis;
      basis =
          ToDouble(branch.leaf_rows, leaf.first_row, leaf.columns.count() + 1) *
          ToDouble(branch.basis, 0, branch.basis.points()) *
          ToDouble(top, 0, top.points());
    }
    row = basis.row(0);
    for (int64_t k = 0; k < leaf.columns.count(); ++k) {
      row += LeafNumber(leaf, branch.numbers.data(), k, slot(i)) *
             basis.row(k + 1);
    }
    for (int64_t c = 0; c < columns(); ++c) out[c] = static_cast<float>(row[c]);
  }
}

double LeafNumber(const CompressedWeights::Leaf& leaf, const std::byte* numbers,
                  int64_t k, int64_t slot) {
  const int64_t i = slot - leaf.first_slot;
  const MixedColumns& columns = leaf.columns;
  const std::byte* block =
      numbers + leaf.first_byte + i / kBlockPoints * columns.block_bytes();
  const double number = MixedNumber(block, columns, k, i % kBlockPoints);
  return k < columns.floats ? number : number * leaf.step;
}

}  // namespace deform
