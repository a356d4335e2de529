#include "client/pictures/canvas.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace deform {
namespace {

Color ToColor(const Light& light) {
  const Light scaled = light.cwiseMax(0.f).cwiseMin(1.f) * 255.f;
  return {static_cast<uint8_t>(std::lround(scaled.x())),
          static_cast<uint8_t>(std::lround(scaled.y())),
          static_cast<uint8_t>(std::lround(scaled.z()))};
}

// First sample whose middle lies at or right of `position`, within [0, count].
int FirstSample(double position, int count) {
  return static_cast<int>(
      std::clamp(std::ceil(position - 0.5), 0.0, static_cast<double>(count)));
}

}  // namespace

Canvas::Canvas(int width, int height)
    : width_(width),
      height_(height),
      columns_(width * kSamples),
      rows_(height * kSamples),
      colors_(static_cast<size_t>(columns_) * rows_, Color{255, 255, 255}),
      depth_(colors_.size(), std::numeric_limits<float>::infinity()),
      lines_(colors_.size(), 0) {}

void Canvas::FillBackground(const Light& top, const Light& bottom) {
  for (int y = 0; y < rows_; ++y) {
    const float t = static_cast<float>(y) / static_cast<float>(rows_);
    std::fill_n(colors_.begin() + At(0, y), columns_,
                ToColor((1 - t) * top + t * bottom));
  }
}

