#include "core/weights/bind_quality.h"

#include <algorithm>

namespace deform {

void QualityTally::AddRow(const BindQuality& row) {
  QualityTally tally;
  tally.rows_ = 1;
  tally.quality_ = row;
  Merge(tally);
}

void QualityTally::AddSearch(int iterations, double residual) {
  QualityTally search;
  search.searches_ = 1;
  search.residual_sum_ = residual;
  search.quality_.iterations_total = iterations;
  search.quality_.iterations_max = iterations;
  search.quality_.residual_max = residual;
  Merge(search);
}

void QualityTally::Merge(const QualityTally& other) {
  BindQuality& mine = quality_;
  const BindQuality& more = other.quality_;
  const auto keep_larger = [&](auto BindQuality::*figure) {
    mine.*figure = std::max(mine.*figure, more.*figure);
  };
  keep_larger(&BindQuality::reproduction_error);
  keep_larger(&BindQuality::partition_error);
  keep_larger(&BindQuality::weight_sum_max);
  keep_larger(&BindQuality::iterations_max);
  keep_larger(&BindQuality::residual_max);
  if (rows_ == 0) {
    mine.weight_min = more.weight_min;
    mine.weight_max = more.weight_max;
  } else if (other.rows_ > 0) {
    mine.weight_min = std::min(mine.weight_min, more.weight_min);
    mine.weight_max = std::max(mine.weight_max, more.weight_max);
  }
  mine.iterations_total += more.iterations_total;
  residual_sum_ += other.residual_sum_;
  rows_ += other.rows_;
  searches_ += other.searches_;
}

BindQuality QualityTally::quality() const {
  BindQuality quality = quality_;
  if (searches_ > 0) {
    const auto searches = static_cast<double>(searches_);
    quality.iterations_mean =
        static_cast<double>(quality.iterations_total) / searches;
    quality.residual_mean = residual_sum_ / searches;
  }
  return quality;
}

}  // namespace deform
