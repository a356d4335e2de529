#include "tests/support/golden.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/mesh/mesh.h"

namespace deform {
namespace {

using Json = nlohmann::json;

Json ReadJson(const std::string& file) {
  return Json::parse(
      std::ifstream(std::string(DEFORM_SOURCE_DIR "/tests/golden/") + file));
}

// Numbers are decimal strings, exact for inputs; "nan" and "inf" occur.
double Number(const Json& json) {
  return std::strtod(json.get_ref<const std::string&>().c_str(), nullptr);
}

std::vector<double> Numbers(const Json& json) {
  std::vector<double> numbers;
  for (const Json& element : json) numbers.push_back(Number(element));
  return numbers;
}

Vec3 Point(const Json& json) {
  Vec3 point = Vec3::Zero();
  for (size_t k = 0; k < json.size(); ++k) point[k] = Number(json[k]);
  return point;
}

Positions Points(const Json& json) {
  Positions points(json.size(), 3);
  for (size_t i = 0; i < json.size(); ++i) points.row(i) = Point(json[i]);
  return points;
}

absl::StatusOr<Rig> ReadRig(const Json& json, int dimension) {
  if (json.contains("control_points")) {
    absl::StatusOr<Handles> handles =
        Handles::Create(dimension, Points(json["control_points"]));
    if (!handles.ok()) return handles.status();
    return Rig(*std::move(handles));
  }
  const Json& corners = json["cage"]["faces"];
  Faces faces(corners.size(), dimension);
  for (size_t f = 0; f < corners.size(); ++f) {
    for (int k = 0; k < dimension; ++k) faces(f, k) = corners[f][k];
  }
  absl::StatusOr<Cage> cage =
      Cage::Create(dimension, Points(json["cage"]["vertices"]), faces);
  if (!cage.ok()) return cage.status();
  return Rig(*std::move(cage));
}

std::string SchemeOf(const std::string& name) {
  static const std::map<std::string, std::string> ids = {
      {"GC", "green"}, {"MVC", "mean_value"}, {"TCC", "t_cc"}, {"SCC", "s_cc"}};
  return ids.at(name);
}

// "stretch": 1; "unit": 0; "blend:0.5".
double BlendOf(const std::string& mode) {
  if (mode == "stretch") return 1;
  if (mode == "unit") return 0;
  return std::strtod(mode.c_str() + mode.find(':') + 1, nullptr);
}

GoldenDeformation ReadDeformation(const Json& json) {
  GoldenDeformation deformation;
  deformation.name = json["name"];
  deformation.vertices = Points(json["vertices"]);
  deformation.diagonal = BoxOf(deformation.vertices).diagonal();
  if (json.contains("s_mode")) {
    deformation.stretch_blend = BlendOf(json["s_mode"]);
    deformation.stretch = Numbers(json["s"]);
  }
  return deformation;
}

void ReadAcceptedErrors(const Json& json, GoldenQuery& query) {
  if (json.is_null()) return;
  const Json list = json.is_string() ? Json::array({json}) : json;
  for (const Json& error : list) query.accepted_errors.push_back(error);
  query.accepts_any_error = json == "any";
}

void ReadExpected(const Json& expected, const std::string& scheme,
                  GoldenQuery& query) {
  if (expected.contains("error")) {
    query.expected_error = expected["error"];
    return;
  }
  const char* key = scheme == "GC"    ? "phi"
                    : scheme == "MVC" ? "lambda"
                                      : "alpha";
  query.vertex = Numbers(expected[key]);
  if (scheme == "GC") query.normal = Numbers(expected["psi"]);
  if (!expected.contains("deformed")) return;
  for (const auto& [name, position] : expected["deformed"].items()) {
    query.deformed[name] = Point(position);
  }
}

GoldenQuery ReadQuery(const Json& json, const std::string& scheme) {
  GoldenQuery query;
  query.id = json["id"];
  query.point = Point(json["point"]);
  if (json.contains("exit_face") && !json["exit_face"].is_null()) {
    query.exit_face = json["exit_face"];
  }
  for (const Json& tag : json["tags"]) {
    query.ambiguous_split |= tag == "ambiguous_split";
  }
  if (json.contains("tol_weights")) {
    query.weight_tolerance = Number(json["tol_weights"]);
    query.position_tolerance = Number(json["tol_deformed"]);
  }
  ReadAcceptedErrors(json.value("error_accepted", Json()), query);
  ReadExpected(json["expected"], scheme, query);
  return query;
}

}  // namespace

double GoldenCase::NormalScale() const {
  return dimension == 2 ? diagonal * (1 + std::abs(std::log(diagonal)))
                        : diagonal;
}

std::map<std::string, std::vector<std::string>> GoldenGroups() {
  std::map<std::string, std::vector<std::string>> groups;
  const Json index = ReadJson("index.json");
  for (const Json& entry : index) {
    groups[entry["group"]].push_back(entry["file"]);
  }
  return groups;
}

GoldenCase ReadGolden(const std::string& file) {
  const Json json = ReadJson(file);
  const std::string scheme = json["scheme"];
  const int dimension = json["dimension"];
  GoldenCase golden{.id = json["id"],
                    .group = json["group"],
                    .scheme = SchemeOf(scheme),
                    .dimension = dimension,
                    .rig = ReadRig(json, dimension)};
  const Json& options = json["options"];
  if (options.contains("s")) {
    golden.options.handle_weights = Numbers(options["s"]);
  }
  if (options.contains("lambda")) {
    golden.options.lambda = Number(options["lambda"]);
  }
  if (json.contains("bbox_diagonal")) {
    golden.diagonal = Number(json["bbox_diagonal"]);
  }
  for (const Json& deformation : json["deformations"]) {
    golden.deformations.push_back(ReadDeformation(deformation));
  }
  for (const Json& query : json["queries"]) {
    golden.queries.push_back(ReadQuery(query, scheme));
  }
  return golden;
}

}  // namespace deform
