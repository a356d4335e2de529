// The measurements. Each appends its rows, and prints them as they come.
#pragma once

#include <functional>

#include "tests/bench/report.h"

namespace deform::bench {

using AddRow = std::function<void(Row)>;

// The memory's read speed: what no kernel that reads its weights can pass.
struct ReadLimit {
  double one_core = 0;  // Bytes a second, the best number of walks.
  double all_cores = 0;
};
ReadLimit MeasureMemory(const Settings& settings, const AddRow& add);

// Computing weights, per point and face or per point, on one core.
void MeasureWeightRows(const Settings& settings, const AddRow& add);

// Deforming: dense, by parts, compressed, many sessions at once, and as others
// do it.
void MeasureDeforming(const Settings& settings, const ReadLimit& limit,
                      const AddRow& add);

// Steps a second of many sessions of one binding, through the scheduler.
void MeasureSessions(const Settings& settings, const AddRow& add);

}  // namespace deform::bench
