// Bind(): evaluate all points, send the outside ones through exit faces, extend
// these, report.

#include "core/weights/binding.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"
#include "core/kernels/measure_weights.h"
#include "core/weights/blocks.h"
#include "core/weights/cage_faces.h"
#include "core/weights/compress_binding.h"
#include "core/weights/unbindable.h"

namespace deform {
namespace {

bool IsBound(PointState state) {
  return state == PointState::kInside || state == PointState::kBoundary ||
         state == PointState::kBoundOutside;
}

int64_t Columns(const Rig& rig, bool uses_normals) {
  const Cage* cage = std::get_if<Cage>(&rig);
  return RestVertices(rig).rows() +
         (cage != nullptr && uses_normals ? cage->face_count() : 0);
}

// What the rows of some points showed.
struct Figures {
  QualityTally tally;
  std::vector<int64_t> too_large;

  void Merge(const Figures& other) {
    tally.Merge(other.tally);
    too_large.insert(too_large.end(), other.too_large.begin(),
                     other.too_large.end());
  }
};

// Computes the weights of one request into Parts.
class Binder {
 public:
  Binder(const BindRequest& request, const BindControl& control,
         const WeightEvaluator& evaluator, BindingFacts::Parts& parts,
         WeightTiles& weights);

  // The steps, in order.
  absl::Status EvaluateAll();
  absl::Status CheckOverlap() const;
  void AssignExits();
  absl::Status ExtendOutside();
  void Finish();
  std::shared_ptr<const Solutions> solutions() const { return solutions_; }

 private:
  const Positions& points() const { return request_.model->positions(); }
  // False if cancelled.
  bool ForEach(int64_t count, absl::FunctionRef<void(int64_t)> body) const;
  // Where the weights of a block are written: among those of all points, or,
  // if these are not kept, for the block alone.
  struct Rows {
    WeightTiles* kept = nullptr;
    WeightTiles own;
    int64_t first = 0;  // Point of row 0.
    WeightTiles& tiles() { return kept != nullptr ? *kept : own; }
  };
  Rows RowsOf(Block at);
  TileBlock Evaluate(Block at, Rows& rows) const;
  // Measures the points of a block that `wanted` names.
  void Measure(Block at, Rows& rows,
               absl::FunctionRef<bool(int64_t point)> wanted,
               Figures& figures) const;
  void EvaluateBlock(Block at);
  void ExtendBlock(Block at);
  void Report(const Figures& figures, int64_t points_done)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void ListUnbound();
  void Warn();
  bool IsClamped(int64_t i) const { return !clamped_.empty() && clamped_[i]; }
  void DropClamped(std::vector<int64_t>& points) const {
    std::erase_if(points, [&](int64_t i) { return IsClamped(i); });
  }

  const BindRequest& request_;
  const BindControl& control_;
  const WeightEvaluator& evaluator_;
  BindingFacts::Parts& parts_;
  WeightTiles& weights_;

  const int64_t block_points_;
  const Vec3 center_;  // Of the rig's bounding box.
  const double diagonal_;
  Positions rest_;  // C x 3: rig vertices relative to the centre, rest normals.
  std::vector<PointState> states_;   // N
  std::vector<int32_t> exit_faces_;  // N, -1 for none.
  std::vector<UnboundPoints> unassigned_;
  std::vector<char> clamped_;             // N, or empty if there are none.
  const Solutions* known_ = nullptr;      // Of as many points.
  std::shared_ptr<Solutions> solutions_;  // For iterative schemes.

