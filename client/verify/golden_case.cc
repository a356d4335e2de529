#include "client/verify/golden_case.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

using Json = nlohmann::json;

// A value within the file that remembers where it stands.
class Node {
 public:
  Node(const Json& json, std::string path)
      : json_(&json), path_(std::move(path)) {}

  const Json& json() const { return *json_; }
  bool Has(const char* key) const {
    return json_->is_object() && json_->contains(key) &&
           !json_->at(key).is_null();
  }

  absl::StatusOr<Node> At(const char* key) const {
    if (!Has(key)) return Error(absl::StrCat("has no field '", key, "'"));
    return Node(json_->at(key),
                path_.empty() ? key : absl::StrCat(path_, ".", key));
  }
  absl::StatusOr<std::vector<Node>> Items() const {
    if (!json_->is_array()) return Error("is not a list");
    std::vector<Node> items;
    for (size_t i = 0; i < json_->size(); ++i) {
      items.emplace_back(json_->at(i), absl::StrCat(path_, "[", i, "]"));
    }
    return items;
  }

  absl::StatusOr<std::string> Text() const {
    if (!json_->is_string()) return Error("is not a string");
    return json_->get<std::string>();
  }
  absl::StatusOr<double> Number() const {
    if (json_->is_number()) return json_->get<double>();
    DEFORM_ASSIGN_OR_RETURN(const std::string text, Text());
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (text.empty() || *end != 0 || absl::ascii_isspace(text[0])) {
      return Error(absl::StrCat("'", text, "' is not a number"));
    }
    return value;
  }
  absl::StatusOr<int32_t> Index() const {
    if (!json_->is_number_integer() ||
        std::abs(json_->get<double>()) > 2147483647.0) {
      return Error("is not an index");
    }
    return json_->get<int32_t>();
  }
  absl::StatusOr<std::vector<double>> Numbers() const {
    DEFORM_ASSIGN_OR_RETURN(const std::vector<Node> items, Items());
    std::vector<double> numbers;
    for (const Node& item : items) {
      DEFORM_ASSIGN_OR_RETURN(const double number, item.Number());
      numbers.push_back(number);
    }
    return numbers;
  }
  absl::StatusOr<std::vector<std::string>> Texts() const {
    DEFORM_ASSIGN_OR_RETURN(const std::vector<Node> items, Items());
    std::vector<std::string> texts;
    for (const Node& item : items) {
      DEFORM_ASSIGN_OR_RETURN(std::string text, item.Text());
      texts.push_back(std::move(text));
    }
    return texts;
  }
  absl::StatusOr<Vec3> Point(int dimension) const {
    DEFORM_ASSIGN_OR_RETURN(const std::vector<double> numbers, Numbers());
    if (numbers.size() != static_cast<size_t>(dimension)) {
      return Error(
          absl::StrCat("has ", numbers.size(), " numbers, not ", dimension));
    }
    Vec3 point = Vec3::Zero();
    std::copy(numbers.begin(), numbers.end(), point.data());
    return point;
  }
  absl::StatusOr<Positions> Points(int dimension) const {
    DEFORM_ASSIGN_OR_RETURN(const std::vector<Node> items, Items());
    Positions points(items.size(), 3);
    for (size_t i = 0; i < items.size(); ++i) {
      DEFORM_ASSIGN_OR_RETURN(const Vec3 point, items[i].Point(dimension));
      points.row(i) = point;
    }
    return points;
  }

  absl::Status Error(absl::string_view what) const {
    return InvalidInput("BAD_CASE", path_,
                        absl::StrCat(path_, path_.empty() ? "" : ": ", what));
  }

 private:
  const Json* json_;
  std::string path_;
};

struct SchemeName {
  const char* golden;
  const char* server;
  const char* vertex_weights;  // Field of the expected values.
  bool takes_cage;
};
constexpr SchemeName kSchemes[] = {{"GC", "green", "phi", true},
                                   {"MVC", "mean_value", "lambda", true},
                                   {"TCC", "t_cc", "alpha", false},
                                   {"SCC", "s_cc", "alpha", false}};

