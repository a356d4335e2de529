// The program itself, as a process. Whoever includes this is compiled with
// DEFORM_BINARY_DIR.
#pragma once

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

namespace deform {

// Runs deformd; its output can be read. Kills what still runs at the end.
class Process {
 public:
  explicit Process(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), DEFORM_BINARY_DIR "/bin/deformd");
    int out[2];
    int err[2];
    if (pipe2(out, O_CLOEXEC) != 0 || pipe2(err, O_CLOEXEC) != 0) abort();
    pid_ = fork();
    if (pid_ == 0) {
      dup2(out[1], STDOUT_FILENO);
      dup2(err[1], STDERR_FILENO);
      std::vector<char*> argv;
      for (std::string& argument : arguments) argv.push_back(argument.data());
      argv.push_back(nullptr);
      execv(argv[0], argv.data());
      _exit(127);
    }
    close(out[1]);
    close(err[1]);
    out_ = fdopen(out[0], "r");
    err_ = fdopen(err[0], "r");
  }
  ~Process() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    fclose(out_);
    fclose(err_);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  std::string ReadLine() {
    char line[1000] = "";
    if (fgets(line, sizeof(line), out_) == nullptr) return "";
    return line;
  }
  std::string ReadAll() { return ReadAll(out_); }
  std::string ReadErrors() { return ReadAll(err_); }
  void Signal(int number) { kill(pid_, number); }
  // 128 + the signal if one ended it.
  int Wait() {
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  static std::string ReadAll(FILE* file) {
    std::string all;
    for (int c; (c = fgetc(file)) != EOF;) all += static_cast<char>(c);
    return all;
  }

  pid_t pid_ = -1;
  FILE* out_ = nullptr;
  FILE* err_ = nullptr;
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
