// Runs deformctl within the test.
#pragma once

#include <sstream>
#include <string>
#include <vector>

#include "client/cli/app.h"
#include "client/cli/console.h"

namespace deform::cli {

struct CliResult {
  int exit_code = 0;
  std::string out;
  std::string err;
  Json json() const { return Json::parse(out); }
};

inline CliResult RunCli(const std::vector<std::string>& arguments) {
  std::ostringstream out;
  std::ostringstream err;
  Interruption interruption;
  CliResult result;
  result.exit_code = RunDeformctl(arguments, {out, err, false, interruption});
  result.out = out.str();
  result.err = err.str();
  return result;
}

}  // namespace deform::cli
