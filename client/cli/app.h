// deformctl, as a function.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "client/cli/interruption.h"

namespace deform::cli {

struct Terminal {
  std::ostream& out;
  std::ostream& err;
  bool err_is_terminal = false;
  Interruption& interruption;
};

// Runs `arguments` (without the program's name) and returns the exit code; see
// exit_code.h. Reads DEFORM_SERVER and DEFORM_TENANT from the environment.
int RunDeformctl(std::vector<std::string> arguments, const Terminal& terminal);

}  // namespace deform::cli
