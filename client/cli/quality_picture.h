// Pictures of what a pose does to a model.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/cpp/info.h"
#include "client/pictures/chart.h"
#include "client/pictures/color_scale.h"
#include "core/mesh/types.h"

namespace deform::cli {

// From 1 to the largest distortion, or to 1000.
ColorScale DistortionScale(double largest);
// Around 1: half as much is as far from it as twice as much.
ColorScale VolumeScale(double smallest, double largest);
// From the smallest to the largest of `values`, or from 0 if they are above.
ColorScale LinearScale(const std::vector<double>& values, std::string title);

// As many points as a server measures.
inline constexpr int64_t kMostMeasuredPoints = 1000000;

// One value for each of `count` points, NaN where nothing was measured.
std::vector<double> DistortionOf(const PoseQuality& pose, int64_t count);
std::vector<double> VolumeChangeOf(const PoseQuality& pose, int64_t count);

// How far each point went.
std::vector<double> DisplacementOf(const Positions& rest,
                                   const Positions& deformed);

// Share of the points in bins over the scale, in its colours.
Chart ValueChart(const std::vector<double>& values, const ColorScale& scale);

}  // namespace deform::cli
