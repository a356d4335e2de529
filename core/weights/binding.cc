#include "core/weights/binding.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/weights/blocks.h"

namespace deform {
namespace {

// Rows of some points of a binding.
class Recomputation {
 public:
  Recomputation(const BindingFacts& binding, const WeightEvaluator& evaluator,
                Block range)
      : binding_(binding), evaluator_(evaluator), range_(range) {
    block_.vertex.resize(range.count, binding.vertex_count());
    block_.normal.resize(range.count, binding.normal_count());
    block_.states.resize(range.count);
  }

  void Evaluate();
  void Extend();
  void ClearFixed();
  WeightBlock Take() && { return std::move(block_); }

 private:
  Vec3 Point(int64_t i) const { return binding_.model()->positions().row(i); }
  bool Contains(int64_t i) const {
    return i >= range_.first && i < range_.first + range_.count;
  }
  void Copy(const WeightBlock& from, Block at);

  const BindingFacts& binding_;
  const WeightEvaluator& evaluator_;
  const Block range_;
  WeightBlock block_;
};

void Recomputation::Evaluate() {
  const int64_t n = binding_.point_count();
  const int64_t step = BlockPoints(binding_.column_count());
  // Solvers start from a neighbour's solution: whole blocks give the same bits.
  const bool whole = binding_.scheme().rig_kind() == RigKind::kHandles;
  const int64_t end = range_.first + range_.count;
  for (int64_t index = range_.first / step; index * step < end; ++index) {
    Block at = BlockAt(index, step, n);
    if (!whole) {
      const int64_t first = std::max(at.first, range_.first);
      at = {first, std::min(at.first + at.count, end) - first};
    }
    WeightBlock block;
    evaluator_.Evaluate(
        binding_.model()->positions().middleRows(at.first, at.count), block);
    Copy(block, at);
  }
}

void Recomputation::Copy(const WeightBlock& from, Block at) {
  if (!from.iterations.empty()) {
    block_.iterations.resize(range_.count);
    block_.residuals.resize(range_.count);
  }
  for (int64_t i = 0; i < at.count; ++i) {
    if (!Contains(at.first + i)) continue;
    const int64_t to = at.first + i - range_.first;
    block_.vertex.row(to) = from.vertex.row(i);
    if (block_.normal.cols() > 0) block_.normal.row(to) = from.normal.row(i);
    block_.states[to] = from.states[i];
    if (from.iterations.empty()) continue;
    block_.iterations[to] = from.iterations[i];
    block_.residuals[to] = from.residuals[i];
  }
}

void Recomputation::Extend() {
  for (const ExitPart& part : binding_.exit_parts()) {
    auto point =
        std::lower_bound(part.points.begin(), part.points.end(), range_.first);
    for (; point != part.points.end() && Contains(*point); ++point) {
      const int64_t row = *point - range_.first;
      for (const WeightShare& share :
           evaluator_.Extend(Point(*point), part.exit_face)) {
        const int64_t normal = share.column - block_.vertex.cols();
        (normal < 0 ? block_.vertex(row, share.column)
                    : block_.normal(row, normal)) += share.weight;
      }
    }
  }
}

void Recomputation::ClearFixed() {
  const std::vector<int64_t>& fixed = binding_.fixed_points();
  auto point = std::lower_bound(fixed.begin(), fixed.end(), range_.first);
  for (; point != fixed.end() && Contains(*point); ++point) {
    block_.vertex.row(*point - range_.first).setZero();
    block_.normal.row(*point - range_.first).setZero();
  }
}

}  // namespace

BindingFacts::BindingFacts(Parts parts) {
  auto state = std::make_shared<State>(State{std::move(parts), {}});
  std::vector<int64_t>& fixed = state->fixed_points;
  for (const UnboundPoints& group : state->unbound) {
    fixed.insert(fixed.end(), group.points.begin(), group.points.end());
  }
  const auto& clamped = state->request.clamped;
  fixed.insert(fixed.end(), clamped.begin(), clamped.end());
  std::sort(fixed.begin(), fixed.end());
  state_ = std::move(state);
}

int64_t BindingFacts::bytes() const {
  int64_t numbers = 3 * vertex_count();  // 8 bytes each.
  int64_t indices = 0;                   // 4 bytes each.
  if (const Cage* cage = std::get_if<Cage>(&rig())) {
    indices += cage->faces().size();
  }
  const ExitRegions& exits = request().exits;
  indices += static_cast<int64_t>(exits.faces.size());
  indices += static_cast<int64_t>(exits.face_of_point.size());
  numbers += static_cast<int64_t>(options().handle_weights.size());
  for (const ExitPart& part : exit_parts()) {
    numbers += static_cast<int64_t>(part.points.size());
    indices += static_cast<int64_t>(part.crossed_faces.size());
  }
  // In their group, and among the fixed points.
  numbers += 2 * static_cast<int64_t>(fixed_points().size());
  return numbers * int64_t{sizeof(double)} + indices * int64_t{sizeof(int32_t)};
}

void Binding::CopyWeights(int64_t first, int64_t count, float* out) const {
  if (compressed_) {
    compressed_->CopyRows(first, count, out);
    return;
  }
  for (int64_t i = first; i < first + count; ++i) {
    for (int64_t c = 0; c < column_count(); ++c) *out++ = weights_->at(i, c);
  }
}

std::shared_ptr<const Binding> Binding::WithFacts(BindingFacts facts) const {
  return compressed_ ? std::make_shared<const Binding>(std::move(facts),
                                                       compressed_, solutions_)
                     : std::make_shared<const Binding>(std::move(facts),
                                                       weights_, solutions_);
}

absl::StatusOr<WeightBlock> RecomputeWeights(const BindingFacts& binding,
                                             int64_t first, int64_t count) {
  const int64_t n = binding.point_count();
  if (first < 0 || first > n || count < 0 || count > n - first) {
    return InvalidInput(
        "RANGE_OUT_OF_BOUNDS", "first_point",
        absl::StrCat("there are no ", count, " points from point ", first,
                     " on; the ", "model has ", n));
  }
  DEFORM_ASSIGN_OR_RETURN(
      const auto evaluator,
      binding.scheme().Prepare(binding.rig(), binding.options()));
  Recomputation recomputation(binding, *evaluator, {first, count});
  recomputation.Evaluate();
  recomputation.Extend();
  recomputation.ClearFixed();
  return std::move(recomputation).Take();
}

}  // namespace deform
