#include "client/pictures/picture.h"

#include <algorithm>
#include <set>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/pictures/canvas.h"
#include "client/pictures/model_drawing.h"
#include "client/pictures/text.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

const Light kGroundTop(0.985f, 0.985f, 0.98f);
const Light kGroundBottom(0.90f, 0.915f, 0.93f);
const Light kRig(0.10f, 0.27f, 0.46f);
const Light kMark(0.62f, 0.11f, 0.13f);
const Light kText(0.22f, 0.25f, 0.29f);

constexpr double kMargin = 0.06;

template <typename... Parts>
absl::Status BadPicture(const Parts&... parts) {
  return InvalidInput("BAD_PICTURE", "picture", absl::StrCat(parts...));
}

absl::Status CheckPicture(const Picture& picture) {
  for (const int size : {picture.width, picture.height}) {
    if (size < 64 || size > 4096) {
      return BadPicture("a picture is 64 to 4096 pixels wide and high, not ",
                        size);
    }
  }
  if (picture.panels.empty() || picture.panels.front().positions.rows() == 0) {
    return BadPicture("there is nothing to draw");
  }
  const PicturePanel& first = picture.panels.front();
  for (const PicturePanel& panel : picture.panels) {
    if (panel.positions.rows() != first.positions.rows()) {
      return BadPicture("one panel shows ", first.positions.rows(),
                        " points, another ", panel.positions.rows());
    }
    DEFORM_RETURN_IF_ERROR(
        CheckPositions(panel.positions, "vertex", "picture"));
    DEFORM_RETURN_IF_ERROR(CheckPositions(panel.rig, "rig vertex", "picture"));
    if (!panel.values.empty() &&
        std::ssize(panel.values) != first.positions.rows()) {
      return BadPicture("a panel has ", panel.values.size(), " values for ",
                        first.positions.rows(), " points");
    }
    if (panel.rig.rows() > 0 && !panel.rig_is_handles) {
      DEFORM_RETURN_IF_ERROR(
          CheckIndices(picture.rig_faces, panel.rig.rows(), "picture"));
    }
  }
  for (const int64_t point : picture.marked) {
    if (point < 0 || point >= first.positions.rows()) {
      return BadPicture("point ", point, " of ", first.positions.rows(),
                        " cannot be marked");
    }
  }
  return CheckIndices(picture.faces, first.positions.rows(), "picture");
}

// One of a picture of the usual size.
double PixelOf(const Picture& picture) {
  return std::min(picture.width, picture.height) / 900.0;
}

std::set<std::pair<int32_t, int32_t>> EdgesOf(const Faces& faces) {
  std::set<std::pair<int32_t, int32_t>> edges;
  const int corners = static_cast<int>(faces.cols());
  for (int64_t f = 0; f < faces.rows(); ++f) {
    for (int k = 0; k < corners; ++k) {
      edges.insert(std::minmax(faces(f, k), faces(f, (k + 1) % corners)));
    }
  }
  return edges;
}

void DrawMarks(const std::vector<int64_t>& marked, const Positions& positions,
               const Camera& camera, double pixel, Canvas& canvas) {
  constexpr double kSlack = 1e-3;
  for (const int64_t point : marked) {
    const Projected at = camera.Project(positions.row(point));
    canvas.Line(at, at, 4.5 * pixel, 0.9f, 0.08f, kSlack);
  }
  canvas.FlushLines(kMark);
}

void DrawRig(const Positions& rig, const Faces& faces, const Camera& camera,
             double pixel, Canvas& canvas) {
  constexpr double kSlack = 1e-3;
  const std::vector<Projected> projected = ProjectAll(camera, rig);
  for (const auto& [a, b] : EdgesOf(faces)) {
    canvas.Line(projected[a], projected[b], 1.5 * pixel, 0.75f, 0.14f, kSlack);
  }
  const double dot = (faces.rows() > 0 ? 4.5 : 8) * pixel;
  for (const Projected& at : projected) {
    canvas.Line(at, at, dot, 0.95f, 0.22f, kSlack);
  }
  canvas.FlushLines(kRig);
}

// Small pictures keep letters that can be read.
double CaptionSize(double pixel) { return std::max(0.95 * pixel, 0.75); }

void DrawCaption(absl::string_view caption, double pixel, Canvas& canvas) {
  DrawText(caption, 16 * pixel, 16 * pixel, CaptionSize(pixel), Align::kLeft,
           canvas);
  canvas.FlushLines(kText);
}

// What the longest caption takes beyond its first line, which fits the margin.
double HeaderOf(const Picture& picture) {
  int64_t lines = 1;
  for (const PicturePanel& panel : picture.panels) {
    lines = std::max<int64_t>(lines, 1 + std::count(panel.caption.begin(),
                                                    panel.caption.end(), '\n'));
  }
  return static_cast<double>(lines - 1) * kTextLine *
         CaptionSize(PixelOf(picture));
}

Image DrawPanel(const Picture& picture, const PicturePanel& panel,
                const Camera& camera) {
  Canvas canvas(picture.width, picture.height);
  canvas.FillBackground(kGroundTop, kGroundBottom);
  const double pixel = PixelOf(picture);
  const Positions& rest = picture.panels.front().positions;
  const Paint paint(picture.scale, panel.values);
  if (picture.faces.rows() == 0) {
    DrawPoints(panel.positions, paint, camera, 4 * pixel, canvas);
  } else if (picture.dimension == 2) {
    if (paint.empty()) {
      DrawChequered(panel.positions, rest, picture.faces, camera, canvas);
    } else {
      DrawBands(panel.positions, picture.faces, paint, camera, canvas);
    }
    DrawOutline(panel.positions, picture.faces, camera, 1.5 * pixel, canvas);
  } else {
    DrawShaded(panel.positions, picture.faces, paint, camera, canvas);
  }
  DrawMarks(picture.marked, panel.positions, camera, pixel, canvas);
  if (panel.rig.rows() > 0) {
    DrawRig(panel.rig, panel.rig_is_handles ? Faces() : picture.rig_faces,
            camera, pixel, canvas);
  }
  DrawCaption(panel.caption, pixel, canvas);
  return canvas.Resolve();
}

}  // namespace

absl::StatusOr<Image> DrawPicture(const Picture& picture) {
  DEFORM_RETURN_IF_ERROR(CheckPicture(picture));
  std::vector<PositionsRef> seen;
  for (const PicturePanel& panel : picture.panels) {
    seen.emplace_back(panel.positions);
    // Handles may lie anywhere; a cage is around the model.
    if (panel.rig.rows() > 0 && !panel.rig_is_handles) {
      seen.emplace_back(panel.rig);
    }
  }
  const double header = HeaderOf(picture);
  const Camera camera =
      picture.dimension == 2
          ? Camera::Flat(seen, picture.width, picture.height, kMargin, header)
          : Camera::Fit(seen, picture.view, picture.width, picture.height,
                        kMargin, header);
  const int count = static_cast<int>(picture.panels.size());
  Image image{picture.width * count, picture.height, {}};
  image.pixels.resize(static_cast<size_t>(image.width) * image.height);
  const auto draw = [&](int k) {
    const Image panel = DrawPanel(picture, picture.panels[k], camera);
    for (int y = 0; y < panel.height; ++y) {
      std::copy_n(&panel.at(0, y), panel.width,
                  &image.at(k * picture.width, y));
    }
  };
  std::vector<std::thread> others;
  for (int k = 1; k < count; ++k) others.emplace_back(draw, k);
  draw(0);
  for (std::thread& other : others) other.join();
  return image;
}

}  // namespace deform
