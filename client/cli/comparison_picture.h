// What schemes make of one model, and how that is drawn.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cli/picture_options.h"
#include "client/cli/quality_picture.h"
#include "client/cpp/info.h"
#include "client/pictures/image.h"

namespace deform::cli {

struct ComparedScheme {
  std::string name;
  bool caged = true;  // Else by handles.
  BindingInfo binding;
  QualityInfo quality;         // With its pose.
  Positions deformed;          // N x 3
  Positions rig;               // Posed.
  std::vector<double> values;  // What is coloured.
};

struct Comparison {
  std::string title;
  std::string color;   // distortion, displacement or influence.
  int64_t handle = 0;  // Of influence.
  int dimension = 3;
  Positions rest;
  Faces faces;
  Positions rest_rig;
  bool rest_caged = false;
  Faces cage_faces;
  std::vector<ComparedScheme> schemes;
};

// The model at rest and under each scheme, in colours that mean the same
// everywhere; below, the time that weights took and the histogram of each.
absl::StatusOr<Image> DrawComparison(const Comparison& comparison,
                                     const PictureOptions& options);

}  // namespace deform::cli
