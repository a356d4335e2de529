#include "server/rpc/process_usage.h"

#include <time.h>
#include <unistd.h>

#include <cstdio>

namespace deform::server {

ProcessUsage ReadProcessUsage() {
  ProcessUsage usage;
  timespec time{};
  if (clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time) == 0) {
    usage.cpu_seconds = static_cast<double>(time.tv_sec) +
                        1e-9 * static_cast<double>(time.tv_nsec);
  }
  // Pages: the whole size, then what is resident.
  if (std::FILE* const file = std::fopen("/proc/self/statm", "r")) {
    long long pages = 0;
    if (std::fscanf(file, "%*d %lld", &pages) == 1) {
      usage.resident_bytes = pages * sysconf(_SC_PAGESIZE);
    }
    std::fclose(file);
  }
  return usage;
}

}  // namespace deform::server
