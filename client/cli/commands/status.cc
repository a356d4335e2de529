// deformctl status: what a server holds, has done, and costs.
#include <CLI/CLI.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/command.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

Json ToJson(const ServerStatus& status) {
  return {{"version", status.version},
          {"uptime_seconds", status.uptime_seconds},
          {"cpu_seconds", status.cpu_seconds},
          {"resident_bytes", status.resident_bytes},
          {"open_files", status.open_files},
          {"processors", status.processors},
          {"models", status.models},
          {"bindings", status.bindings},
          {"sessions", status.sessions},
          {"participants", status.participants},
          {"frames_sent", status.frames_sent},
          {"frame_bytes_sent", status.frame_bytes_sent},
          {"poses_accepted", status.poses_accepted},
          {"poses_rejected", status.poses_rejected}};
}

void Print(const ServerStatus& status, std::ostream& out) {
  const auto line = [&](const char* name, const std::string& value) {
    out << absl::StrFormat("%-14s %s\n", name, value);
  };
  line("version", status.version);
  line("up", Seconds(status.uptime_seconds));
  line("cpu",
       absl::StrFormat(
           "%s, %.2f of %d processors on average", Seconds(status.cpu_seconds),
           status.cpu_seconds / std::max(status.uptime_seconds, 1e-9),
           status.processors));
  line("memory", absl::StrCat(Bytes(status.resident_bytes), " resident"));
  line("open files", Thousands(status.open_files));
  line("holds", absl::StrCat(Thousands(status.models), " models, ",
                             Thousands(status.bindings), " bindings, ",
                             Thousands(status.sessions), " sessions with ",
                             Thousands(status.participants), " participants"));
  line("frames", absl::StrCat(Thousands(status.frames_sent), " sent, ",
                              Bytes(status.frame_bytes_sent)));
  line("poses", absl::StrCat(Thousands(status.poses_accepted), " accepted, ",
                             Thousands(status.poses_rejected), " rejected"));
}

absl::Status Run(Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  DEFORM_ASSIGN_OR_RETURN(const ServerStatus status, client.GetServerStatus());
  context.console.Result(ToJson(status),
                         [&](std::ostream& out) { Print(status, out); });
  return absl::OkStatus();
}

Action Setup(CLI::App& /*app*/) { return Run; }

}  // namespace

const Command& StatusCommand() {
  static const Command command = {
      "status", "Show what the server holds, has done, and costs",
      "deformctl status\n"
      "deformctl --server 127.0.0.1:7777 status --json | jq .resident_bytes",
      "", Setup};
  return command;
}

}  // namespace deform::cli
