// Options of commands that draw.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/pictures/picture.h"

namespace CLI {
class App;
}

namespace deform::cli {

struct PictureOptions {
  std::string view = "auto";
  std::string up = "y";
  int width = 900;
  int height = 900;
  bool no_rig = false;

  void AddTo(CLI::App& app);
};

// Draws `picture` as the options say.
absl::StatusOr<Image> DrawImage(const PictureOptions& options, Picture picture);

absl::Status SavePng(const Image& image, const std::string& path);

// Both.
absl::Status DrawInto(const std::string& path, const PictureOptions& options,
                      Picture picture);

}  // namespace deform::cli
