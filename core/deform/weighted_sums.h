// Sum over c of w_ic x_c for all points i of a model: what a session keeps of
// its pose, whatever the form of the weights.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/allowance.h"
#include "core/base/thread_pool.h"
#include "core/weights/binding.h"

namespace deform {

// The sums of one session. Starts at 0. Not thread-safe.
class WeightedSums {
 public:
  // What copying columns that move again and again takes comes from `copies`,
  // borrowed.
  static std::unique_ptr<WeightedSums> Create(const Binding& binding,
                                              Allowance& copies);
  virtual ~WeightedSums() = default;

  // Whether a step that changes these columns (sorted) should add them; else
  // making the sums anew costs less.
  virtual bool PrefersAdding(std::span<const int32_t> columns) const = 0;

  // Of points [first, first + count): 3 numbers each.
  virtual void Copy(int64_t first, int64_t count, double* out) const = 0;

  // What the leaves of compressed weights make the sums from: 3 floats for each
  // of CompressedWeights::coefficient_rows(). None of dense ones.
  virtual std::vector<float> LeafCoefficients(ThreadPool* /*pool*/) const {
    return {};
  }
};

// A change of the sums of one session.
struct SumsChange {
  WeightedSums* sums = nullptr;
  // Replaces the sums by weights x values; else adds to them.
  bool full = false;
  std::span<const int32_t> columns;  // Those that moved, sorted.
  std::span<const double> values;    // 3 for each of them; of all, if full.
};

// Makes all changes, of different sums of this binding, in one walk over its
// weights. `pool` may be null.
void ApplyChanges(const Binding& binding, std::span<const SumsChange> changes,
                  ThreadPool* pool);

}  // namespace deform
