#include "client/pictures/model_drawing.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <set>
#include <utility>

#include "client/pictures/normals.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

const Light kModel(0.86f, 0.60f, 0.44f);
const Light kModelInside(0.45f, 0.50f, 0.58f);
const Light kTileA(0.93f, 0.74f, 0.58f);
const Light kTileB(0.86f, 0.60f, 0.44f);
const Light kOutline(0.42f, 0.26f, 0.17f);
const Light kUnknown(0.62f, 0.63f, 0.65f);
constexpr double kCreaseDegrees = 50;

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

// Points of one colour at a time: a layer of lines has one.
void DrawPaintedPoints(const Positions& positions, const Paint& paint,
                       const Camera& camera, double width, Canvas& canvas) {
  constexpr int kColors = 24;
  for (int color = -1; color < kColors; ++color) {
    bool any = false;
    for (int64_t i = 0; i < positions.rows(); ++i) {
      const double place = paint.PlaceOf(i);
      const int mine =
          std::isnan(place)
              ? -1
              : std::min(static_cast<int>(place * kColors), kColors - 1);
      if (mine != color) continue;
      const Projected at = camera.Project(positions.row(i));
      canvas.Line(at, at, width, 1, 1, 0);
      any = true;
    }
    if (any) {
      canvas.FlushLines(color < 0 ? kUnknown
                                  : paint.ColorOf((color + 0.5) / kColors));
    }
  }
}

}  // namespace

Light Paint::ColorOf(double place) const {
  return std::isnan(place) ? kUnknown : ColorAt(map_, place);
}

std::vector<Projected> ProjectAll(const Camera& camera,
                                  const Positions& positions) {
  std::vector<Projected> projected(positions.rows());
  for (int64_t i = 0; i < positions.rows(); ++i) {
    projected[i] = camera.Project(positions.row(i));
  }
  return projected;
}

void DrawShaded(const Positions& positions, const Faces& faces,
                const Paint& paint, const Camera& camera, Canvas& canvas) {
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
      if (paint.empty()) {
        return lamp.Shade(kModel, kModelInside, normal, to_eye, back);
      }
      const Light color = paint.ColorOf(paint.PlaceOf(faces, f, place));
      return lamp.Shade(color, 0.6f * color, normal, to_eye, back);
    });
  }
  canvas.ShadeGrooves(0.018 * canvas.width(), 0.5f);
}

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

void DrawBands(const Positions& positions, const Faces& faces,
               const Paint& paint, const Camera& camera, Canvas& canvas) {
  constexpr int kBands = 20;
  const std::vector<Projected> projected = ProjectAll(camera, positions);
  for (int64_t f = 0; f < faces.rows(); ++f) {
    const Projected corners[3] = {
        projected[faces(f, 0)], projected[faces(f, 1)], projected[faces(f, 2)]};
    canvas.Triangle(corners, [&](const Eigen::Vector3f& at) {
      const double place = paint.PlaceOf(faces, f, at);
      const Light color = paint.ColorOf(place);
      if (std::isnan(place)) return color;
      const bool odd = static_cast<int>(place * kBands) % 2 != 0;
      return odd ? Light(0.9f * color) : color;
    });
  }
}

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

void DrawPoints(const Positions& positions, const Paint& paint,
                const Camera& camera, double width, Canvas& canvas) {
  if (!paint.empty()) {
    DrawPaintedPoints(positions, paint, camera, width, canvas);
    return;
  }
  for (int64_t i = 0; i < positions.rows(); ++i) {
    const Projected at = camera.Project(positions.row(i));
    canvas.Line(at, at, width, 1, 0.6f, 0);
  }
  canvas.FlushLines(kModel);
}

}  // namespace deform
