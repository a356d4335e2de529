#include "client/verify/run_case.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "client/verify/pose_columns.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

// Trouble with the connection or with the server is not an answer to a case.
bool IsAnAnswer(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kOutOfRange:
      return DetailOf(status).reason != "BAD_ANSWER" &&
             DetailOf(status).reason != "BAD_FRAME";
    default:
      return false;
  }
}

// One run: those queries of a case that are registered as one model.
class Run {
 public:
  Run(Client& client, const GoldenCase& golden, std::vector<size_t> queries,
      CreatedThings& created, CaseResult& result)
      : client_(client),
        golden_(golden),
        queries_(std::move(queries)),
        created_(created),
        result_(result) {}

  absl::Status Do() {
    const absl::StatusOr<BindingInfo> binding = Bind();
    if (!binding.ok()) {
      if (!IsAnAnswer(binding.status())) return binding.status();
      const std::string name =
          GoldenErrorName(DetailOf(binding.status()).reason);
      for (const size_t query : queries_) result_.queries[query].error = name;
      return absl::OkStatus();
    }
    DEFORM_RETURN_IF_ERROR(MarkUnbound(*binding));
    DEFORM_RETURN_IF_ERROR(FetchWeights(*binding));
    DEFORM_RETURN_IF_ERROR(DeformInDouble());
    return Stream(*binding);
  }

 private:
  absl::StatusOr<BindingInfo> Bind() {
    ModelArrays model;
    model.dimension = golden_.dimension;
    model.positions.resize(queries_.size(), 3);
    BindingSpec spec;
    for (size_t i = 0; i < queries_.size(); ++i) {
      const GoldenQuery& query = golden_.queries[queries_[i]];
      model.positions.row(i) = query.point;
      spec.exits.face_of_point.push_back(query.exit_face.value_or(-1));
      if (query.exit_face) spec.exits.kind = ExitRegions::Kind::kPerPoint;
    }
    DEFORM_ASSIGN_OR_RETURN(const ModelInfo info,
                            client_.RegisterModel(model, golden_.id));
    created_.Add(info);
    spec.model_id = info.model_id;
    spec.scheme = golden_.scheme;
    spec.rig = golden_.rig;
    spec.options = golden_.options;
    spec.unbindable = Unbindable::kReport;
    spec.weight_tolerance = 0;  // What is expected is finer.
    DEFORM_ASSIGN_OR_RETURN(const BindingInfo binding,
                            client_.CreateBinding(spec));
    created_.Add(binding);
    return binding;
  }

  QueryResult* ResultOf(int64_t point) {
    if (point < 0 || point >= static_cast<int64_t>(queries_.size())) {
      return nullptr;
    }
    return &result_.queries[queries_[point]];
  }

  absl::Status MarkUnbound(const BindingInfo& binding) {
    for (const UnboundInfo& unbound : binding.unbound) {
      for (const int64_t point : unbound.points) {
        QueryResult* const result = ResultOf(point);
        if (result == nullptr) return Nonsense("an unbound point");
        result->error = GoldenErrorName(unbound.reason);
      }
    }
    return absl::OkStatus();
  }

  absl::Status FetchWeights(const BindingInfo& binding) {
    return client_.GetWeights(
        binding.binding_id, WeightPrecision::kRecomputedFloat64, 0, 0,
        [&](const WeightRows& rows) -> absl::Status {
          for (int64_t i = 0; i < rows.vertex.rows(); ++i) {
            QueryResult* const result = ResultOf(rows.first_point + i);
            if (result == nullptr) return Nonsense("weights of a point");
            result->vertex_weights.assign(rows.vertex.row(i).begin(),
                                          rows.vertex.row(i).end());
            result->normal_weights.assign(rows.normal.row(i).begin(),
                                          rows.normal.row(i).end());
          }
          return absl::OkStatus();
        });
  }