absl::StatusOr<const SchemeName*> ReadScheme(const Node& root) {
  DEFORM_ASSIGN_OR_RETURN(const Node node, root.At("scheme"));
  DEFORM_ASSIGN_OR_RETURN(const std::string name, node.Text());
  for (const SchemeName& scheme : kSchemes) {
    if (name == scheme.golden) return &scheme;
  }
  return node.Error(absl::StrCat("'", name, "' is none of GC, MVC, TCC, SCC"));
}

absl::Status ReadCage(const Node& cage, GoldenCase& result) {
  DEFORM_ASSIGN_OR_RETURN(const Node vertices, cage.At("vertices"));
  DEFORM_ASSIGN_OR_RETURN(result.rig.vertices,
                          vertices.Points(result.dimension));
  DEFORM_ASSIGN_OR_RETURN(const Node faces, cage.At("faces"));
  DEFORM_ASSIGN_OR_RETURN(const std::vector<Node> rows, faces.Items());
  result.rig.faces.resize(rows.size(), result.dimension);
  for (size_t f = 0; f < rows.size(); ++f) {
    DEFORM_ASSIGN_OR_RETURN(const std::vector<Node> corners, rows[f].Items());
    if (corners.size() != static_cast<size_t>(result.dimension)) {
      return rows[f].Error(absl::StrCat("has ", corners.size(),
                                        " corners, not ", result.dimension));
    }
    for (int k = 0; k < result.dimension; ++k) {
      DEFORM_ASSIGN_OR_RETURN(result.rig.faces(f, k), corners[k].Index());
    }
  }
  return absl::OkStatus();
}

absl::Status ReadRig(const Node& root, const SchemeName& scheme,
                     GoldenCase& result) {
  result.rig.dimension = result.dimension;
  if (scheme.takes_cage) {
    DEFORM_ASSIGN_OR_RETURN(const Node cage, root.At("cage"));
    DEFORM_RETURN_IF_ERROR(ReadCage(cage, result));
  } else {
    result.rig.kind = RigKind::kHandles;
    DEFORM_ASSIGN_OR_RETURN(const Node points, root.At("control_points"));
    DEFORM_ASSIGN_OR_RETURN(result.rig.vertices,
                            points.Points(result.dimension));
  }
  if (!root.Has("options")) return absl::OkStatus();
  DEFORM_ASSIGN_OR_RETURN(const Node options, root.At("options"));
  if (options.Has("s")) {
    DEFORM_ASSIGN_OR_RETURN(const Node s, options.At("s"));
    DEFORM_ASSIGN_OR_RETURN(result.options.handle_weights, s.Numbers());
  }
  if (options.Has("lambda")) {
    DEFORM_ASSIGN_OR_RETURN(const Node lambda, options.At("lambda"));
    DEFORM_ASSIGN_OR_RETURN(result.options.lambda, lambda.Number());
  }
  return absl::OkStatus();
}

// "stretch", "unit" or "blend:t".
absl::StatusOr<double> ReadStretchMode(const Node& node) {
  DEFORM_ASSIGN_OR_RETURN(const std::string mode, node.Text());
  if (mode == "stretch") return 1.0;
  if (mode == "unit") return 0.0;
  if (absl::StartsWith(mode, "blend:")) {
    const Json number = mode.substr(6);
    const absl::StatusOr<double> blend = Node(number, "").Number();
    if (blend.ok()) return *blend;
  }
  return node.Error(
      absl::StrCat("'", mode, "' is none of stretch, unit, blend:t"));
}

