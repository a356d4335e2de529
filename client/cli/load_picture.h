// A load run as a picture.
#pragma once

#include "client/load/load_run.h"
#include "client/pictures/image.h"

namespace deform::cli {

// Percentiles of the latency over time, and below how often each latency came;
// then the server's memory and open files over time, if it told them.
Image DrawLoad(const LoadReport& report);

}  // namespace deform::cli
