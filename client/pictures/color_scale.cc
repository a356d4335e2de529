#include "client/pictures/color_scale.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_format.h"

namespace deform {
namespace {

// Colours at equal steps. The first after "viridis" (Smith and van der Walt),
// the second after Moreland, "Diverging Color Maps for Scientific
// Visualization", 2009.
constexpr std::array<Color, 10> kViridis = {{{68, 1, 84},
                                             {72, 40, 120},
                                             {62, 74, 137},
                                             {49, 104, 142},
                                             {38, 130, 142},
                                             {31, 158, 137},
                                             {53, 183, 121},
                                             {109, 205, 89},
                                             {180, 222, 44},
                                             {253, 231, 37}}};
constexpr std::array<Color, 9> kCoolWarm = {{{59, 76, 192},
                                             {98, 130, 234},
                                             {141, 176, 254},
                                             {184, 208, 249},
                                             {228, 228, 228},
                                             {245, 196, 173},
                                             {244, 154, 123},
                                             {222, 96, 77},
                                             {180, 4, 38}}};

template <size_t n>
Light Interpolate(const std::array<Color, n>& colors, double place) {
  const double at = place * (n - 1);
  const size_t k = std::min(static_cast<size_t>(at), n - 2);
  const auto t = static_cast<float>(at - static_cast<double>(k));
  return (1 - t) * ToLight(colors[k]) + t * ToLight(colors[k + 1]);
}

// The largest of 1, 2 and 5 times a power of ten that is not above `step`.
double RoundStep(double step) {
  const double power = std::pow(10, std::floor(std::log10(step)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * power <= step * (1 + 1e-9)) return factor * power;
  }
  return power;
}

}  // namespace

Light ColorAt(ColorMap map, double place) {
  const double clamped = std::clamp(place, 0.0, 1.0);
  return map == ColorMap::kSequential ? Interpolate(kViridis, clamped)
                                      : Interpolate(kCoolWarm, clamped);
}

double ColorScale::PlaceOf(double value) const {
  if (std::isnan(value)) return value;
  const double place =
      logarithmic ? std::log(std::max(value, low) / low) / std::log(high / low)
                  : (value - low) / (high - low);
  return std::clamp(place, 0.0, 1.0);
}

std::vector<double> RoundTicks(double low, double high, bool logarithmic,
                               int count) {
  std::vector<double> ticks;
  // Within less than a decade round numbers lie better evenly.
  if (!logarithmic || high < 5 * low) {
    // The next larger step, so that there are no more than asked for.
    const double step = RoundStep(2.5 * (high - low) / count);
    for (double i = std::ceil(low / step - 1e-9);
         i * step <= high + 1e-9 * step; ++i) {
      ticks.push_back(i * step);
    }
    return ticks;
  }
  const double first = std::floor(std::log10(low) + 1e-9);
  const double last = std::ceil(std::log10(high) - 1e-9);
  const double decades = std::log10(high / low);
  const bool few = 2 * decades < count;
  const double skip = std::max(1.0, std::ceil(decades / count - 1e-9));
  for (double power = first; power <= last; power += skip) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double tick = factor * std::pow(10, power);
      if ((factor > 1 && !few) || tick < low * (1 - 1e-9) ||
          tick > high * (1 + 1e-9)) {
        continue;
      }
      ticks.push_back(tick);
    }
  }
  return ticks;
}

std::string NumberText(double value) {
  if (value == 0) return "0";
  const double size = std::abs(value);
  if (size >= 1e-3 && size < 1e5) return absl::StrFormat("%.4g", value);
  const double power = std::floor(std::log10(size) + 1e-9);
  return absl::StrFormat("%.3ge%d", value / std::pow(10, power),
                         static_cast<int>(power));
}

}  // namespace deform