  Mutex mutex_;
  Figures figures_ ABSL_GUARDED_BY(mutex_);
};

Binder::Binder(const BindRequest& request, const BindControl& control,
               const WeightEvaluator& evaluator, BindingFacts::Parts& parts,
               WeightTiles& weights)
    : request_(request),
      control_(control),
      evaluator_(evaluator),
      parts_(parts),
      weights_(weights),
      block_points_(BlockPoints(parts.columns)),
      center_(BoxOf(RestVertices(request.rig)).center()),
      diagonal_(DiagonalOf(request.rig)),
      rest_(parts.columns, 3),
      states_(request.model->size()),
      exit_faces_(request.model->size(), -1),
      clamped_(request.clamped.empty() ? 0 : request.model->size()) {
  for (const int64_t i : request.clamped) clamped_[i] = 1;
  if (parts.scheme->rig_kind() == RigKind::kHandles) {
    const int64_t points = request.model->size();
    solutions_ = std::make_shared<Solutions>(Solutions::Zero(points, 3));
    if (control.known != nullptr && control.known->rows() == points) {
      known_ = control.known;
    }
  }
  const Positions& vertices = RestVertices(request.rig);
  rest_.topRows(vertices.rows()) = vertices.rowwise() - center_.transpose();
  if (rest_.rows() == vertices.rows()) return;
  const CageFaces faces(std::get<Cage>(request.rig));
  for (int64_t f = 0; f < faces.size(); ++f) {
    rest_.row(vertices.rows() + f) = faces[f].normal;
  }
}

bool Binder::ForEach(int64_t count,
                     absl::FunctionRef<void(int64_t)> body) const {
  return ParallelFor(control_.pool, count, control_.cancellation, body);
}

Binder::Rows Binder::RowsOf(Block at) {
  if (request_.weight_tolerance == 0) return {.kept = &weights_};
  return {.own = WeightTiles(at.count, rest_.rows()), .first = at.first};
}

TileBlock Binder::Evaluate(Block at, Rows& rows) const {
  TileBlock block{.tiles =
                      rows.tiles().tile((at.first - rows.first) / kTilePoints)};
  if (known_ != nullptr) block.known = known_->middleRows(at.first, at.count);
  evaluator_.EvaluateTiles(points().middleRows(at.first, at.count), block);
  return block;
}

void Binder::Measure(Block at, Rows& rows,
                     absl::FunctionRef<bool(int64_t)> wanted,
                     Figures& figures) const {
  const int64_t vertices = RestVertices(request_.rig).rows();
  TileMeasures measures;
  int64_t measured = -1;  // Tile.
  for (int64_t i = at.first; i < at.first + at.count; ++i) {
    if (!wanted(i)) continue;
    const int64_t row = i - rows.first;
    const int64_t tile = row / kTilePoints, lane = row % kTilePoints;
    if (tile != measured) {
      MeasureTile(rows.tiles().tile(tile), rest_.rows(), vertices, rest_.data(),
                  measures);
      measured = tile;
    }
    if (!std::isfinite(measures.vertex_sum[lane] + measures.normal_sum[lane])) {
      figures.too_large.push_back(i);
      rows.tiles().Clear(row);
      continue;
    }
    const Vec3 x(measures.position[0][lane], measures.position[1][lane],
                 measures.position[2][lane]);
    // Positions count from the middle of the rig: how coarse doubles are far
    // from the origin is not the weights' doing.
    const Vec3 eta = points().row(i).transpose() - center_;
    figures.tally.AddRow(
        {.reproduction_error = ((x - eta) / diagonal_).norm(),
         .partition_error = std::abs(measures.vertex_total[lane] - 1),
         .weight_min = measures.vertex_min[lane],
         .weight_max = measures.vertex_max[lane],
         .weight_sum_max = measures.vertex_sum[lane]});
  }
}

void Binder::EvaluateBlock(Block at) {
  Rows rows = RowsOf(at);
  const TileBlock block = Evaluate(at, rows);
  std::copy(block.states.begin(), block.states.end(),
            states_.begin() + at.first);
  if (block.solutions.rows() > 0) {
    solutions_->middleRows(at.first, at.count) = block.solutions;
  }
  for (int64_t i = at.first; i < at.first + at.count; ++i) {
    if (IsClamped(i)) rows.tiles().Clear(i - rows.first);
  }
  Figures figures;
  const auto bound = [&](int64_t i) {
    return IsBound(states_[i]) && !IsClamped(i);
  };
  Measure(at, rows, bound, figures);
  for (int64_t i = 0; i < std::ssize(block.iterations); ++i) {
    if (!bound(at.first + i)) continue;
    figures.tally.AddSearch(block.iterations[i], block.residuals[i]);
  }
  // Outside points wait for their exit face.
  const int64_t waiting = std::count(block.states.begin(), block.states.end(),
                                     PointState::kOutside);
  Report(figures, at.count - waiting);
}

void Binder::Report(const Figures& figures, int64_t points_done) {
  {
    MutexLock lock(mutex_);
    figures_.Merge(figures);
  }
  if (control_.points_done != nullptr) *control_.points_done += points_done;
}

absl::Status Binder::EvaluateAll() {
  const int64_t n = points().rows();
  const int64_t blocks = (n + block_points_ - 1) / block_points_;
  const bool finished = ForEach(blocks, [&](int64_t index) {
    EvaluateBlock(BlockAt(index, block_points_, n));
  });
  if (!finished) return absl::CancelledError("binding was cancelled");
  return absl::OkStatus();
}

absl::Status Binder::CheckOverlap() const {
  const auto at =
      std::find(states_.begin(), states_.end(), PointState::kOverlap);
  if (at == states_.end()) return absl::OkStatus();
  return InvalidInput(
      "CAGE_OVERLAPPING", "rig.cage.corners",
      absl::StrCat("the cage winds neither 0 nor 1 times around point ",
                   at - states_.begin(),
                   ": parts of it overlap or are inside out"));
}

void Binder::AssignExits() {
  const Cage* cage = std::get_if<Cage>(&request_.rig);
  if (cage == nullptr) return;
  ExitAssignment exits =
      AssignExitFaces(*request_.model, *cage, states_, request_.exits);
  // Clamped points hold their part together, but need no exit themselves.
  for (ExitPart& part : exits.parts) {
    DropClamped(part.points);
    for (int64_t i : part.points) exit_faces_[i] = part.exit_face;
    if (!part.points.empty()) parts_.exit_parts.push_back(std::move(part));
  }
  for (UnboundPoints& group : exits.unbound) {
    DropClamped(group.points);
    if (!group.points.empty()) unassigned_.push_back(std::move(group));
  }
}

void Binder::ExtendBlock(Block at) {
  Rows rows = RowsOf(at);
  if (rows.kept == nullptr) Evaluate(at, rows);
  int64_t done = 0;
  for (int64_t i = at.first; i < at.first + at.count; ++i) {
    if (states_[i] != PointState::kOutside) continue;
    ++done;
    const int64_t row = i - rows.first;
    if (exit_faces_[i] < 0) {
      rows.tiles().Clear(row);
      continue;
    }
    for (const WeightShare& share :
         evaluator_.Extend(points().row(i), exit_faces_[i])) {
      const double weight = rows.tiles().at(row, share.column);
      rows.tiles().set(row, share.column, RoundedWeight(weight + share.weight));
    }
  }
  Figures figures;
  Measure(
      at, rows, [&](int64_t i) { return exit_faces_[i] >= 0; }, figures);
  Report(figures, done);
}

absl::Status Binder::ExtendOutside() {
  ListUnbound();
  if (request_.unbindable == Unbindable::kFail) {
    DEFORM_RETURN_IF_ERROR(UnbindableError(parts_.unbound));
  }
  // Only blocks that have something to do.
  const int64_t n = points().rows();
  std::vector<int64_t> blocks;
  for (int64_t i = 0; i < n; ++i) {
    if (states_[i] != PointState::kOutside) continue;
    blocks.push_back(i / block_points_);
    i = BlockAt(blocks.back() + 1, block_points_, n).first - 1;
  }
  const bool finished = ForEach(blocks.size(), [&](int64_t k) {
    ExtendBlock(BlockAt(blocks[k], block_points_, n));
  });
  if (!finished) return absl::CancelledError("binding was cancelled");
  ListUnbound();
  if (request_.unbindable == Unbindable::kFail) {
    return UnbindableError(parts_.unbound);
  }
  return absl::OkStatus();
}

void Binder::ListUnbound() {
  parts_.unbound = unassigned_;
  const auto add = [&](absl::string_view reason, std::vector<int64_t> points) {
    DropClamped(points);
    if (points.empty()) return;
    parts_.unbound.push_back({std::string(reason),
                              UnboundAdvice(std::string(reason)),
                              std::move(points)});
  };
  for (const PointState state :
       {PointState::kOutsideHull, PointState::kNotConverged}) {
    std::vector<int64_t> found;
    for (size_t i = 0; i < states_.size(); ++i) {
      if (states_[i] == state) found.push_back(static_cast<int64_t>(i));
    }
    add(UnboundReason(state), std::move(found));
  }
  MutexLock lock(mutex_);
  std::sort(figures_.too_large.begin(), figures_.too_large.end());
  add(kWeightTooLarge, figures_.too_large);
}

// Handles at the same place; nearly always a mistake.
std::vector<std::string> CoincidenceWarnings(const Positions& handles) {
  std::vector<int64_t> order(handles.rows());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](int64_t i) {
    return std::tuple(handles(i, 0), handles(i, 1), handles(i, 2), i);
  };
  std::sort(order.begin(), order.end(),
            [&](int64_t a, int64_t b) { return key(a) < key(b); });
  std::vector<std::string> warnings;
  for (size_t i = 1; i < order.size(); ++i) {
    if (handles.row(order[i - 1]) != handles.row(order[i])) continue;
    warnings.push_back(absl::StrCat("handles ", order[i - 1], " and ", order[i],
                                    " coincide and share their weight"));
  }
  return warnings;
}

void Binder::Warn() {
  std::vector<std::string>& warnings = parts_.warnings;
  if (const Handles* handles = std::get_if<Handles>(&request_.rig)) {
    warnings = CoincidenceWarnings(handles->positions());
    if (handles->fixed_count() > 0) {
      warnings.insert(warnings.begin(),
                      absl::StrCat(handles->fixed_count(), " handles, from ",
                                   handles->free_count(),
                                   " on, are fixed: no pose moves "
                                   "them"));
    }
    if (request_.options.lambda != 0) {
      warnings.push_back("lambda is inert: it cancels out of the weights");
    }
  }
  for (const ExitPart& part : parts_.exit_parts) {
    if (part.crossed_faces.empty()) continue;
    warnings.push_back(
        absl::StrCat("the ", part.points.size(), " points around point ",
                     part.points.front(), " leave through face ",
                     part.exit_face, " and cross ", part.crossed_faces.size(),
                     " more, such as face ", part.crossed_faces.front(),
                     ": the map is smooth there only while these move alike"));
  }
  int64_t outside = 0;
  for (size_t i = 0; i < states_.size(); ++i) {
    outside += states_[i] == PointState::kBoundOutside && !IsClamped(i);
  }
  if (outside > 0) {
    warnings.push_back(absl::StrCat(outside,
                                    " points lie outside the cage; this scheme "
                                    "extends to them without an exit face"));
  }
  constexpr size_t kMaxWarnings = 100;
  if (warnings.size() > kMaxWarnings) {
    const size_t more = warnings.size() - kMaxWarnings;
    warnings.resize(kMaxWarnings);
    warnings.push_back(absl::StrCat("and ", more, " more of the same kinds"));
  }
}

void Binder::Finish() {
  Warn();
  MutexLock lock(mutex_);
  parts_.quality = figures_.tally.quality();
}

absl::Status CheckClamped(const BindRequest& request) {
  const std::vector<int64_t>& clamped = request.clamped;
  const int64_t points = request.model->size();
  if (clamped.empty() || (clamped.front() >= 0 && clamped.back() < points)) {
    return absl::OkStatus();
  }
  return InvalidInput(
      "INDEX_OUT_OF_RANGE", "clamped_points",
      absl::StrCat("clamped_points names point ",
                   clamped.front() < 0 ? clamped.front() : clamped.back(),
                   "; the model has ", points, " points"));
}

absl::Status CheckFits(const BindRequest& request) {
  DEFORM_RETURN_IF_ERROR(CheckWeightTolerance(request.weight_tolerance));
  DEFORM_RETURN_IF_ERROR(CheckClamped(request));
  DEFORM_RETURN_IF_ERROR(
      CheckSameDimension(*request.model, DimensionOf(request.rig)));
  if (const Cage* cage = std::get_if<Cage>(&request.rig)) {
    return CheckExitRegions(request.exits, *cage, request.model->size());
  }
  if (request.exits.kind != ExitRegions::Kind::kNone) {
    return InvalidInput("WRONG_RIG", "exits",
                        "exit faces belong to a cage; handles have none");
  }
  return absl::OkStatus();
}

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
      .count();
}

}  // namespace

