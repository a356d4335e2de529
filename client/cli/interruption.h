// Ctrl-C.
#pragma once

#include <atomic>

namespace deform::cli {

// Shared with a signal handler.
struct Interruption {
  // Set by a command that ends soon after `requested` and has something to tidy
  // up. Without it Ctrl-C ends the program at once, and the server notices.
  std::atomic<bool> expected = false;
  std::atomic<bool> requested = false;
};

}  // namespace deform::cli
