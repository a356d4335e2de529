#include "client/cli/rig_options.h"

#include <CLI/CLI.hpp>
#include <cmath>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/cli/exit_code.h"
#include "client/cli/files.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

absl::StatusOr<ExitRegions> LoadExitPerPoint(const std::string& path) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<double> numbers, LoadNumbers(path));
  ExitRegions exits{.kind = ExitRegions::Kind::kPerPoint};
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] != std::floor(numbers[i]) || numbers[i] < -1 ||
        numbers[i] > 2147483647) {
      return WithExit(
          kBadFile,
          InvalidInput("BAD_NUMBER", "",
                       absl::StrCat(path, ": entry ", i, " (", numbers[i],
                                    ") is neither a face nor -1")));
    }
    exits.face_of_point.push_back(static_cast<int32_t>(numbers[i]));
  }
  return exits;
}

// A list, "0,0.5,2", or else a file.
absl::StatusOr<std::vector<double>> ParseNumbers(const std::string& text) {
  std::vector<double> numbers;
  if (text.empty()) return numbers;
  for (const absl::string_view word :
       absl::StrSplit(absl::string_view(text), ',')) {
    double number = 0;
    if (!absl::SimpleAtod(word, &number)) return LoadNumbers(text);
    numbers.push_back(number);
  }
  return numbers;
}

// A list of points, or a file of them.
absl::StatusOr<std::vector<int64_t>> ParsePoints(const std::string& text) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<double> numbers,
                          ParseNumbers(text));
  std::vector<int64_t> points;
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (!(numbers[i] >= 0 && numbers[i] < 1e15) ||
        numbers[i] != std::floor(numbers[i])) {
      return UsageError(absl::StrCat("--clamp: entry ", i, " (", numbers[i],
                                     ") is not the number of a point"));
    }
    points.push_back(static_cast<int64_t>(numbers[i]));
  }
  return points;
}

}  // namespace

void RigOptions::AddTo(CLI::App& app, bool both) {
  auto* const group = app.add_option_group("Rig", "What the model hangs on");
  AddRigTo(*group, both);
  AddPointsTo(*group);
  AddWeightsTo(*group);
  group
      ->add_option("--dimension", dimension,
                   "2 or 3; by default 2 if the files are flat")
      ->check(CLI::IsMember({2, 3}))
      ->type_name("N");
}

void RigOptions::AddRigTo(CLI::App& group, bool both) {
  auto* const cage_option =
      group
          .add_option("--cage", cage,
                      "Closed mesh around the model; in 2D loops of OBJ 'l' "
                      "elements")
          ->type_name("FILE");
  auto* const handles_option =
      group
          .add_option("--handles", handles, "Control points: a file's vertices")
          ->type_name("FILE");
  if (!both) handles_option->excludes(cage_option);
  group.add_flag("--flip-cage", flip_cage, "Turn an inside-out cage");
  group
      .add_flag("--add-box", add_box,
                "Also the corners of the model's box, 1.6 times as large, as "
                "handles that stay fixed: then the model lies inside them")
      ->needs(handles_option);
}

void RigOptions::AddPointsTo(CLI::App& group) {
  group
      .add_option("--exit", exit,
                  "How points outside the cage are reached: 'auto', or the "
                  "faces they leave through, such as 3,17. Faces are counted "
                  "from 0, as triangles: a polygon of k corners in the file "
                  "counts as k - 2 of them, in its place")
      ->type_name("auto|FACE,...");
  group
      .add_option("--exit-per-point", exit_per_point,
                  "Exit face of each model point, -1 for none")
      ->type_name("FILE")
      ->excludes("--exit");
  group
      .add_option("--unbindable", unbindable,
                  "Points that cannot be bound: refuse them, or bind the rest "
                  "and report them")
      ->check(CLI::IsMember({"fail", "report"}))
      ->capture_default_str();
  group
      .add_option("--clamp", clamp,
                  "Points of the model that stay at rest whatever the pose, "
                  "as list or file; they may lie outside of the rig")
      ->type_name("LIST|FILE");
}

void RigOptions::AddWeightsTo(CLI::App& group) {
  group
      .add_option("--scheme", scheme,
                  "Coordinate scheme, see 'list schemes'; by default green "
                  "for a cage, s_cc for handles")
      ->type_name("NAME");
  group
      .add_option("--handle-weights", handle_weights,
                  "t_cc: weight s >= 0 of each handle, as list or file")
      ->type_name("LIST|FILE");
  group.add_option("--lambda", lambda,
                   "s_cc: the paper's lambda > 1; it has no effect");
  group
      .add_option("--weight-tolerance", weight_tolerance,
                  "How far compressed weights may move a point, as a fraction "
                  "of the rig's diagonal: 1e-6 to 1e-2, or 0 for dense ones; "
                  "by default the server's")
      ->type_name("FRACTION");
}

absl::StatusOr<ExitRegions> ParseExits(const std::string& text) {
  ExitRegions exits;
  if (text.empty()) return exits;
  if (text == "auto") {
    exits.kind = ExitRegions::Kind::kAutomatic;
    return exits;
  }
  exits.kind = ExitRegions::Kind::kFaces;
  for (const absl::string_view word :
       absl::StrSplit(absl::string_view(text), ',')) {
    int32_t face = 0;
    if (!absl::SimpleAtoi(word, &face) || face < 0) {
      return UsageError(absl::StrCat("--exit: '", word,
                                     "' is neither 'auto' nor a face number"));
    }
    exits.faces.push_back(face);
  }
  return exits;
}

absl::StatusOr<int> ChooseDimension(const RigOptions& options,
                                    int model_dimension) {
  if (options.dimension != 0) return options.dimension;
  if (model_dimension == 3 || !options.given()) return model_dimension;
  DEFORM_ASSIGN_OR_RETURN(
      const MeshFile rig,
      LoadMesh(options.cage.empty() ? options.handles : options.cage));
  return rig.dimension;
}

absl::StatusOr<BindingSpec> LoadSpec(const RigOptions& options, int dimension) {
  if (!options.given()) {
    return UsageError("a rig is needed: --cage FILE or --handles FILE");
  }
  const bool caged = !options.cage.empty();
  const std::string& path = caged ? options.cage : options.handles;
  BindingSpec spec;
  DEFORM_ASSIGN_OR_RETURN(spec.exits, ParseExits(options.exit));
  DEFORM_ASSIGN_OR_RETURN(spec.options.handle_weights,
                          ParseNumbers(options.handle_weights));
  DEFORM_ASSIGN_OR_RETURN(spec.clamped, ParsePoints(options.clamp));
  DEFORM_ASSIGN_OR_RETURN(const MeshFile file,
                          LoadMesh(path, ToFileDimension(dimension)));
  if (caged) {
    DEFORM_ASSIGN_OR_RETURN(spec.rig, CageOf(file, path));
  } else {
    spec.rig = RigArrays(RigKind::kHandles, dimension, file.positions, Faces());
  }
  if (!options.exit_per_point.empty()) {
    DEFORM_ASSIGN_OR_RETURN(spec.exits,
                            LoadExitPerPoint(options.exit_per_point));
  }
  spec.scheme = !options.scheme.empty() ? options.scheme
                : caged                 ? "green"
                                        : "s_cc";
  spec.options.lambda = options.lambda;
  spec.weight_tolerance = options.weight_tolerance;
  spec.unbindable =
      options.unbindable == "report" ? Unbindable::kReport : Unbindable::kFail;
  spec.flip_inside_out = options.flip_cage;
  spec.add_box_handles = options.add_box && !caged;
  return spec;
}

}  // namespace deform::cli
