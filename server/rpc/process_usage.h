// What this process costs its machine.
#pragma once

#include <cstdint>

namespace deform::server {

struct ProcessUsage {
  double cpu_seconds = 0;  // All threads, user and system.
  int64_t resident_bytes = 0;
  int open_files = 0;
};

// Microseconds. A figure that the system does not tell is 0.
ProcessUsage ReadProcessUsage();

}  // namespace deform::server