absl::StatusOr<std::shared_ptr<const Binding>> Bind(
    const BindRequest& request, const BindControl& control) {
  const auto start = std::chrono::steady_clock::now();
  DEFORM_ASSIGN_OR_RETURN(const CoordinateScheme* scheme,
                          FindScheme(request.scheme));
  DEFORM_ASSIGN_OR_RETURN(const auto evaluator,
                          scheme->Prepare(request.rig, request.options));
  DEFORM_RETURN_IF_ERROR(CheckFits(request));
  const int64_t columns = Columns(request.rig, scheme->uses_normals());
  BindingFacts::Parts parts{
      .request = request, .scheme = scheme, .columns = columns};
  const bool dense = request.weight_tolerance == 0;
  auto weights =
      std::make_shared<WeightTiles>(dense ? request.model->size() : 0, columns);
  Binder binder(request, control, *evaluator, parts, *weights);
  DEFORM_RETURN_IF_ERROR(binder.EvaluateAll());
  DEFORM_RETURN_IF_ERROR(binder.CheckOverlap());
  binder.AssignExits();
  DEFORM_RETURN_IF_ERROR(binder.ExtendOutside());
  binder.Finish();
  parts.compute_seconds = SecondsSince(start);
  BindingFacts facts(std::move(parts));
  if (!dense) {
    BindControl rest = control;
    rest.points_done = nullptr;  // They have been counted.
    return CompressBinding(facts, nullptr, request.weight_tolerance, rest,
                           binder.solutions());
  }
  return std::make_shared<const Binding>(std::move(facts), std::move(weights),
                                         binder.solutions());
}

}  // namespace deform
