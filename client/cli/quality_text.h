// Quality reports, as JSON and for people.
#pragma once

#include <ostream>
#include <string>

#include "client/cli/console.h"
#include "client/cpp/info.h"

namespace deform::cli {

Json ToJson(const QualityInfo& quality);
void Describe(const QualityInfo& quality, std::ostream& out);

// "median 1.02, p99 1.3, max 1.9".
std::string DistortionText(const PoseQuality& pose);

// By how much the volume changed, "-1.25 %"; empty if there is none.
std::string VolumeChangeText(const PoseQuality& pose);

// "closed mesh", "mesh with its holes closed", "area of the triangles"; empty
// if there is no volume.
std::string VolumeKindText(VolumeKind kind);

}  // namespace deform::cli
