// Configuration: flags and a TOML file with the same names.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace deform::server {

// Written "512 MiB", "2GiB" or as a plain number.
struct Bytes {
  int64_t value = 0;
};

// Written as a number of seconds.
struct Seconds {
  double value = 0;
  std::chrono::milliseconds milliseconds() const {
    return std::chrono::milliseconds(static_cast<int64_t>(value * 1000));
  }
};

// 0, or a fraction between the finest and the coarsest that the server takes.
struct Tolerance {
  double value = 0;
};

// What each means is said once, in options.cc, for --help and the file alike.
struct Options {
  std::string listen = "127.0.0.1:7777";
  std::string data_dir = "deformd-data";
  bool in_memory = false;
  std::string log_level = "info";

  int compute_threads = 0;
  int max_call_threads = 64;

  Bytes max_model_bytes{int64_t{1} << 30};
  Bytes max_models_memory{int64_t{4} << 30};
  int64_t max_models = 10'000;

  Bytes max_bindings_memory{int64_t{8} << 30};
  int64_t max_bindings = 10'000;
  int max_concurrent_binds = 2;
  int max_waiting_binds = 32;
  Tolerance weight_tolerance{1e-5};

  Bytes max_sessions_memory{int64_t{4} << 30};
  Bytes max_drags_memory{int64_t{256} << 20};
  int64_t max_sessions = 1'000;
  int max_participants = 64;
  int64_t max_backups = 16;

  Seconds stall_timeout{10};
  Seconds resume_grace{60};
  Seconds drain_timeout{10};
};

// What the command line asks for.
struct CommandLine {
  Options options;
  std::string restore;      // --restore: a backup to be restored first.
  bool check_only = false;  // --config-check: print and exit.
  // Set if there is nothing to run: --help, --version, or an error.
  bool exit = false;
  int exit_code = 0;
};

// Reads the flags and the file that --config names; flags win. Prints help, the
// version, and errors of the flags. InvalidArgument for a file that is refused:
// "deformd.toml:12: unknown key \"max-modle-bytes\"".
absl::StatusOr<CommandLine> ReadCommandLine(int argc, const char* const* argv);

// Overwrites what `text` names. `file` begins the messages.
absl::Status ReadToml(absl::string_view text, absl::string_view file,
                      Options& options);

// Refuses values that cannot work: InvalidArgument that names the option.
absl::Status CheckOptions(const Options& options);

// All options with their meaning as comments; ReadToml() takes it.
std::string WriteToml(const Options& options);

}  // namespace deform::server
