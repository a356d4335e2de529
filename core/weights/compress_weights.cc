#include "core/weights/compress_weights.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/kernels/multiply_tiles.h"
#include "core/weights/leaf_fit.h"
#include "core/weights/point_clusters.h"
#include "core/weights/row_basis.h"

namespace deform {
namespace {

// Points of the three levels. More columns make smaller clusters, so that the
// weights of one in double stay within 64 MiB.
constexpr int64_t kClusterPoints = 10800;
constexpr int64_t kBranchPoints = 2700;
constexpr int64_t kLeafPoints = 340;
constexpr int64_t kClusterNumbers = 1 << 23;

// Rows that the first basis of a cluster is made of, and that are added at a
// time.
constexpr int64_t kSampledRows = 256;

// 2-norm that a row may lose in the three levels, in units of a budget that
// leaves the sum of |errors| of C columns within the tolerance, about.
constexpr double kClusterShare = 0.2;
constexpr double kBranchShare = 0.3;
double FirstBudget(double tolerance, int64_t columns) {
  return tolerance / (0.4 * std::sqrt(static_cast<double>(columns)));
}
// A cluster with a leaf that cannot meet the tolerance is made again with a
// quarter of the budget, and at last keeps all directions.
constexpr int kAttempts = 3;
constexpr double kTighter = 0.25;

int64_t PartsOf(int64_t points, int64_t size) {
  return std::max<int64_t>(1, (points + size / 2) / size);
}

int64_t ClusterPoints(int64_t columns) {
  return std::clamp(kClusterNumbers / std::max<int64_t>(1, columns),
                    kBlockPoints, kClusterPoints);
}

// A cluster's points, and how they are grouped further. Ranges of the order.
struct ClusterPlan {
  struct Branch {
    Block range;
    std::vector<Block> leaves;
  };
  Block range;
  std::vector<Branch> branches;
};

std::vector<ClusterPlan> PlanClusters(const Positions& points, int64_t columns,
                                      std::span<int32_t> order) {
  const auto cut = [&](Block range, int64_t size) {
    return CutIntoClusters(points, PartsOf(range.count, size), kBlockPoints,
                           range, order);
  };
  std::vector<ClusterPlan> plans;
  for (const Block range :
       cut({0, std::ssize(order)}, ClusterPoints(columns))) {
    ClusterPlan plan{.range = range};
    for (const Block branch : cut(range, kBranchPoints)) {
      plan.branches.push_back({branch, cut(branch, kLeafPoints)});
    }
    plans.push_back(std::move(plan));
  }
  return plans;
}

Tiles<double> Product(const Tiles<double>& rows, const RowMatrix& matrix) {
  Tiles<double> product(rows.points(), matrix.cols());
  AddTileProducts(rows.tile(0), rows.tiles(), matrix.rows(), matrix.data(),
                  matrix.cols(), product.tile(0));
  return product;
}

// The leading columns of `count` rows from `first`, the first of a tile, on.
Tiles<double> Part(const Tiles<double>& rows, int64_t first, int64_t count,
                   int64_t columns) {
  Tiles<double> part(count, columns);
  for (int64_t t = 0; t < part.tiles(); ++t) {
    std::copy_n(rows.tile(first / kTilePoints + t), columns * kTilePoints,
                part.tile(t));
  }
  return part;
}

// Side by side.
Tiles<double> Joined(const std::vector<Tiles<double>>& parts, int64_t points) {
  int64_t columns = 0;
  for (const auto& part : parts) columns += part.columns();
  Tiles<double> joined(points, columns);
  for (int64_t t = 0; t < joined.tiles(); ++t) {
    double* to = joined.tile(t);
    for (const auto& part : parts) {
      to = std::copy_n(part.tile(t), part.columns() * kTilePoints, to);
    }
  }
  return joined;
}

void AddSquares(const Tiles<double>& rows, double sign,
                std::vector<double>& sums) {
  for (int64_t i = 0; i < rows.points(); ++i) {
    for (int64_t c = 0; c < rows.columns(); ++c) {
      sums[i] += sign * rows.at(i, c) * rows.at(i, c);
    }
  }
}

WeightTiles ToTiles(const RowMatrix& matrix) {
  WeightTiles tiles(matrix.rows(), matrix.cols());
  for (int64_t i = 0; i < matrix.rows(); ++i) {
    for (int64_t c = 0; c < matrix.cols(); ++c) {
      tiles.set(i, c, static_cast<float>(matrix(i, c)));
    }
  }
  return tiles;
}

RowMatrix AsFloat(const RowMatrix& matrix) {
  return matrix.cast<float>().cast<double>();
}

// What becomes of one cluster.
struct CompressedCluster {
  WeightTiles basis;
  std::vector<CompressedWeights::Branch> branches;
  double bound = 0;

