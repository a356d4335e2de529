// What is claimed of speed, held against what was measured.
#pragma once

#include <vector>

#include "tests/bench/report.h"

namespace deform::bench {

// Prints the ratios that these rows allow to form, with what is wanted of them.
// Ratios hold where the rows come from one run on one machine.
void PrintGoals(const std::vector<Row>& rows);

}  // namespace deform::bench
