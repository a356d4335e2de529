#include "client/cli/info_text.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"

namespace deform::cli {
namespace {

// "name          value" lines.
class Properties {
 public:
  explicit Properties(std::ostream& out) : out_(out) {}
  void Add(absl::string_view name, absl::string_view value) {
    out_ << absl::StrFormat("%-14s %s\n", name, value);
  }

 private:
  std::ostream& out_;
};

std::string Corner(const std::vector<double>& corner) {
  return absl::StrCat("(", absl::StrJoin(corner, ", "), ")");
}

// "3, 17, 18 and 4 more".
std::string FirstOf(const std::vector<int64_t>& numbers, size_t count) {
  const size_t shown = std::min(count, numbers.size());
  std::string text =
      absl::StrJoin(numbers.begin(), numbers.begin() + shown, ", ");
  if (shown < numbers.size()) {
    absl::StrAppend(&text, " and ", Thousands(numbers.size() - shown), " more");
  }
  return text;
}

// "compressed 9.8 times from 215 MiB; within 7.1e-06 of the diagonal".
std::string FormOf(const BindingInfo& binding) {
  std::string text = WeightFormText(binding.weight_form);
  if (binding.weight_form == WeightForm::kCompressed) {
    absl::StrAppendFormat(
        &text, " %.3g times from %s; within %.2g of the diagonal",
        binding.compression_ratio, Bytes(binding.dense_weight_bytes),
        binding.weight_error_bound);
  } else if (binding.weight_form == WeightForm::kCompressing) {
    absl::StrAppendFormat(&text, " to %.2g of the diagonal, %s of %s points",
                          binding.weight_tolerance,
                          Thousands(binding.points_done),
                          Thousands(binding.points_total));
  } else if (!binding.why_dense.empty()) {
    absl::StrAppend(&text, ": ", binding.why_dense);
  }
  return text;
}

}  // namespace

std::string TimeText(WallTime time) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", absl::FromChrono(time),
                          absl::UTCTimeZone());
}

std::string WeightStateText(WeightState state) {
  switch (state) {
    case WeightState::kResident:
      return "resident";
    case WeightState::kEvicted:
      return "evicted";
    case WeightState::kComputing:
      return "computing";
    case WeightState::kUnknown:
      break;
  }
  return "unknown";
}

std::string WeightFormText(WeightForm form) {
  switch (form) {
    case WeightForm::kDense:
      return "dense";
    case WeightForm::kCompressing:
      return "compressing";
    case WeightForm::kCompressed:
      return "compressed";
    case WeightForm::kUnknown:
      break;
  }
  return "unknown";
}

Json ToJson(const ModelInfo& model) {
  return {{"model_id", model.model_id},
          {"display_name", model.display_name},
          {"dimension", model.dimension},
          {"vertex_count", model.vertex_count},
          {"face_count", model.face_count},
          {"box_min", model.box_min},
          {"box_max", model.box_max},
          {"create_time", TimeText(model.create_time)}};
}

Json ToJson(const BindQuality& quality) {
  return {{"reproduction_error", quality.reproduction_error},
          {"partition_error", quality.partition_error},
          {"weight_min", quality.weight_min},
          {"weight_max", quality.weight_max},
          {"weight_sum_max", quality.weight_sum_max},
          {"iterations_total", quality.iterations_total},
          {"iterations_max", quality.iterations_max},
          {"iterations_mean", quality.iterations_mean},
          {"residual_max", quality.residual_max},
          {"residual_mean", quality.residual_mean}};
}

Json ToJson(const BindingInfo& binding) {
  Json unbound = Json::array();
  for (const UnboundInfo& group : binding.unbound) {
    unbound.push_back({{"reason", group.reason}, {"points", group.points}});
  }
  Json parts = Json::array();
  for (const ExitPartInfo& part : binding.exit_parts) {
    parts.push_back({{"exit_face", part.exit_face},
                     {"point_count", part.point_count},
                     {"first_point", part.first_point},
                     {"crossed_faces", part.crossed_faces}});
  }
  return {{"binding_id", binding.binding_id},
          {"model_id", binding.model_id},
          {"scheme", binding.scheme},
          {"dimension", binding.dimension},
          {"point_count", binding.point_count},
          {"vertex_count", binding.vertex_count},
          {"fixed_handle_count", binding.fixed_handle_count},
          {"normal_count", binding.normal_count},
          {"rig_diagonal", binding.rig_diagonal},
          {"weight_bytes", binding.weight_bytes},
          {"weight_state", WeightStateText(binding.weight_state)},
          {"weight_form", WeightFormText(binding.weight_form)},
          {"weight_tolerance", binding.weight_tolerance},
          {"weight_error_bound", binding.weight_error_bound},
          {"dense_weight_bytes", binding.dense_weight_bytes},
          {"compression_ratio", binding.compression_ratio},
          {"why_dense", binding.why_dense},
          {"points_done", binding.points_done},
          {"points_total", binding.points_total},
          {"weight_users", binding.weight_users},
          {"last_use_time", TimeText(binding.last_use_time)},
          {"compute_seconds", binding.compute_seconds},
          {"quality", ToJson(binding.quality)},
          {"unbound_count", binding.unbound_count},
          {"unbound", unbound},
          {"clamped_count", binding.clamped_count},
          {"clamped", binding.clamped},
          {"exit_parts", parts},
          {"warnings", binding.warnings},
          {"create_time", TimeText(binding.create_time)}};
}

