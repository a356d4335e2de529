#include "core/weights/row_basis.h"

#include <algorithm>
#include <vector>

#include <Eigen/Eigenvalues>

#include "core/kernels/multiply_tiles.h"

namespace deform {
namespace {

// What is left of rows outside the span of `basis`; twice, since the first time
// leaves a rounding of what was taken away.
RowMatrix Rejected(RowMatrix rows, const RowMatrix& basis) {
  for (int pass = 0; pass < 2; ++pass) {
    rows -= (rows * basis.transpose()).eval() * basis;
  }
  return rows;
}

}  // namespace

void ExtendBasis(const RowMatrix& candidates, double threshold,
                 RowMatrix& basis) {
  const RowMatrix left = Rejected(candidates, basis);
  Eigen::VectorXd distances = left.rowwise().squaredNorm();
  // Distances are kept by Pythagoras, which holds this far down.
  const Eigen::VectorXd reliable = 1e-13 * distances;
  RowMatrix grown(basis.rows() + candidates.rows(), candidates.cols());
  grown.topRows(basis.rows()) = basis;
  int64_t rank = basis.rows();
  Eigen::Index farthest = 0;
  while (rank < grown.rows() &&
         distances.maxCoeff(&farthest) > threshold * threshold) {
    const RowMatrix direction =
        Rejected(left.row(farthest), grown.topRows(rank));
    const double length = direction.norm();
    distances[farthest] = 0;
    if (!(length > 0)) continue;
    grown.row(rank) = direction / length;
    const Eigen::VectorXd along = left * grown.row(rank).transpose();
    distances -= along.cwiseAbs2();
    distances = (distances.array() > reliable.array()).select(distances, 0.0);
    ++rank;
  }
  basis = grown.topRows(rank);
}

PrincipalRows InPrincipalAxes(const Tiles<double>& rows, double negligible) {
  const int64_t columns = rows.columns();
  PrincipalRows principal;
  principal.rows = Tiles<double>(rows.points(), 0);
  if (columns == 0) return principal;
  RowMatrix gram = RowMatrix::Zero(columns, columns);
  AddTileGram(rows.tile(0), rows.tiles(), columns, gram.data());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(gram);
  // Rising; their sum over some axes is the sum of squares that all rows
  // together have along them.
  int64_t left_out = 0;
  double lost = 0;
  while (left_out < columns) {
    lost += std::max(0.0, solver.eigenvalues()[left_out]);
    if (!(lost <= negligible * negligible)) break;
    ++left_out;
  }
  principal.axes = solver.eigenvectors()
                       .rightCols(columns - left_out)
                       .rowwise()
                       .reverse()
                       .transpose();
  const RowMatrix turned = principal.axes.transpose();
  principal.rows = Tiles<double>(rows.points(), turned.cols());
  AddTileProducts(rows.tile(0), rows.tiles(), columns, turned.data(),
                  turned.cols(), principal.rows.tile(0));
  return principal;
}

int64_t RankWithin(const Tiles<double>& rows, double threshold) {
  std::vector<double> tails(rows.points(), 0.0);
  int64_t rank = rows.columns();
  for (; rank > 0; --rank) {
    double longest = 0;
    for (int64_t i = 0; i < rows.points(); ++i) {
      const double along = rows.at(i, rank - 1);
      tails[i] += along * along;
      longest = std::max(longest, tails[i]);
    }
    if (!(longest <= threshold * threshold)) break;
  }
  return rank;
}

}  // namespace deform