  // Of what is kept, about.
  int64_t bytes() const {
    int64_t sum = basis.bytes();
    for (const CompressedWeights::Branch& branch : branches) {
      sum += branch.basis.bytes() + branch.leaf_rows.bytes() +
             static_cast<int64_t>(branch.numbers.size());
    }
    return sum;
  }
};

CompressedWeights::Branch MakeBranch(const ClusterPlan::Branch& plan,
                                     const RowMatrix& axes,
                                     const std::vector<LeafFit>& fits) {
  CompressedWeights::Branch branch{.basis = ToTiles(axes)};
  int64_t rows = 0, bytes = 0;
  for (size_t k = 0; k < fits.size(); ++k) {
    const Block& range = plan.leaves[k];
    branch.leaves.push_back(
        {.first_slot = range.first,
         .blocks = (range.count + kBlockPoints - 1) / kBlockPoints,
         .columns = fits[k].columns,
         .step = fits[k].step,
         .first_row = rows,
         .first_byte = bytes});
    rows += fits[k].rows.rows();
    bytes += std::ssize(fits[k].numbers);
  }
  RowMatrix all(rows, axes.rows());
  branch.numbers = ZeroedArray<std::byte>(bytes);
  for (size_t k = 0; k < fits.size(); ++k) {
    const CompressedWeights::Leaf& leaf = branch.leaves[k];
    all.middleRows(leaf.first_row, fits[k].rows.rows()) = fits[k].rows;
    std::copy(fits[k].numbers.begin(), fits[k].numbers.end(),
              branch.numbers.data() + leaf.first_byte);
  }
  branch.leaf_rows = ToTiles(all);
  return branch;
}

class ClusterCompressor {
 public:
  ClusterCompressor(const WeightSource& source, double tolerance,
                    const ClusterPlan& plan, std::span<const int32_t> order)
      : tolerance_(tolerance),
        plan_(plan),
        scale_(Eigen::Map<const Eigen::RowVectorXd>(source.scale.data(),
                                                    source.scale.size())) {
    ReadWeights(source, order);
  }

  CompressedCluster Compress();

 private:
  int64_t points() const { return plan_.range.count; }
  int64_t columns() const { return scale_.size(); }
  void ReadWeights(const WeightSource& source, std::span<const int32_t> order);
  // False if a leaf does not meet the tolerance.
  bool Try(double budget, bool exact, CompressedCluster& result);
  void FindBasis(double threshold);
  RowMatrix RowsAt(const std::vector<int64_t>& rows) const;
  std::vector<int64_t> MissedRows(const std::vector<double>& left,
                                  double threshold) const;
  bool CompressBranch(const ClusterPlan::Branch& plan, double budget,
                      bool exact, CompressedCluster& result) const;

