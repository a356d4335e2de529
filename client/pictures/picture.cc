#include "client/pictures/picture.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/pictures/canvas.h"
#include "client/pictures/font.h"
#include "client/pictures/normals.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

const Light kGroundTop(0.985f, 0.985f, 0.98f);
const Light kGroundBottom(0.90f, 0.915f, 0.93f);
const Light kModel(0.86f, 0.60f, 0.44f);
const Light kModelInside(0.45f, 0.50f, 0.58f);
const Light kTileA(0.93f, 0.74f, 0.58f);
const Light kTileB(0.86f, 0.60f, 0.44f);
const Light kRig(0.10f, 0.27f, 0.46f);
const Light kText(0.22f, 0.25f, 0.29f);
const Light kOutline(0.42f, 0.26f, 0.17f);

constexpr double kMargin = 0.06;
constexpr double kCreaseDegrees = 50;

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
    if (panel.rig.rows() > 0) {
      DEFORM_RETURN_IF_ERROR(
          CheckIndices(picture.rig_faces, panel.rig.rows(), "picture"));
    }
  }
  return CheckIndices(picture.faces, first.positions.rows(), "picture");
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

// Light on a surface, in the camera's frame: a key light from above left, a
// weak one from the right, sky from above and a soft highlight.
class Lamp {
 public:
  explicit Lamp(const Camera& camera)
      : axes_(camera.axes()),
        key_(Vec3(-0.42, 0.48, 0.77).normalized()),
        fill_(Vec3(0.8, 0.05, 0.5).normalized()) {}

  Light Shade(const Light& color, const Light& inside, const Vec3& world_normal,
              const Vec3& world_to_eye, bool back) const {
    const Vec3 n = axes_ * (back ? Vec3(-world_normal) : world_normal);
    const Vec3 eye = axes_ * world_to_eye;
    const double key = std::max(0.0, n.dot(key_));
    const double fill = std::max(0.0, n.dot(fill_));
    const double sky = 0.5 + 0.5 * n.y();
    const double rim = std::pow(1 - std::clamp(n.dot(eye), 0.0, 1.0), 3);
    const double shine =
        std::pow(std::max(0.0, n.dot((key_ + eye).normalized())), 40);
    const double diffuse = 0.33 + 0.13 * sky + 0.56 * key + 0.22 * fill;
    const double white = 0.16 * shine + 0.10 * rim * sky;
    return static_cast<float>(diffuse) * (back ? inside : color) +
           Light::Constant(static_cast<float>(white));
  }

 private:
  Eigen::Matrix3d axes_;
  Vec3 key_;
  Vec3 fill_;
};

std::vector<Projected> ProjectAll(const Camera& camera,
                                  const Positions& positions) {
  std::vector<Projected> projected(positions.rows());
  for (int64_t i = 0; i < positions.rows(); ++i) {
    projected[i] = camera.Project(positions.row(i));
  }
  return projected;
}

void DrawShaded(const Positions& positions, const Faces& faces,
                const Camera& camera, Canvas& canvas) {
  const std::vector<Projected> projected = ProjectAll(camera, positions);
  const Positions normals = CornerNormals(positions, faces, kCreaseDegrees);
  const Lamp lamp(camera);
  for (int64_t f = 0; f < faces.rows(); ++f) {
    const Projected corners[3] = {
        projected[faces(f, 0)], projected[faces(f, 1)], projected[faces(f, 2)]};
    const Eigen::Matrix3d n = normals.middleRows<3>(3 * f).transpose();
    const Vec3 a = positions.row(faces(f, 0));
    const Vec3 to_eye = camera.ToEye(a);
    // Of the face itself: near its outline a smooth normal may turn away.
    const Vec3 b = positions.row(faces(f, 1));
    const Vec3 c = positions.row(faces(f, 2));
    const bool back = (b - a).cross(c - a).dot(to_eye) < 0;
    canvas.Triangle(corners, [&](const Eigen::Vector3f& place) {
      const Vec3 normal = (n * place.cast<double>()).normalized();
      return lamp.Shade(kModel, kModelInside, normal, to_eye, back);
    });
  }
  canvas.ShadeGrooves(0.018 * canvas.width(), 0.5f);
}

