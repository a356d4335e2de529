// deformd: the server as a program.
#include <signal.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <string>
#include <thread>

#include "server/models/process_memory.h"
#include "server/options.h"
#include "server/server.h"
#include "server/stores/backup.h"

namespace deform::server {
namespace {

constexpr int kBadUsage = 2;
// What a drain may take longer than asked before the process is ended.
constexpr std::chrono::milliseconds kDrainSlack{5000};

// Standard output is for scripts.
void SetUpLogging(const Options& options) {
  auto logger = spdlog::stderr_color_mt("deformd");
  logger->set_level(spdlog::level::from_str(options.log_level));
  logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e %^%l%$ %v");
  spdlog::set_default_logger(std::move(logger));
}

// SIGTERM and SIGINT come to sigwait() in main(), never in between. Threads
// inherit this, so it comes before all others.
sigset_t BlockSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signal(SIGPIPE, SIG_IGN);
  return signals;
}

int WaitFor(const sigset_t& signals) {
  int number = 0;
  sigwait(&signals, &number);
  return number;
}

// Ends the process when asked a second time, or when draining hangs.
void WatchDrain(const sigset_t& signals, std::chrono::milliseconds patience) {
  std::thread([signals] {
    const int number = WaitFor(signals);
    spdlog::warn("asked to stop again: exiting at once");
    _exit(128 + number);
  }).detach();
  std::thread([patience] {
    std::this_thread::sleep_for(patience + kDrainSlack);
    spdlog::error("draining hangs: exiting");
    _exit(1);
  }).detach();
}

int Serve(const Options& options, const sigset_t& signals) {
  auto server = Server::Start(options);
  if (!server.ok()) {
    spdlog::error("{}", std::string(server.status().message()));
    return 1;
  }
  std::printf("listening on %s\n", (*server)->address().c_str());
  std::fflush(stdout);
  const int number = WaitFor(signals);
  const auto patience = options.drain_timeout.milliseconds();
  spdlog::info("{}: draining for at most {} s", strsignal(number),
               options.drain_timeout.value);
  WatchDrain(signals, patience);
  const bool done = (*server)->Drain(patience);
  spdlog::info(done ? "drained" : "drained; cancelled what did not end");
  server->reset();
  return 0;
}

int Main(int argc, char** argv) {
  auto line = ReadCommandLine(argc, argv);
  if (line.ok() && line->exit) {
    return line->exit_code == 0 ? 0 : kBadUsage;
  }
  absl::Status status = line.status();
  if (status.ok()) status = CheckOptions(line->options);
  if (!status.ok()) {
    std::cerr << "deformd: " << status.message() << "\n";
    return kBadUsage;
  }
  if (line->check_only) {
    std::cout << WriteToml(line->options);
    return 0;
  }
  if (!line->restore.empty() && line->options.in_memory) {
    std::cerr << "deformd: --restore makes a data directory, which a server "
                 "with --in-memory does not use\n";
    return kBadUsage;
  }
  if (!line->restore.empty()) {
    const auto left_out = RestoreBackup(PosixFileSystem(), nullptr,
                                        line->restore, line->options.data_dir);
    if (!left_out.ok()) {
      std::cerr << "deformd: " << left_out.status().message() << "\n";
      return 1;
    }
    for (const std::string& file : *left_out) {
      std::cerr << "deformd: " << file
                << " is damaged and was left out: these weights will be "
                   "computed again\n";
    }
  }
  ReturnLargeBlocks();
  const sigset_t signals = BlockSignals();
  SetUpLogging(line->options);
  return Serve(line->options, signals);
}

}  // namespace
}  // namespace deform::server

int main(int argc, char** argv) { return deform::server::Main(argc, argv); }