  const double tolerance_;
  const ClusterPlan& plan_;
  const Eigen::RowVectorXd scale_;
  // Rows in units of the pose bounds: weight x R_c.
  Tiles<double> weights_;
  std::vector<double> squares_;  // Of each row's length.
  RowMatrix basis_;              // Orthonormal rows.
  Tiles<double> coefficients_;   // weights_ = coefficients_ basis_, about.
};

void ClusterCompressor::ReadWeights(const WeightSource& source,
                                    std::span<const int32_t> order) {
  WeightTiles rows(points(), columns());
  source.rows(order.subspan(plan_.range.first, points()), rows);
  weights_ = Tiles<double>(points(), columns());
  for (int64_t t = 0; t < rows.tiles(); ++t) {
    for (int64_t c = 0; c < columns(); ++c) {
      const float* from = rows.tile(t) + c * kTilePoints;
      double* to = weights_.tile(t) + c * kTilePoints;
      for (int64_t i = 0; i < kTilePoints; ++i) to[i] = from[i] * scale_[c];
    }
  }
  squares_.assign(points(), 0.0);
  AddSquares(weights_, 1, squares_);
}

CompressedCluster ClusterCompressor::Compress() {
  CompressedCluster result;
  double budget = FirstBudget(tolerance_, columns());
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    if (Try(budget, false, result)) return result;
    budget *= kTighter;
  }
  Try(budget, true, result);
  return result;
}

bool ClusterCompressor::Try(double budget, bool exact,
                            CompressedCluster& result) {
  result = {};
  if (exact) {
    basis_ = RowMatrix::Identity(columns(), columns());
    coefficients_ = Part(weights_, 0, points(), columns());
  } else {
    FindBasis(kClusterShare * budget);
  }
  // Stored for displacements as they are, not in units of R_c.
  const RowMatrix stored = basis_ * scale_.cwiseInverse().asDiagonal();
  result.basis = ToTiles(stored);
  basis_ = AsFloat(stored) * scale_.asDiagonal();
  bool good = true;
  for (const ClusterPlan::Branch& branch : plan_.branches) {
    good = CompressBranch(branch, budget, exact, result) && good;
    if (!good && !exact) return false;
  }
  return true;
}

void ClusterCompressor::FindBasis(double threshold) {
  basis_.resize(0, columns());
  std::vector<Tiles<double>> parts;
  std::vector<double> left = squares_;
  std::vector<int64_t> candidates;
  const int64_t sampled = std::min(points(), kSampledRows);
  for (int64_t k = 0; k < sampled; ++k) {
    candidates.push_back(k * points() / sampled);
  }
  while (!candidates.empty()) {
    const int64_t before = basis_.rows();
    // A little further than asked, so that rows in between are within it too.
    ExtendBasis(RowsAt(candidates), 0.7 * threshold, basis_);
    if (basis_.rows() == before) break;
    parts.push_back(Product(
        weights_, basis_.bottomRows(basis_.rows() - before).transpose()));
    AddSquares(parts.back(), -1, left);
    candidates = MissedRows(left, threshold);
  }
  coefficients_ = Joined(parts, points());
}

RowMatrix ClusterCompressor::RowsAt(const std::vector<int64_t>& rows) const {
  RowMatrix matrix(rows.size(), columns());
  for (size_t k = 0; k < rows.size(); ++k) {
    for (int64_t c = 0; c < columns(); ++c) {
      matrix(k, c) = weights_.at(rows[k], c);
    }
  }
  return matrix;
}

// The rows farthest from the basis by Pythagoras, worst first, but for what its
// rounding leaves.
std::vector<int64_t> ClusterCompressor::MissedRows(
    const std::vector<double>& left, double threshold) const {
  std::vector<int64_t> missed;
  for (int64_t i = 0; i < points(); ++i) {
    if (left[i] > threshold * threshold + 1e-15 * squares_[i]) {
      missed.push_back(i);
    }
  }
  std::sort(missed.begin(), missed.end(), [&](int64_t a, int64_t b) {
    return std::pair(-left[a], a) < std::pair(-left[b], b);
  });
  if (std::ssize(missed) > kSampledRows) missed.resize(kSampledRows);
  return missed;
}

bool ClusterCompressor::CompressBranch(const ClusterPlan::Branch& plan,
                                       double budget, bool exact,
                                       CompressedCluster& result) const {
  const int64_t first = plan.range.first - plan_.range.first;
  PrincipalRows principal;
  Tiles<double> rows =
      Part(coefficients_, first, plan.range.count, basis_.rows());
  int64_t rank = rows.columns();
  if (exact) {
    principal.axes = RowMatrix::Identity(rank, rank);
    principal.rows = std::move(rows);
  } else {
    principal = InPrincipalAxes(rows, 0.02 * budget);
    rank = RankWithin(principal.rows, kBranchShare * budget);
  }
  const RowMatrix axes = AsFloat(principal.axes.topRows(rank));
  const RowMatrix in_columns = axes * basis_;
  std::vector<LeafFit> fits;
  for (const Block leaf : plan.leaves) {
    const int64_t at = leaf.first - plan_.range.first;
    fits.push_back(FitLeaf(
        {.weights = Part(weights_, at, leaf.count, columns()),
         .coefficients = Part(principal.rows, at - first, leaf.count, rank),
         .branch_basis = in_columns,
         .tolerance = tolerance_,
         .first_budget = budget,
         .exact = exact}));
    if (fits.back().excess > 1 && !exact) return false;
    result.bound = std::max(result.bound, fits.back().bound);
  }
  result.branches.push_back(MakeBranch(plan, axes, fits));
  return true;
}

bool RunAll(int64_t count, const CompressControl& control,
            absl::FunctionRef<void(int64_t)> body) {
  if (control.pool != nullptr) {
    return control.pool->ParallelFor(count, control.cancellation, body);
  }
  for (int64_t i = 0; i < count; ++i) {
    if (control.cancellation != nullptr && control.cancellation->cancelled()) {
      return false;
    }
    body(i);
  }
  return true;
}

std::vector<int32_t> PointsWithWeights(const WeightSource& source) {
  std::vector<int32_t> points;
  auto without = source.without_weights.begin();
  for (int32_t i = 0; i < source.points->rows(); ++i) {
    if (without != source.without_weights.end() && *without == i) {
      ++without;
    } else {
      points.push_back(i);
    }
  }
  return points;
}

absl::Status NotSmaller(int64_t max_bytes) {
  return MakeError(absl::StatusCode::kResourceExhausted,
                   absl::StrCat("compressed weights would take more than ",
                                max_bytes, " bytes"),
                   {.reason = "NOT_SMALLER", .field = "weight_tolerance"});
}

}  // namespace

