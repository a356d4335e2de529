#include "server/options.h"

#include <toml++/toml.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <iostream>
#include <iterator>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/weights/compress_binding.h"

namespace deform::server {
namespace {

constexpr double kMax = 1e15;
constexpr char kLogLevels[] = "trace debug info warn error off";

// The one list of options: name on the command line and in the file, value,
// smallest and largest (numbers), meaning.
template <typename SomeOptions, typename Visitor>
void VisitOptions(SomeOptions& o, Visitor&& visit) {
  visit("listen", o.listen, 0, 0,
        "Where to listen: HOST:PORT (port 0: any free one, told on standard "
        "output) or unix:PATH. Not encrypted: keep it on loopback or a trusted "
        "network.");
  visit("data-dir", o.data_dir, 0, 0,
        "Directory in which models, bindings and sessions outlive the server; "
        "made if it is not there. One server at a time uses it.");
  visit("in-memory", o.in_memory, 0, 0,
        "Keep nothing on disk: all state ends with the server, and data-dir is "
        "not used.");
  visit("log-level", o.log_level, 0, 0,
        "What is logged to standard error: trace, debug, info, warn, error or "
        "off.");
  visit("compute-threads", o.compute_threads, 0, 1024,
        "Threads for deforming, and as many, at a lower priority, for binding. "
        "0: one per core.");
  visit("max-call-threads", o.max_call_threads, 8, 4096,
        "Threads for calls other than Deform; calls beyond are refused.");
  visit("max-model-bytes", o.max_model_bytes, 1, kMax,
        "Largest model, as uploaded: 8 bytes per coordinate, 12 per face.");
  visit("max-models-memory", o.max_models_memory, 1, kMax,
        "Memory of all models, those being uploaded included.");
  visit("max-models", o.max_models, 1, kMax, "Models of all tenants.");
  visit("max-bindings-memory", o.max_bindings_memory, 1, kMax,
        "Memory of all weights: 4 bytes per point and column, where columns "
        "are cage vertices and faces, or handles. Weights that no session uses "
        "are dropped for others, and computed again when needed.");
  visit("max-bindings", o.max_bindings, 1, kMax, "Bindings of all tenants.");
  visit("max-concurrent-binds", o.max_concurrent_binds, 1, 1024,
        "Bindings computed at a time; others wait their turn.");
  visit("max-waiting-binds", o.max_waiting_binds, 1, 4096,
        "Calls that wait for a binding at a time. Each holds one of "
        "max-call-threads.");
  visit("weight-tolerance", o.weight_tolerance, kFinestTolerance,
        kCoarsestTolerance,
        "How far compressed weights may move a point, as a fraction of the "
        "rig's diagonal, for bindings whose request does not say: 1e-6 to "
        "1e-2, or 0: weights stay dense. They are compressed in the background "
        "and take about a tenth of the memory and of the time of a pose.");
  visit("max-sessions-memory", o.max_sessions_memory, 1, kMax,
        "Memory of all sessions: about 90 bytes per point.");
  visit(
      "max-drags-memory", o.max_drags_memory, 0, kMax,
      "Memory in which sessions keep copies of the weights that a drag moves, "
      "besides, for as long as it lasts: they are read as fast as memory "
      "allows. A drag that finds none left reads the weights, more slowly.");
  visit("max-sessions", o.max_sessions, 1, kMax, "Sessions of all tenants.");
  visit("max-participants", o.max_participants, 1, 100'000,
        "Streams that may join one session.");
  visit("max-backups", o.max_backups, 0, 10'000,
        "Backups that clients may have made in data-dir/backups; more must "
        "wait until some are moved elsewhere.");
  visit("stall-timeout", o.stall_timeout, 0.1, 86'400,
        "Seconds after which a call is ended whose client is waited for and "
        "neither sends what it has announced nor reads what it asked for.");
  visit("resume-grace", o.resume_grace, 0, 86'400,
        "Seconds for which the place of a participant whose stream broke is "
        "kept: it comes back with the token that it has.");
  visit("drain-timeout", o.drain_timeout, 0, 86'400,
        "Seconds that SIGTERM leaves to what is running.");
}

absl::Status Bad(absl::string_view name, absl::string_view message) {
  return InvalidInput("BAD_OPTION", name, absl::StrCat(name, ": ", message));
}

absl::StatusOr<Bytes> ParseBytes(absl::string_view text) {
  static constexpr std::pair<absl::string_view, int> kUnits[] = {
      {"TiB", 40}, {"GiB", 30}, {"MiB", 20}, {"KiB", 10}, {"B", 0}, {"", 0}};
  for (const auto& [unit, shift] : kUnits) {
    if (!absl::EndsWith(text, unit)) continue;
    int64_t number = 0;
    const auto digits =
        absl::StripAsciiWhitespace(text.substr(0, text.size() - unit.size()));
    if (absl::SimpleAtoi(digits, &number) && number >= 0 &&
        number <= static_cast<int64_t>(kMax) >> shift) {
      return Bytes{number << shift};
    }
    break;
  }
  return absl::InvalidArgumentError(
      "is a number of bytes such as 1048576, \"512 MiB\" or \"2 GiB\"");
}

std::string FormatExactly(const Bytes& bytes) {
  static constexpr const char* kUnits[] = {"", " KiB", " MiB", " GiB", " TiB"};
  int64_t value = bytes.value;
  int unit = 0;
  while (unit < 4 && value > 0 && value % 1024 == 0) {
    value /= 1024;
    ++unit;
  }
  return absl::StrCat(value, kUnits[unit]);
}

// From the command line.
absl::Status Parse(absl::string_view name, const std::string& text,
                   std::string& value) {
  if (text.empty()) return Bad(name, "is empty");
  value = text;
  return absl::OkStatus();
}
absl::Status Parse(absl::string_view name, const std::string& text,
                   bool& value) {
  if (absl::SimpleAtob(text, &value)) return absl::OkStatus();
  return Bad(name, "is true or false");
}
template <typename Integer>
requires std::is_integral_v<Integer> absl::Status Parse(absl::string_view name,
                                                        const std::string& text,
                                                        Integer& value) {
  if (absl::SimpleAtoi(text, &value)) return absl::OkStatus();
  return Bad(name, absl::StrCat("is a whole number, not \"", text, "\""));
}
absl::Status Parse(absl::string_view name, const std::string& text,
                   Seconds& value) {
  if (absl::SimpleAtod(text, &value.value)) return absl::OkStatus();
  return Bad(name, absl::StrCat("is a number of seconds, not \"", text, "\""));
}
absl::Status Parse(absl::string_view name, const std::string& text,
                   Tolerance& value) {
  if (absl::SimpleAtod(text, &value.value)) return absl::OkStatus();
  return Bad(name, absl::StrCat("is a number, not \"", text, "\""));
}
absl::Status Parse(absl::string_view name, const std::string& text,
                   Bytes& value) {
  const auto parsed = ParseBytes(text);
  if (!parsed.ok()) {
    return Bad(name,
               absl::StrCat(parsed.status().message(), ", not \"", text, "\""));
  }
  value = *parsed;
  return absl::OkStatus();
}

// From the file.
absl::Status Read(absl::string_view name, const toml::node& node,
                  std::string& value) {
  const auto read = node.value_exact<std::string>();
  if (!read) return Bad(name, "is a string, in quotes");
  return Parse(name, *read, value);
}
absl::Status Read(absl::string_view name, const toml::node& node, bool& value) {
  const auto read = node.value_exact<bool>();
  if (!read) return Bad(name, "is true or false");
  value = *read;
  return absl::OkStatus();
}
template <typename Integer>
requires std::is_integral_v<Integer> absl::Status Read(absl::string_view name,
                                                       const toml::node& node,
                                                       Integer& value) {
  const auto read = node.value_exact<int64_t>();
  if (!read) return Bad(name, "is a whole number");
  return Parse(name, absl::StrCat(*read), value);
}
absl::Status Read(absl::string_view name, const toml::node& node,
                  Seconds& value) {
  const auto read = node.value<double>();
  if (!read || !node.is_number()) return Bad(name, "is a number of seconds");
  value.value = *read;
  return absl::OkStatus();
}
absl::Status Read(absl::string_view name, const toml::node& node,
                  Tolerance& value) {
  const auto read = node.value<double>();
  if (!read || !node.is_number()) return Bad(name, "is a number");
  value.value = *read;
  return absl::OkStatus();
}
absl::Status Read(absl::string_view name, const toml::node& node,
                  Bytes& value) {
  if (const auto number = node.value_exact<int64_t>()) {
    return Parse(name, absl::StrCat(*number), value);
  }
  return Parse(name, node.value_exact<std::string>().value_or(""), value);
}

std::string Format(const std::string& value) {
  return absl::StrCat("\"", value, "\"");
}
std::string Format(bool value) { return value ? "true" : "false"; }
std::string Format(int64_t value) { return absl::StrCat(value); }
std::string Format(int value) { return absl::StrCat(value); }
std::string Format(const Seconds& value) { return absl::StrCat(value.value); }
std::string Format(const Tolerance& value) { return absl::StrCat(value.value); }
std::string Format(const Bytes& value) {
  return absl::StrCat("\"", FormatExactly(value), "\"");
}

// What stands for the value in --help.
const char* TypeName(const std::string&) { return "TEXT"; }
const char* TypeName(int64_t) { return "NUMBER"; }
const char* TypeName(const Seconds&) { return "SECONDS"; }
const char* TypeName(const Tolerance&) { return "FRACTION"; }
const char* TypeName(const Bytes&) { return "BYTES"; }

double NumberOf(int64_t value) { return static_cast<double>(value); }
double NumberOf(const Seconds& value) { return value.value; }
double NumberOf(const Bytes& value) { return static_cast<double>(value.value); }

template <typename Value>
absl::Status Check(absl::string_view name, const Value& value, double smallest,
                   double largest) {
  const double number = NumberOf(value);
  if (number >= smallest && number <= largest) return absl::OkStatus();
  return Bad(name, absl::StrCat("must be between ", smallest, " and ", largest,
                                ", not ", number));
}
absl::Status Check(absl::string_view name, const Tolerance& tolerance,
                   double smallest, double largest) {
  const double value = tolerance.value;
  if (value == 0 || (value >= smallest && value <= largest)) {
    return absl::OkStatus();
  }
  return Bad(name, absl::StrCat("must be 0 or between ", smallest, " and ",
                                largest, ", not ", value));
}
absl::Status Check(absl::string_view, bool, double, double) {
  return absl::OkStatus();
}
absl::Status Check(absl::string_view name, const std::string& value, double,
                   double) {
  if (name == "log-level") {
    const std::vector<std::string> levels = absl::StrSplit(kLogLevels, ' ');
    if (absl::c_linear_search(levels, value)) return absl::OkStatus();
    return Bad(name, absl::StrCat("is one of ", absl::StrJoin(levels, ", "),
                                  ", not \"", value, "\""));
  }
  if (name == "data-dir") return absl::OkStatus();  // Tried when it is opened.
  if (absl::StartsWith(value, "unix:") && value.size() > 5) {
    return absl::OkStatus();
  }
  const size_t colon = value.rfind(':');
  int port = -1;
  if (colon == std::string::npos || colon == 0 ||
      !absl::SimpleAtoi(value.substr(colon + 1), &port) || port < 0 ||
      port > 65535) {
    return Bad(name,
               absl::StrCat("is HOST:PORT or unix:PATH, not \"", value, "\""));
  }
  return absl::OkStatus();
}

std::string At(absl::string_view file, const toml::source_region& where) {
  return absl::StrCat(file, ":", where.begin.line, ": ");
}

absl::Status ReadEntry(absl::string_view key, const toml::node& node,
                       Options& options) {
  absl::Status status = InvalidInput("UNKNOWN_OPTION", key,
                                     absl::StrCat("unknown key \"", key, "\""));
  VisitOptions(options, [&](absl::string_view name, auto& value,
                            double smallest, double largest, const char*) {
    if (name != key) return;
    status = Read(name, node, value);
    if (status.ok()) status = Check(name, value, smallest, largest);
  });
  return status;
}

// Lines of at most 78 characters that begin with "# ".
std::string Comment(absl::string_view text) {
  std::string comment = "#";
  size_t line = 1;
  for (const absl::string_view word : absl::StrSplit(text, ' ')) {
    if (line + 1 + word.size() > 78) {
      absl::StrAppend(&comment, "\n#");
      line = 1;
    }
    absl::StrAppend(&comment, " ", word);
    line += 1 + word.size();
  }
  return comment + "\n";
}

absl::Status ReadFile(const std::string& file, Options& options) {
  std::ifstream stream(file, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(stream), {});
  if (!stream.is_open() || stream.bad()) {
    return MakeError(absl::StatusCode::kNotFound,
                     absl::StrCat("cannot read ", file),
                     {.reason = "NO_SUCH_FILE", .field = "config"});
  }
  return ReadToml(text, file, options);
}

// The flags of deformd; `line` is written by parsing.
void AddFlags(CLI::App& app, CommandLine& line, std::string& config) {
  app.set_version_flag("--version", DEFORM_VERSION);
  app.add_option("--config", config,
                 "TOML file with the options below, by the same names. Flags "
                 "win.")
      ->type_name("FILE");
  app.add_flag("--config-check", line.check_only,
               "Print the effective configuration as TOML and exit.");
  app.add_option("--restore", line.restore,
                 "Make data-dir, which must not exist, from this backup, of "
                 "which every byte is verified; then serve.")
      ->type_name("BACKUP");
  VisitOptions(line.options, [&app](const std::string& name, auto& value,
                                    double smallest, double largest,
                                    const char* meaning) {
    const auto set = [name, &value, smallest,
                      largest](const std::string& text) {
      absl::Status status = Parse(name, text, value);
      if (status.ok()) status = Check(name, value, smallest, largest);
      if (!status.ok())
        throw CLI::ValidationError(std::string(status.message()));
    };
    const std::string help = absl::StrCat(meaning, " [", Format(value), "]");
    if constexpr (std::is_same_v<decltype(value), bool&>) {
      app.add_flag_function(
          "--" + name,
          [set](int64_t count) { set(count > 0 ? "true" : "false"); }, help);
    } else {
      app.add_option_function<std::string>("--" + name, set, help)
          ->type_name(TypeName(value));
    }
  });
}

}  // namespace

absl::Status ReadToml(absl::string_view text, absl::string_view file,
                      Options& options) try {
  const toml::table table =
      toml::parse(std::string_view(text.data(), text.size()));
  for (const auto& [key, node] : table) {
    const absl::string_view name(key.data(), key.length());
    const absl::Status status = ReadEntry(name, node, options);
    if (!status.ok()) return Annotate(status, At(file, key.source()));
  }
  return absl::OkStatus();
} catch (const toml::parse_error& error) {
  const auto description = error.description();
  return InvalidInput(
      "BAD_TOML", "config",
      absl::StrCat(At(file, error.source()),
                   absl::string_view(description.data(), description.size())));
}

absl::Status CheckOptions(const Options& options) {
  absl::Status status;
  VisitOptions(options, [&](absl::string_view name, const auto& value,
                            double smallest, double largest, const char*) {
    if (status.ok()) status = Check(name, value, smallest, largest);
  });
  if (status.ok() && options.max_waiting_binds >= options.max_call_threads) {
    return Bad("max-waiting-binds",
               absl::StrCat("must be less than max-call-threads (",
                            options.max_call_threads,
                            "), or waiting calls would lock out the others"));
  }
  return status;
}

std::string WriteToml(const Options& options) {
  std::string toml;
  VisitOptions(options, [&](absl::string_view name, const auto& value, double,
                            double, const char* meaning) {
    absl::StrAppend(&toml, toml.empty() ? "" : "\n", Comment(meaning), name,
                    " = ", Format(value), "\n");
  });
  return toml;
}

absl::StatusOr<CommandLine> ReadCommandLine(int argc, const char* const* argv) {
  CommandLine line;
  std::string config;
  const auto parse = [&] {
    CLI::App app(
        "deformd keeps models and the weights of their rigs in memory and "
        "streams deformed vertices as fast as poses arrive.",
        "deformd");
    app.get_formatter()->column_width(34);
    AddFlags(app, line, config);
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      line.exit = true;
      line.exit_code = app.exit(error, std::cout, std::cerr);
    }
  };
  parse();
  if (line.exit || config.empty()) return line;
  // Once more over what the file says: flags win.
  line.options = Options();
  DEFORM_RETURN_IF_ERROR(ReadFile(config, line.options));
  parse();
  return line;
}

}  // namespace deform::server
