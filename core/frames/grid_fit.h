// The best linear prediction of a block of a grid from a reference.
#pragma once

#include "core/kernels/grid_blocks.h"

namespace deform {

// How a block moved, coordinate by coordinate. All have the same shift.
struct BlockFit {
  GridPrediction of[3];
  // Bytes that each gradient of a coordinate takes, 0 if none is worth it.
  int gradient_bytes[3] = {};
};

// Least squares over the block: points that are close move alike, by a
// translation and the derivative of the map. Gradients get as many bytes as
// keep the prediction within about half a step. Both blocks hold integers of
// at most kGridLimit; the result is the same on every instruction set.
BlockFit FitBlock(const GridBlock& reference, const GridBlock& grid);

}  // namespace deform
