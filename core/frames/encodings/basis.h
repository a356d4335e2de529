// Encoding "basis": what basis_payload.h says, for receivers that hold the
// binding's LeafBasis and multiply by themselves. Some kilobytes a frame; the
// receiver pays with a sum of few terms a point, and needs no rig. Only where
// weights are compressed.
#pragma once

#include "core/frames/encoding.h"

namespace deform {

const FrameEncoding& BasisEncoding();

}  // namespace deform
