#include "server/rpc/process_usage.h"

#include <dirent.h>
#include <time.h>
#include <unistd.h>

#include <cstdio>

namespace deform::server {

namespace {

int CountOpenFiles() {
  DIR* const files = opendir("/proc/self/fd");
  if (files == nullptr) return 0;
  int count = 0;
  while (const dirent* const file = readdir(files)) {
    if (file->d_name[0] != '.') ++count;
  }
  closedir(files);
  return count - 1;  // Without the one that lists them.
}

}  // namespace

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
  usage.open_files = CountOpenFiles();
  return usage;
}

}  // namespace deform::server
