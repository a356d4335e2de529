// Encoding "quantized16": places in the box of a chunk's vertices, 16 bits a
// coordinate. Stateless. Bit by bit, all little-endian:
//
//   for each of the `dimension` coordinates:
//     float64  min, relative to the frame's origin
//     float64  step, not negative
//   for each vertex, for each of its coordinates:
//     uint16   u: the coordinate is float(min + u * step), in double
//
// step is the box's side / 65535, so a coordinate is off by half a step and two
// roundings to float. Where that exceeds the tolerance, TOLERANCE_NOT_MET.
#pragma once

#include "core/frames/encoding.h"

namespace deform {

const FrameEncoding& Quantized16Encoding();

}  // namespace deform
