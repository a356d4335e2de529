#include "client/cli/exit_code.h"

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform::cli {
namespace {

constexpr char kPayload[] = "deformctl/exit-code";

struct Hint {
  const char* reason;
  const char* text;
};

constexpr Hint kHints[] = {
    {"SERVER_UNREACHABLE",
     "start one with 'deformd', or name another with --server HOST:PORT "
     "(DEFORM_SERVER)"},
    {"EXTERIOR_NO_EXIT_FACE",
     "use --exit auto to reach these points through the cage's faces, or "
     "--unbindable report to leave them where they are"},
    {"EXIT_AMBIGUOUS",
     "name the face with --exit FACE, give one per point with "
     "--exit-per-point FILE, or leave them with --unbindable report"},
    {"EXIT_FACE_OUT_OF_RANGE",
     "faces are counted from 0, as triangles: a polygon of k corners in the "
     "file counts as k - 2 of them, in its place"},
    {"OUTSIDE_HULL",
     "use --add-box for fixed handles around the model, add some of your own, "
     "or leave these points with --unbindable report"},
    {"NOT_CONVERGED", "leave these points with --unbindable report"},
    {"CAGE_OVERLAPPING",
     "pull the parts of the cage apart; faces are counted from 0, as "
     "triangles: a polygon of k corners in the file counts as k - 2 of them"},
    {"CAGE_INVERTED", "use --flip-cage to turn the cage's faces outward"},
    {"CAGE_NOT_CLOSED", "close the hole: every edge needs two faces"},
    {"NOT_PLANAR", "use --dimension 3 if the model is not flat"},
    {"DIMENSION_MISMATCH",
     "use --dimension to say how model and rig are to be read"},
    {"UNKNOWN_SCHEME", "'deformctl list schemes' shows what there is"},
    {"MODEL_NOT_FOUND", "'deformctl list models' shows what there is"},
    {"BINDING_NOT_FOUND", "'deformctl list bindings' shows what there is"},
    {"SESSION_NOT_FOUND", "'deformctl list sessions' shows what there is"},
    {"MODEL_IN_USE",
     "delete its bindings first: 'deformctl list bindings' shows them"},
    {"BINDING_IN_USE",
     "delete its sessions first: 'deformctl list sessions' shows them"},
    {"ID_NOT_FOUND",
     "'deformctl list models', 'list bindings' and 'list sessions' show what "
     "there is"},
    {"WRONG_RIG",
     "'deformctl list schemes' tells which take --cage and which --handles"},
    {"WRONG_LENGTH",
     "the file needs one entry, or vertex, for each of the original"},
    {"MEMORY_LIMIT", "delete what is not needed, or raise the server's limit"},
    {"SERVER_DRAINING", "the server is shutting down; try again later"},
    {"SESSION_EXISTS", "choose another session id"},
    {"NO_CAGE_FOUND", "try more --faces or another --margin"},
    {"UNKNOWN_MESH_FORMAT", "convert the file to one of these formats"},
};

}  // namespace

absl::Status WithExit(ExitCode code, const absl::Status& status) {
  absl::Status result = status;
  result.SetPayload(kPayload, absl::Cord(absl::StrCat(static_cast<int>(code))));
  return result;
}

ExitCode ExitCodeOf(const absl::Status& status) {
  if (status.ok()) return kOk;
  int code = 0;
  const auto payload = status.GetPayload(kPayload);
  if (payload && absl::SimpleAtoi(std::string(*payload), &code)) {
    return static_cast<ExitCode>(code);
  }
  if (DetailOf(status).reason == "SERVER_UNREACHABLE") return kUnreachable;
  if (absl::IsCancelled(status)) return kInterrupted;
  return kRefused;
}

absl::Status UsageError(absl::string_view message) {
  return WithExit(kUsage, InvalidInput("USAGE", "", message));
}

std::string HintFor(const absl::Status& status) {
  const std::string reason = DetailOf(status).reason;
  for (const Hint& hint : kHints) {
    if (reason == hint.reason) return hint.text;
  }
  return "";
}

}  // namespace deform::cli
