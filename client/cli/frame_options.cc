#include "client/cli/frame_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/cli/exit_code.h"
#include "client/cli/progress.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

constexpr char kAuto[] = "auto";

absl::Status Check(const std::string& name, double tolerance) {
  const FrameEncoding* const encoding = FindEncoding(name);
  if (encoding == nullptr && name != kAuto) {
    std::vector<absl::string_view> known = {kAuto};
    for (const FrameEncoding* e : AllEncodings()) known.push_back(e->id());
    return UsageError(absl::StrCat("--encoding: there is no '", name,
                                   "', only ", absl::StrJoin(known, ", ")));
  }
  if (tolerance == 0 && (encoding == nullptr || !encoding->is_exact())) {
    return UsageError(absl::StrCat(
        "--encoding ", name, " needs a tolerance: --frame-tolerance 1e-5"));
  }
  return absl::OkStatus();
}

}  // namespace

void FrameOptions::AddTo(CLI::App& app) {
  app.add_option("--frame-tolerance", tolerance,
                 "What frames may be off, as a part of the rig's diagonal; 0: "
                 "nothing but float's roundings")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--encoding", encodings,
                 "Frame encodings to accept, best first; auto: the one that "
                 "takes fewest bytes; pose: only the pose comes, and this "
                 "program deforms, with weights that it downloads before; "
                 "basis: leaf coefficients come, with a basis of the "
                 "compressed weights, likewise")
      ->delimiter(',')
      ->type_name("NAME");
}

bool FrameOptions::Need(Needs what) const {
  return std::any_of(encodings.begin(), encodings.end(),
                     [&](const std::string& name) {
                       const FrameEncoding* const encoding = FindEncoding(name);
                       return encoding != nullptr && encoding->needs() == what;
                     });
}

absl::Status FrameOptions::Download(Client& client,
                                    const std::string& binding_id,
                                    Context& context,
                                    DeformOptions& frames) const {
  if (Need(Needs::kWeights)) {
    Progress progress(context.console, "downloading weights",
                      &context.interruption);
    DEFORM_ASSIGN_OR_RETURN(
        frames.weights,
        client.DownloadBinding(binding_id, progress.callback()));
  }
  if (Need(Needs::kBasis)) {
    Progress progress(context.console, "downloading the basis",
                      &context.interruption);
    DEFORM_ASSIGN_OR_RETURN(
        frames.basis, client.DownloadBasis(binding_id, progress.callback()));
  }
  return absl::OkStatus();
}

absl::StatusOr<DeformOptions> FrameOptions::For(Delivery delivery) const {
  DeformOptions options{.delivery = delivery};
  if (tolerance > 0) options.tolerance_fraction = tolerance;
  for (const std::string& name : encodings) {
    if (const absl::Status status = Check(name, tolerance); !status.ok()) {
      return status;
    }
    // The client library's choice, if it may choose.
    if (name == kAuto) return options;
  }
  options.encodings = encodings;
  return options;
}

}  // namespace deform::cli