int64_t CompressionBytes(int64_t points, int64_t columns, int threads) {
  const int64_t cluster = ClusterPoints(columns);
  const int64_t at_work = std::min<int64_t>(threads, PartsOf(points, cluster));
  // A cluster is up to half as large again as it should be. Its rows as float,
  // as double, and as the coefficients of two levels.
  const int64_t rows = std::min(points, cluster + cluster / 2);
  constexpr int64_t kBytes = sizeof(float) + 3 * sizeof(double);
  return at_work * rows * columns * kBytes;
}

absl::StatusOr<CompressedWeights> CompressWeights(
    const WeightSource& source, double tolerance,
    const CompressControl& control) {
  const auto columns = static_cast<int64_t>(source.scale.size());
  std::vector<int32_t> order = PointsWithWeights(source);
  const std::vector<ClusterPlan> plans =
      PlanClusters(*source.points, columns, order);
  std::vector<CompressedCluster> clusters(plans.size());
  std::atomic<int64_t> bytes = 0;
  const auto too_large = [&] {
    return control.max_bytes > 0 && bytes > control.max_bytes;
  };
  const bool finished = RunAll(std::ssize(plans), control, [&](int64_t k) {
    if (too_large()) return;
    clusters[k] =
        ClusterCompressor(source, tolerance, plans[k], order).Compress();
    bytes += clusters[k].bytes();
    if (control.points_done != nullptr) {
      *control.points_done += plans[k].range.count;
    }
  });
  if (!finished) return absl::CancelledError("compression was cancelled");
  if (too_large()) return NotSmaller(control.max_bytes);
  CompressedWeights::Parts parts{.columns = columns, .tolerance = tolerance};
  parts.slots.assign(source.points->rows(), -1);
  for (size_t slot = 0; slot < order.size(); ++slot) {
    parts.slots[order[slot]] = static_cast<int32_t>(slot);
  }
  int64_t first_top = 0;
  for (CompressedCluster& cluster : clusters) {
    for (CompressedWeights::Branch& branch : cluster.branches) {
      branch.cluster = std::ssize(parts.clusters);
      parts.branches.push_back(std::move(branch));
    }
    const int64_t tiles = cluster.basis.tiles();
    parts.clusters.push_back({std::move(cluster.basis), first_top});
    first_top += tiles;
    parts.bound = std::max(parts.bound, cluster.bound);
  }
  return CompressedWeights(std::move(parts));
}

}  // namespace deform
