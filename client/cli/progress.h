// Progress of long work, on the error stream.
#pragma once

#include <chrono>
#include <string>

#include "client/cli/console.h"
#include "client/cli/interruption.h"
#include "client/cpp/client.h"

namespace deform::cli {

// On a terminal, a bar that is redrawn, once half a second has passed, and
// cleared at the end; elsewhere a line every five seconds.
class Progress {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  // `label`: "uploading". `interruption`, which may be null, ends what is
  // watched through callback(). `now` is the time; tests pass their own.
  Progress(Console& console, std::string label,
           const Interruption* interruption,
           Clock now = std::chrono::steady_clock::now);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void Show(int64_t done, int64_t total);
  // Show() as a function; this object must outlive it.
  ProgressCallback callback();

 private:
  Console& console_;
  const std::string label_;
  const Interruption* const interruption_;
  const Clock now_;
  const std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point next_;
  bool drawn_ = false;
};

}  // namespace deform::cli