  absl::Status DeformInDouble() {
    DEFORM_ASSIGN_OR_RETURN(const CaseColumns columns,
                            CaseColumns::Create(golden_));
    for (const size_t query : queries_) {
      QueryResult& result = result_.queries[query];
      std::vector<double> weights = result.vertex_weights;
      weights.insert(weights.end(), result.normal_weights.begin(),
                     result.normal_weights.end());
      // Another number of weights is for the judge to tell.
      if (static_cast<int64_t>(weights.size()) != columns.count()) continue;
      const Vec3& point = golden_.queries[query].point;
      result.reproduction_error = columns.ReproductionError(point, weights);
      for (size_t d = 0; d < golden_.deformations.size(); ++d) {
        result.deformed.push_back(columns.Deform(point, weights, d));
      }
    }
    result_.stretch.clear();
    for (size_t d = 0; d < golden_.deformations.size(); ++d) {
      result_.stretch.push_back(columns.stretch(d));
    }
    return absl::OkStatus();
  }

  absl::Status Stream(const BindingInfo& binding) {
    if (golden_.deformations.empty()) return absl::OkStatus();
    DEFORM_ASSIGN_OR_RETURN(const SessionInfo session,
                            client_.CreateSession(binding.binding_id));
    const absl::Status streamed = StreamIn(session);
    const absl::Status deleted = client_.DeleteSession(session.session_id);
    return streamed.ok() ? deleted : streamed;
  }

  absl::Status StreamIn(const SessionInfo& session) {
    DEFORM_ASSIGN_OR_RETURN(
        DeformStream stream,
        client_.Deform(session.session_id, Delivery::kEvery));
    Frame frame;
    for (const GoldenDeformation& deformation : golden_.deformations) {
      DEFORM_ASSIGN_OR_RETURN(
          const uint64_t sequence,
          stream.Send({.positions = deformation.vertices,
                       .stretch_blend = deformation.stretch_blend}));
      do {
        DEFORM_RETURN_IF_ERROR(stream.NextFrame(frame));
      } while (frame.answers_sequence < sequence);
      const Positions positions = frame.DoublePositions();
      if (positions.rows() != static_cast<int64_t>(queries_.size())) {
        return Nonsense("a frame");
      }
      for (size_t i = 0; i < queries_.size(); ++i) {
        result_.queries[queries_[i]].streamed.push_back(positions.row(i));
      }
    }
    stream.Close();
    while (stream.NextFrame(frame).ok()) {
    }
    return absl::OkStatus();
  }

  static absl::Status Nonsense(absl::string_view what) {
    return absl::InternalError(
        absl::StrCat("the server told of ", what, " that is not there"));
  }

  Client& client_;
  const GoldenCase& golden_;
  const std::vector<size_t> queries_;
  CreatedThings& created_;
  CaseResult& result_;
};

}  // namespace

void CreatedThings::Add(const ModelInfo& model) {
  MutexLock lock(mutex_);
  if (!model.existed) models_.insert(model.model_id);
}

void CreatedThings::Add(const BindingInfo& binding) {
  MutexLock lock(mutex_);
  if (!binding.existed) bindings_.insert(binding.binding_id);
}

absl::Status CreatedThings::DeleteAll(Client& client) {
  MutexLock lock(mutex_);
  absl::Status first;
  for (const std::string& id : bindings_)
    first.Update(client.DeleteBinding(id));
  for (const std::string& id : models_) first.Update(client.DeleteModel(id));
  bindings_.clear();
  models_.clear();
  return first;
}

std::string GoldenErrorName(absl::string_view reason) {
  if (reason == "NOT_CONVERGED") return "no_convergence";
  if (reason.empty()) return "error";
  return absl::AsciiStrToLower(reason);
}

absl::StatusOr<CaseResult> RunCase(Client& client, const GoldenCase& golden,
                                   CreatedThings& created) {
  // A model is refused as a whole: a point that is not finite goes alone.
  std::vector<std::vector<size_t>> runs(1);
  for (size_t i = 0; i < golden.queries.size(); ++i) {
    if (golden.queries[i].point.allFinite()) {
      runs[0].push_back(i);
    } else {
      runs.push_back({i});
    }
  }
  CaseResult result;
  result.queries.resize(golden.queries.size());
  for (const std::vector<size_t>& queries : runs) {
    if (queries.empty()) continue;
    DEFORM_RETURN_IF_ERROR(Run(client, golden, queries, created, result).Do());
  }
  return result;
}

}  // namespace deform
