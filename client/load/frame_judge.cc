#include "client/load/frame_judge.h"

#include <algorithm>
#include <set>
#include <utility>

#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"
#include "core/weights/binding.h"

namespace deform {
namespace {

constexpr int64_t kRun = 64;  // Points that are compared together.

struct Run {
  int64_t first, count;
};

// All of `points`, or runs spread evenly, the first and last point among them.
std::vector<Run> RunsOf(int64_t points, int64_t columns) {
  const int64_t most = std::max(
      2 * kRun, FrameJudge::kMaxWeights / std::max<int64_t>(1, columns));
  if (points <= most) return {{0, points}};
  const int64_t count = most / kRun;
  std::vector<Run> runs;
  for (int64_t r = 0; r < count; ++r) {
    runs.push_back({r * (points - kRun) / (count - 1), kRun});
  }
  return runs;
}

}  // namespace

absl::StatusOr<FrameJudge> FrameJudge::FromModel(const ModelArrays& model,
                                                 const BindingSpec& spec,
                                                 double tolerance) {
  DEFORM_ASSIGN_OR_RETURN(Rig rig, RigOf(spec.rig));
  std::vector<int64_t> points;
  for (const Run& run :
       RunsOf(model.positions.rows(),
              RestVertices(rig).rows() + spec.rig.faces.rows())) {
    for (int64_t i = 0; i < run.count; ++i) points.push_back(run.first + i);
  }
  Positions places(points.size(), 3);
  for (size_t i = 0; i < points.size(); ++i) {
    places.row(i) = model.positions.row(points[i]);
  }
  DEFORM_ASSIGN_OR_RETURN(
      Mesh mesh, Mesh::Create(model.dimension, std::move(places), Faces(0, 3)));
  DEFORM_ASSIGN_OR_RETURN(
      const auto binding,
      Bind({.model = std::make_shared<const Mesh>(std::move(mesh)),
            .rig = rig,
            .scheme = spec.scheme,
            .options = spec.options},
           {}));
  DEFORM_ASSIGN_OR_RETURN(
      const WeightBlock block,
      RecomputeWeights(*binding, 0, binding->point_count()));
  FrameJudge judge(rig, binding->normal_count() > 0, tolerance);
  judge.points_ = std::move(points);
  judge.weights_.resize(binding->point_count(), binding->column_count());
  judge.weights_.leftCols(block.vertex.cols()) = block.vertex;
  judge.weights_.rightCols(block.normal.cols()) = block.normal;
  return judge;
}

absl::StatusOr<FrameJudge> FrameJudge::FromServer(Client& client,
                                                  const BindingInfo& binding,
                                                  const Rig& rig,
                                                  double tolerance) {
  FrameJudge judge(rig, binding.normal_count > 0, tolerance);
  std::set<int64_t> resting(binding.clamped.begin(), binding.clamped.end());
  for (const UnboundInfo& unbound : binding.unbound) {
    resting.insert(unbound.points.begin(), unbound.points.end());
  }
  const int64_t columns = judge.columns_.count();
  std::vector<double> rows;
  for (const Run& run : RunsOf(binding.point_count, columns)) {
    DEFORM_RETURN_IF_ERROR(client.GetWeights(
        binding.binding_id, WeightPrecision::kRecomputedFloat64, run.first,
        run.count, [&](const WeightRows& part) -> absl::Status {
          if (part.vertex.cols() + part.normal.cols() != columns) {
            return absl::InternalError("the weights do not fit the rig");
          }
          for (int64_t i = 0; i < part.vertex.rows(); ++i) {
            if (resting.contains(part.first_point + i)) continue;
            judge.points_.push_back(part.first_point + i);
            rows.insert(rows.end(), part.vertex.row(i).begin(),
                        part.vertex.row(i).end());
            rows.insert(rows.end(), part.normal.row(i).begin(),
                        part.normal.row(i).end());
          }
          return absl::OkStatus();
        }));
  }
  judge.weights_ =
      Eigen::Map<const Matrix>(rows.data(), judge.points(), columns);
  return judge;
}

FrameJudge::Verdict FrameJudge::Judge(const Frame& frame,
                                      const Pose& pose) const {
  const Box box = BoxOf(pose.vertices);
  // About the rig's middle, so that an offset costs no digits: vertex weights
  // sum to 1.
  const Vec3 middle = box.center();
  Columns columns(columns_.count(), 3);
  columns_.UpdateAll(pose, columns);
  columns.topRows(columns_.vertex_count()).rowwise() -= middle.transpose();
  const Positions places = weights_ * columns;
  const double unit = std::max(rest_diagonal_, box.diagonal());
  Verdict verdict;
  for (int64_t i = 0; i < points(); ++i) {
    Vec3 told = frame.origin - middle;
    for (int k = 0; k < frame.dimension; ++k) {
      told[k] += frame.positions[points_[i] * frame.dimension + k];
    }
    const double error = (told - places.row(i).transpose()).norm() / unit;
    if (error <= verdict.error) continue;
    verdict.error = error;
    verdict.vertex = points_[i];
    if (!(error <= tolerance_)) verdict.ok = false;
    if (std::isnan(error)) break;
  }
  return verdict;
}

}  // namespace deform
