// Options that say how a model is bound, shared by bind, deform and play.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "client/cpp/arrays.h"

namespace CLI {
class App;
}

namespace deform::cli {

struct RigOptions {
  std::string cage;
  std::string handles;
  std::string scheme;
  std::string exit;
  std::string exit_per_point;
  std::string unbindable = "fail";
  std::string clamp;
  bool flip_cage = false;
  bool add_box = false;
  std::string handle_weights;
  double lambda = 0;
  std::optional<double> weight_tolerance;
  int dimension = 0;  // 0: as the files say.

  // `both`: a cage and handles may be given together.
  void AddTo(CLI::App& app, bool both = false);
  // Whether any rig was given.
  bool given() const { return !cage.empty() || !handles.empty(); }

 private:
  void AddRigTo(CLI::App& group, bool both);
  void AddPointsTo(CLI::App& group);
  void AddWeightsTo(CLI::App& group);
};

// "auto" or a list of faces, "0,4,7". A usage error otherwise.
absl::StatusOr<ExitRegions> ParseExits(const std::string& text);

// All of a binding's specification but the model. `dimension` is the model's;
// the rig's file is read as that. The scheme, if none was named, is "green" for
// a cage and "s_cc" for handles.
absl::StatusOr<BindingSpec> LoadSpec(const RigOptions& options, int dimension);

// 2 only if the model and the rig are both flat, unless --dimension says which.
absl::StatusOr<int> ChooseDimension(const RigOptions& options,
                                    int model_dimension);

}  // namespace deform::cli