void Canvas::Triangle(const Projected corners[3],
                      absl::FunctionRef<Light(const Eigen::Vector3f&)> shade) {
  double x[3], y[3], inverse[3];
  for (int k = 0; k < 3; ++k) {
    x[k] = corners[k].x * kSamples;
    y[k] = corners[k].y * kSamples;
    inverse[k] = 1 / corners[k].depth;
  }
  const double area =
      (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
  if (!(std::abs(area) > 0)) return;
  const int left = FirstSample(std::min({x[0], x[1], x[2]}), columns_);
  const int right = FirstSample(std::max({x[0], x[1], x[2]}), columns_);
  const int top = FirstSample(std::min({y[0], y[1], y[2]}), rows_);
  const int bottom = FirstSample(std::max({y[0], y[1], y[2]}), rows_);
  for (int row = top; row < bottom; ++row) {
    for (int column = left; column < right; ++column) {
      const double px = column + 0.5;
      const double py = row + 0.5;
      const double b1 =
          ((px - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (py - y[0])) / area;
      const double b2 =
          ((x[1] - x[0]) * (py - y[0]) - (px - x[0]) * (y[1] - y[0])) / area;
      const double b0 = 1 - b1 - b2;
      if (b0 < 0 || b1 < 0 || b2 < 0) continue;
      const double depth =
          1 / (b0 * inverse[0] + b1 * inverse[1] + b2 * inverse[2]);
      const int64_t at = At(column, row);
      if (!(depth < depth_[at])) continue;
      depth_[at] = static_cast<float>(depth);
      const Eigen::Vector3d true_place =
          depth *
          Eigen::Vector3d(b0 * inverse[0], b1 * inverse[1], b2 * inverse[2]);
      colors_[at] = ToColor(shade(true_place.cast<float>()));
    }
  }
}

void Canvas::ShadeGrooves(double radius, float strength) {
  // Opposite neighbours are taken together: on a plane, however tilted, one is
  // nearer by as much as the other is farther.
  constexpr int kPairs = 6;
  float nearest = std::numeric_limits<float>::infinity();
  float farthest = 0;
  for (const float depth : depth_) {
    if (std::isinf(depth)) continue;
    nearest = std::min(nearest, depth);
    farthest = std::max(farthest, depth);
  }
  const float range = 0.12f * (farthest - nearest);
  if (!(range > 0)) return;
  std::vector<Color> shaded = colors_;
  for (int y = 0; y < rows_; ++y) {
    for (int x = 0; x < columns_; ++x) {
      const float here = depth_[At(x, y)];
      if (std::isinf(here)) continue;
      const auto rise = [&](int dx, int dy) {
        const int nx = x + dx;
        const int ny = y + dy;
        if (nx < 0 || ny < 0 || nx >= columns_ || ny >= rows_) return 0.f;
        const float there = depth_[At(nx, ny)];
        if (std::isinf(there)) return -range;
        return std::clamp(here - there, -range, range);
      };
      float groove = 0;
      for (int pair = 0; pair < kPairs; ++pair) {
        // Directions turn from sample to sample; averaging over a pixel's
        // samples then covers the disc.
        const double turn = (pair + ((x * 5 + y * 3) % 9) / 9.0) / kPairs;
        const double angle = turn * 3.14159265358979;
        const double reach =
            kSamples * radius * (0.25 + 0.75 * (pair + 1) / kPairs);
        const int dx = static_cast<int>(std::lround(reach * std::cos(angle)));
        const int dy = static_cast<int>(std::lround(reach * std::sin(angle)));
        groove += std::max(0.f, rise(dx, dy) + rise(-dx, -dy));
      }
      const float dark =
          std::min(1.f, 2.5f * groove / (kPairs * range)) * strength;
      shaded[At(x, y)] = ToColor(ToLight(colors_[At(x, y)]) * (1 - dark));
    }
  }
  colors_ = std::move(shaded);
}

void Canvas::Line(const Projected& from, const Projected& to, double width,
                  float alpha, float hidden_alpha, double slack) {
  const Eigen::Vector2d a(from.x * kSamples, from.y * kSamples);
  const Eigen::Vector2d b(to.x * kSamples, to.y * kSamples);
  const Eigen::Vector2d along = b - a;
  const double radius = 0.5 * width * kSamples;
  const double length2 = along.squaredNorm();
  // Walks along the longer axis; across it, only the samples near the line.
  const bool flat = std::abs(along.x()) >= std::abs(along.y());
  const int main = flat ? 0 : 1;
  const double slope = along[main] != 0 ? along[1 - main] / along[main] : 0;
  const double half = radius * std::sqrt(1 + slope * slope);
  const int begin =
      FirstSample(std::min(a[main], b[main]) - radius, flat ? columns_ : rows_);
  const int end =
      FirstSample(std::max(a[main], b[main]) + radius, flat ? columns_ : rows_);
  for (int m = begin; m < end; ++m) {
    const double reached = std::clamp(m + 0.5, std::min(a[main], b[main]),
                                      std::max(a[main], b[main]));
    const double middle = a[1 - main] + slope * (reached - a[main]);
    const int low = FirstSample(middle - half, flat ? rows_ : columns_);
    const int high = FirstSample(middle + half, flat ? rows_ : columns_);
    for (int c = low; c < high; ++c) {
      Eigen::Vector2d p;
      p[main] = m + 0.5;
      p[1 - main] = c + 0.5;
      const double t =
          length2 > 0 ? std::clamp((p - a).dot(along) / length2, 0.0, 1.0) : 0;
      if ((p - a - t * along).squaredNorm() > radius * radius) continue;
      const double depth = 1 / ((1 - t) / from.depth + t / to.depth);
      const int64_t at = flat ? At(m, c) : At(c, m);
      const float opacity = depth <= depth_[at] + slack ? alpha : hidden_alpha;
      lines_[at] = std::max(lines_[at],
                            static_cast<uint8_t>(std::lround(255 * opacity)));
    }
  }
}

void Canvas::FlushLines(const Light& color) {
  for (size_t i = 0; i < lines_.size(); ++i) {
    if (lines_[i] == 0) continue;
    const float alpha = static_cast<float>(lines_[i]) / 255.f;
    colors_[i] = ToColor((1 - alpha) * ToLight(colors_[i]) + alpha * color);
    lines_[i] = 0;
  }
}

Image Canvas::Resolve() const {
  Image image{width_, height_,
              std::vector<Color>(static_cast<size_t>(width_) * height_)};
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      Light sum = Light::Zero();
      for (int sy = 0; sy < kSamples; ++sy) {
        for (int sx = 0; sx < kSamples; ++sx) {
          sum += ToLight(colors_[At(x * kSamples + sx, y * kSamples + sy)]);
        }
      }
      image.at(x, y) = ToColor(sum / float{kSamples * kSamples});
    }
  }
  return image;
}

}  // namespace deform
