// deformctl: the command line of deformd.
#include <unistd.h>

#include <csignal>
#include <iostream>

#include "client/cli/app.h"

namespace {

deform::cli::Interruption interruption;

// The first Ctrl-C lets a command that expects it tidy up; otherwise, and the
// second time, it ends the program.
void Interrupt(int signal) {
  std::signal(signal, SIG_DFL);
  if (interruption.expected) {
    interruption.requested = true;
  } else {
    std::raise(signal);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, Interrupt);
  std::signal(SIGTERM, Interrupt);
  return deform::cli::RunDeformctl(
      {argv + 1, argv + argc},
      {std::cout, std::cerr, isatty(STDERR_FILENO) != 0, interruption});
}