// Tiles of the size of a 16th of the rest model, by where a sample was at rest.
void DrawChequered(const Positions& positions, const Positions& rest,
                   const Faces& faces, const Camera& camera, Canvas& canvas) {
  const std::vector<Projected> projected = ProjectAll(camera, positions);
  const Box box = BoxOf(rest);
  const double tile = std::max((box.max - box.min).maxCoeff() / 16, 1e-300);
  for (int64_t f = 0; f < faces.rows(); ++f) {
    const Projected corners[3] = {
        projected[faces(f, 0)], projected[faces(f, 1)], projected[faces(f, 2)]};
    Eigen::Matrix3d at;
    for (int k = 0; k < 3; ++k) {
      at.col(k) = (rest.row(faces(f, k)).transpose() - box.min) / tile;
    }
    canvas.Triangle(corners, [&](const Eigen::Vector3f& place) {
      const Vec3 where = at * place.cast<double>();
      const auto sum = static_cast<int64_t>(std::floor(where.x() + 1e-9) +
                                            std::floor(where.y() + 1e-9));
      return sum % 2 == 0 ? kTileA : kTileB;
    });
  }
}

// The outline of a flat model: edges of one triangle only.
void DrawOutline(const Positions& positions, const Faces& faces,
                 const Camera& camera, double width, Canvas& canvas) {
  std::multiset<std::pair<int32_t, int32_t>> edges;
  for (int64_t f = 0; f < faces.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      edges.insert(std::minmax(faces(f, k), faces(f, (k + 1) % 3)));
    }
  }
  for (const auto& [a, b] : edges) {
    if (edges.count({a, b}) != 1) continue;
    canvas.Line(camera.Project(positions.row(a)),
                camera.Project(positions.row(b)), width, 0.9f, 0.9f, 0);
  }
  canvas.FlushLines(kOutline);
}

void DrawPoints(const Positions& positions, const Camera& camera, double width,
                const Light& color, float hidden, Canvas& canvas) {
  for (int64_t i = 0; i < positions.rows(); ++i) {
    const Projected at = camera.Project(positions.row(i));
    canvas.Line(at, at, width, 1, hidden, 0);
  }
  canvas.FlushLines(color);
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

void DrawCaption(absl::string_view caption, double pixel, Canvas& canvas) {
  const double dot = 1.9 * pixel;
  const double left = 16 * pixel;
  const double top = 16 * pixel;
  for (const Stroke& stroke : TextStrokes(caption)) {
    canvas.Line({left + dot * stroke.x0, top + dot * stroke.y0, 1},
                {left + dot * stroke.x1, top + dot * stroke.y1, 1}, 1.05 * dot,
                1, 1, 0);
  }
  canvas.FlushLines(kText);
}

Image DrawPanel(const Picture& picture, const PicturePanel& panel,
                const Camera& camera) {
  Canvas canvas(picture.width, picture.height);
  canvas.FillBackground(kGroundTop, kGroundBottom);
  const double pixel = std::min(picture.width, picture.height) / 900.0;
  const Positions& rest = picture.panels.front().positions;
  if (picture.faces.rows() == 0) {
    DrawPoints(panel.positions, camera, 3.5 * pixel, kModel, 0.6f, canvas);
  } else if (picture.dimension == 2) {
    DrawChequered(panel.positions, rest, picture.faces, camera, canvas);
    DrawOutline(panel.positions, picture.faces, camera, 1.5 * pixel, canvas);
  } else {
    DrawShaded(panel.positions, picture.faces, camera, canvas);
  }
  if (panel.rig.rows() > 0) {
    DrawRig(panel.rig, picture.rig_faces, camera, pixel, canvas);
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
    if (panel.rig.rows() > 0) seen.emplace_back(panel.rig);
  }
  const Camera camera =
      picture.dimension == 2
          ? Camera::Flat(seen, picture.width, picture.height, kMargin)
          : Camera::Fit(seen, picture.view, picture.width, picture.height,
                        kMargin);
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
