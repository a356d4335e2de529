#pragma once

#include <memory>

#include "core/mesh/cage.h"
#include "core/weights/scheme.h"
#include "core/weights/schemes/lane_evaluator.h"

namespace deform {

std::unique_ptr<const LaneEvaluator> MakeMeanValueEvaluator(const Cage& cage,
                                                            Way way);

}  // namespace deform
