#include "client/cli/picture_options.h"

#include <CLI/CLI.hpp>
#include <utility>

#include "client/cli/exit_code.h"
#include "core/base/status_macros.h"

namespace deform::cli {

void PictureOptions::AddTo(CLI::App& app) {
  auto* const group = app.add_option_group("Picture");
  group
      ->add_option("--view", view,
                   "auto, front, back, left, right, top, bottom or "
                   "AZIMUTH,ELEVATION in degrees")
      ->capture_default_str()
      ->type_name("VIEW");
  group->add_option("--up", up, "Axis that points up")
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->capture_default_str();
  group->add_option("--width", width, "Pixels, of each panel")
      ->check(CLI::Range(64, 4096))
      ->capture_default_str();
  group->add_option("--height", height, "Pixels")
      ->check(CLI::Range(64, 4096))
      ->capture_default_str();
  group->add_flag("--no-rig", no_rig, "Leave the cage or handles out");
}

absl::StatusOr<Image> DrawImage(const PictureOptions& options,
                                Picture picture) {
  const View::Up up = options.up == "x"   ? View::Up::kX
                      : options.up == "z" ? View::Up::kZ
                                          : View::Up::kY;
  const absl::StatusOr<View> view = ParseView(options.view, up);
  if (!view.ok()) return WithExit(kUsage, view.status());
  picture.view = *view;
  picture.width = options.width;
  picture.height = options.height;
  if (options.no_rig) {
    for (PicturePanel& panel : picture.panels) panel.rig.resize(0, 3);
  }
  absl::StatusOr<Image> image = DrawPicture(picture);
  if (!image.ok()) return WithExit(kBadFile, image.status());
  return image;
}

absl::Status SavePng(const Image& image, const std::string& path) {
  const absl::Status written = WritePng(image, path);
  return written.ok() ? written : WithExit(kBadFile, written);
}

absl::Status DrawInto(const std::string& path, const PictureOptions& options,
                      Picture picture) {
  DEFORM_ASSIGN_OR_RETURN(const Image image,
                          DrawImage(options, std::move(picture)));
  return SavePng(image, path);
}

}  // namespace deform::cli
