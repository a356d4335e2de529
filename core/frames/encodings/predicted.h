// Encoding "predicted": a grid, block by block, as what it differs from a
// linear prediction. Bit by bit; all numbers are little-endian and, if they can
// be negative, two's complement.
//
// A chunk is its blocks, behind each other: 256 points each, in the order of
// the frame's PointOrder, the last block of a frame what is left. A block of n
// points begins with
//
//   1 byte   shift, 0 to 31
//
// Then, for each of the `dimension` coordinates d:
//
//   1 byte   bits 0-1: G, bytes of a gradient: 0, 1 or 2
//            bits 2-3: bytes of the offset: 0, 1, 2 or 4, told as 0, 1, 2, 3
//            bits 4-7: 0
//   1 byte   fraction, 0 to 31; only if G > 0
//   0-4      offset; 0 if it has no bytes
//   G each   `dimension` gradients; 0 if they have no bytes
//   1 byte   for each group of 64 points of the block (the last what is left):
//            B, the bits of a residual, 0 to 32
//   8 B      for each group: B planes of 8 bytes, the lowest bits first. Bit i
//            of plane k (bit i % 8 of its byte i / 8) is bit k of the residual
//            of the group's point i. Bits of points beyond n say nothing.
//
// A residual is folded: 0, 1, 2, 3, 4 ... stand for 0, -1, 1, -2, 2 ...
// (r = (f >> 1) ^ -(f & 1)). With a_k(i) the places of the block's points in
// the reference, all 0 if there is none,
//
//   q_d(i) = a_d(i) + offset + (s >> fraction) + r_d(i)
//   s = sum over k of gradient_k ((a_k(i) - a_k(0)) >> shift)
//       + ((1 << fraction) >> 1)
//
// in 32 bits modulo 2^32, >> on signed numbers rounding down ((1 << fraction)
// >> 1 is 0 for fraction 0). The position is float(q * step), see grid.h.
#pragma once

#include "core/frames/encoding.h"

namespace deform {

const FrameEncoding& PredictedEncoding();

}  // namespace deform
