// Encoding "pose": what pose_payload.h says, for receivers that hold the
// weights of the binding and deform by themselves. A handful of bytes, whatever
// the model; the receiver pays with the deforming.
#pragma once

#include "core/frames/encoding.h"

namespace deform {

const FrameEncoding& PoseEncoding();

}  // namespace deform