absl::StatusOr<GoldenDeformation> ReadDeformation(const Node& node,
                                                  const GoldenCase& result) {
  GoldenDeformation deformation;
  DEFORM_ASSIGN_OR_RETURN(const Node name, node.At("name"));
  DEFORM_ASSIGN_OR_RETURN(deformation.name, name.Text());
  DEFORM_ASSIGN_OR_RETURN(const Node vertices, node.At("vertices"));
  DEFORM_ASSIGN_OR_RETURN(deformation.vertices,
                          vertices.Points(result.dimension));
  if (deformation.vertices.rows() != result.rig.vertices.rows()) {
    return vertices.Error(absl::StrCat("has ", deformation.vertices.rows(),
                                       " rows, the rig has ",
                                       result.rig.vertices.rows()));
  }
  if (node.Has("s_mode")) {
    DEFORM_ASSIGN_OR_RETURN(const Node mode, node.At("s_mode"));
    DEFORM_ASSIGN_OR_RETURN(deformation.stretch_blend, ReadStretchMode(mode));
  }
  if (node.Has("s")) {
    DEFORM_ASSIGN_OR_RETURN(const Node s, node.At("s"));
    DEFORM_ASSIGN_OR_RETURN(deformation.stretch, s.Numbers());
    if (static_cast<int64_t>(deformation.stretch.size()) !=
        result.rig.faces.rows()) {
      return s.Error(absl::StrCat("has ", deformation.stretch.size(),
                                  " numbers, the cage has ",
                                  result.rig.faces.rows(), " faces"));
    }
  }
  return deformation;
}

absl::Status ReadDeformed(const Node& node, const GoldenCase& result,
                          GoldenQuery& query) {
  if (!node.json().is_object()) return node.Error("is not an object");
  for (const auto& [name, unused] : node.json().items()) {
    const auto found =
        std::find_if(result.deformations.begin(), result.deformations.end(),
                     [&name = name](const auto& d) { return d.name == name; });
    if (found == result.deformations.end()) {
      return node.Error(absl::StrCat("there is no deformation '", name, "'"));
    }
    DEFORM_ASSIGN_OR_RETURN(const Node place, node.At(name.c_str()));
    DEFORM_ASSIGN_OR_RETURN(const Vec3 point, place.Point(result.dimension));
    query.deformed.emplace_back(
        static_cast<int>(found - result.deformations.begin()), point);
  }
  return absl::OkStatus();
}

absl::Status ReadExpected(const Node& node, const SchemeName& scheme,
                          const GoldenCase& result, GoldenQuery& query) {
  DEFORM_ASSIGN_OR_RETURN(const Node expected, node.At("expected"));
  if (expected.Has("error")) {
    DEFORM_ASSIGN_OR_RETURN(const Node error, expected.At("error"));
    DEFORM_ASSIGN_OR_RETURN(query.expected_error, error.Text());
    return absl::OkStatus();
  }
  DEFORM_ASSIGN_OR_RETURN(const Node weights_at, node.At("tol_weights"));
  DEFORM_ASSIGN_OR_RETURN(query.weight_tolerance, weights_at.Number());
  DEFORM_ASSIGN_OR_RETURN(const Node deformed_at, node.At("tol_deformed"));
  DEFORM_ASSIGN_OR_RETURN(query.deformed_tolerance, deformed_at.Number());
  DEFORM_ASSIGN_OR_RETURN(const Node weights,
                          expected.At(scheme.vertex_weights));
  DEFORM_ASSIGN_OR_RETURN(query.vertex_weights, weights.Numbers());
  if (std::string(scheme.golden) == "GC") {
    DEFORM_ASSIGN_OR_RETURN(const Node psi, expected.At("psi"));
    DEFORM_ASSIGN_OR_RETURN(query.normal_weights, psi.Numbers());
  }
  if (!expected.Has("deformed")) return absl::OkStatus();
  DEFORM_ASSIGN_OR_RETURN(const Node deformed, expected.At("deformed"));
  return ReadDeformed(deformed, result, query);
}

absl::StatusOr<GoldenQuery> ReadQuery(const Node& node,
                                      const SchemeName& scheme,
                                      const GoldenCase& result) {
  GoldenQuery query;
  DEFORM_ASSIGN_OR_RETURN(const Node id, node.At("id"));
  DEFORM_ASSIGN_OR_RETURN(query.id, id.Index());
  DEFORM_ASSIGN_OR_RETURN(const Node point, node.At("point"));
  DEFORM_ASSIGN_OR_RETURN(query.point, point.Point(result.dimension));
  if (node.Has("exit_face")) {
    DEFORM_ASSIGN_OR_RETURN(const Node face, node.At("exit_face"));
    DEFORM_ASSIGN_OR_RETURN(query.exit_face, face.Index());
  }
  if (node.Has("tags")) {
    DEFORM_ASSIGN_OR_RETURN(const Node tags, node.At("tags"));
    DEFORM_ASSIGN_OR_RETURN(query.tags, tags.Texts());
  }
  if (node.Has("error_accepted")) {
    DEFORM_ASSIGN_OR_RETURN(const Node accepted, node.At("error_accepted"));
    if (accepted.json().is_string()) {
      query.accepted_errors = {accepted.json().get<std::string>()};
    } else {
      DEFORM_ASSIGN_OR_RETURN(query.accepted_errors, accepted.Texts());
    }
    query.any_error_accepted =
        accepted.json().is_string() && query.accepted_errors[0] == "any";
  }
  DEFORM_RETURN_IF_ERROR(ReadExpected(node, scheme, result, query));
  return query;
}