Json ToJson(const SessionInfo& session) {
  return {{"session_id", session.session_id},
          {"binding_id", session.binding_id},
          {"revision", session.revision},
          {"durable_revision", session.durable_revision},
          {"epoch", session.epoch},
          {"participant_count", session.participant_count},
          {"create_time", TimeText(session.create_time)}};
}

Json ToJson(const SchemeInfo& scheme) {
  return {{"scheme", scheme.scheme},
          {"description", scheme.description},
          {"takes_cage", scheme.takes_cage},
          {"uses_normals", scheme.uses_normals}};
}

namespace {

std::string RigText(const BindingInfo& binding) {
  std::string fixed;
  if (binding.fixed_handle_count > 0) {
    fixed = Thousands(binding.fixed_handle_count) + " fixed handles, ";
  }
  return absl::StrFormat("%s vertices, %s%s normals, diagonal %.6g",
                         Thousands(binding.vertex_count), fixed,
                         Thousands(binding.normal_count), binding.rig_diagonal);
}

std::string KeptText(const BindingInfo& binding) {
  std::string kept = WeightStateText(binding.weight_state);
  if (binding.weight_state == WeightState::kComputing) {
    absl::StrAppendFormat(&kept, ", %s of %s points",
                          Thousands(binding.points_done),
                          Thousands(binding.points_total));
  }
  return absl::StrFormat("%s; %d users, last use %s", kept,
                         binding.weight_users, TimeText(binding.last_use_time));
}

void DescribeQuality(const BindQuality& quality, Properties& properties) {
  properties.Add(
      "quality",
      absl::StrFormat("reproduces the model to %.2g of the diagonal; weights "
                      "%.3g to %.3g, sum to 1 within %.2g",
                      quality.reproduction_error, quality.weight_min,
                      quality.weight_max, quality.partition_error));
  if (quality.iterations_total == 0) return;
  properties.Add(
      "solver", absl::StrFormat("%.1f steps a point, %d at most; residual "
                                "%.2g, %.2g at most",
                                quality.iterations_mean, quality.iterations_max,
                                quality.residual_mean, quality.residual_max));
}

// Points with something to be told of each: outside, not bound, clamped.
void DescribePoints(const BindingInfo& binding, Properties& properties) {
  for (const ExitPartInfo& part : binding.exit_parts) {
    std::string crossed;
    if (!part.crossed_faces.empty()) {
      crossed =
          absl::StrCat("; also crosses face ", FirstOf(part.crossed_faces, 6));
    }
    properties.Add("outside part",
                   absl::StrFormat("%s points from %d on, through face %d%s",
                                   Thousands(part.point_count),
                                   part.first_point, part.exit_face, crossed));
  }
  for (const UnboundInfo& group : binding.unbound) {
    properties.Add(
        "not bound",
        absl::StrFormat("%s points (%s): %s", Thousands(group.points.size()),
                        group.reason, FirstOf(group.points, 10)));
  }
  if (binding.clamped_count > 0) {
    properties.Add("clamped", absl::StrFormat("%s points: %s",
                                              Thousands(binding.clamped_count),
                                              FirstOf(binding.clamped, 10)));
  }
}

}  // namespace

void Describe(const ModelInfo& model, std::ostream& out) {
  Properties properties(out);
  properties.Add("model", model.model_id);
  properties.Add("name", model.display_name);
  properties.Add(
      "points",
      absl::StrFormat("%s in %dD, %s triangles", Thousands(model.vertex_count),
                      model.dimension, Thousands(model.face_count)));
  properties.Add("box", absl::StrCat(Corner(model.box_min), " to ",
                                     Corner(model.box_max)));
  properties.Add("created", TimeText(model.create_time));
}

void Describe(const BindingInfo& binding, std::ostream& out) {
  Properties properties(out);
  properties.Add("binding", binding.binding_id);
  properties.Add("model", binding.model_id);
  properties.Add("scheme", binding.scheme);
  properties.Add("points",
                 absl::StrFormat("%s in %dD", Thousands(binding.point_count),
                                 binding.dimension));
  properties.Add("rig", RigText(binding));
  properties.Add("weights", absl::StrFormat("%s, computed in %s",
                                            Bytes(binding.weight_bytes),
                                            Seconds(binding.compute_seconds)));
  properties.Add("form", FormOf(binding));
  properties.Add("kept", KeptText(binding));
  DescribeQuality(binding.quality, properties);
  DescribePoints(binding, properties);
  for (const std::string& warning : binding.warnings) {
    properties.Add("warning", warning);
  }
  properties.Add("created", TimeText(binding.create_time));
}

void Describe(const SessionInfo& session, std::ostream& out) {
  Properties properties(out);
  properties.Add("session", session.session_id);
  properties.Add("binding", session.binding_id);
  properties.Add("revision", absl::StrCat(session.revision));
  properties.Add("durable revision", absl::StrCat(session.durable_revision));
  properties.Add("epoch", absl::StrCat(session.epoch));
  properties.Add("participants", absl::StrCat(session.participant_count));
  properties.Add("created", TimeText(session.create_time));
}

}  // namespace deform::cli
