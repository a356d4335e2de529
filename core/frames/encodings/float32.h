// Encoding "float32": little-endian float32, `dimension` per vertex, relative
// to the frame's origin.
#pragma once

#include "core/frames/encoding.h"

namespace deform {

const FrameEncoding& Float32Encoding();

}  // namespace deform