absl::StatusOr<GoldenCase> ReadCase(const Node& root) {
  GoldenCase result;
  DEFORM_ASSIGN_OR_RETURN(const Node id, root.At("id"));
  DEFORM_ASSIGN_OR_RETURN(result.id, id.Text());
  DEFORM_ASSIGN_OR_RETURN(const Node group, root.At("group"));
  DEFORM_ASSIGN_OR_RETURN(result.group, group.Text());
  DEFORM_ASSIGN_OR_RETURN(const SchemeName* const scheme, ReadScheme(root));
  result.scheme = scheme->server;
  DEFORM_ASSIGN_OR_RETURN(const Node dimension, root.At("dimension"));
  DEFORM_ASSIGN_OR_RETURN(result.dimension, dimension.Index());
  if (result.dimension != 2 && result.dimension != 3) {
    return dimension.Error("is neither 2 nor 3");
  }
  DEFORM_RETURN_IF_ERROR(ReadRig(root, *scheme, result));
  if (root.Has("bbox_diagonal")) {
    DEFORM_ASSIGN_OR_RETURN(const Node diagonal, root.At("bbox_diagonal"));
    DEFORM_ASSIGN_OR_RETURN(result.diagonal, diagonal.Number());
  } else if (result.rig.vertices.rows() > 0) {
    result.diagonal = BoxOf(result.rig.vertices).diagonal();
  }
  if (root.Has("deformations")) {
    DEFORM_ASSIGN_OR_RETURN(const Node list, root.At("deformations"));
    DEFORM_ASSIGN_OR_RETURN(const std::vector<Node> items, list.Items());
    for (const Node& item : items) {
      DEFORM_ASSIGN_OR_RETURN(GoldenDeformation deformation,
                              ReadDeformation(item, result));
      result.deformations.push_back(std::move(deformation));
    }
  }
  DEFORM_ASSIGN_OR_RETURN(const Node queries, root.At("queries"));
  DEFORM_ASSIGN_OR_RETURN(const std::vector<Node> items, queries.Items());
  if (items.empty()) return queries.Error("is empty");
  for (const Node& item : items) {
    DEFORM_ASSIGN_OR_RETURN(GoldenQuery query,
                            ReadQuery(item, *scheme, result));
    result.queries.push_back(std::move(query));
  }
  return result;
}

}  // namespace

bool GoldenQuery::HasTag(absl::string_view tag) const {
  return std::find(tags.begin(), tags.end(), tag) != tags.end();
}

absl::StatusOr<std::optional<GoldenCase>> ParseGoldenCase(
    absl::string_view text, absl::string_view file) {
  const std::string prefix = absl::StrCat(file, ": ");
  const Json json = Json::parse(text.begin(), text.end(), nullptr,
                                /*allow_exceptions=*/false);
  if (json.is_discarded()) {
    return InvalidInput("BAD_CASE", "", absl::StrCat(prefix, "is not JSON"));
  }
  if (!json.is_object()) return std::optional<GoldenCase>();
  if (json.value("schema", Json()) != "deform-golden/1") {
    if (!json.contains("queries")) return std::optional<GoldenCase>();
    return InvalidInput(
        "BAD_CASE", "schema",
        absl::StrCat(prefix, "schema: is not \"deform-golden/1\""));
  }
  absl::StatusOr<GoldenCase> result = ReadCase(Node(json, ""));
  if (!result.ok()) return Annotate(result.status(), prefix);
  result->file = std::string(file);
  return std::optional<GoldenCase>(*std::move(result));
}

}  // namespace deform
