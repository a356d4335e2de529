// The program itself, as a process. Whoever includes this is compiled with
// DEFORM_BINARY_DIR.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "tests/support/child_process.h"

namespace deform {

// Runs deformd.
class Process : public ChildProcess {
 public:
  explicit Process(std::vector<std::string> arguments)
      : ChildProcess(WithProgram(std::move(arguments))) {}

 private:
  static std::vector<std::string> WithProgram(
      std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), DEFORM_BINARY_DIR "/bin/deformd");
    return arguments;
  }
};

// A deformd that listens; it keeps nothing, unless `more` says so.
class Daemon : public Process {
 public:
  explicit Daemon(std::vector<std::string> more = {"--in-memory"})
      : Process(With(std::move(more))) {
    const std::string line = ReadLine();
    EXPECT_THAT(line, testing::StartsWith("listening on 127.0.0.1:"));
    address_ = line.substr(13, line.size() - 14);
  }
  const std::string& address() const { return address_; }

 private:
  static std::vector<std::string> With(std::vector<std::string> more) {
    more.insert(more.end(), {"--listen", "127.0.0.1:0", "--log-level", "warn"});
    return more;
  }
  std::string address_;
};

}  // namespace deform
