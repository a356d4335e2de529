// Options of commands that receive frames.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cli/command.h"
#include "client/cpp/deform_stream.h"
#include "core/frames/encoding.h"

namespace CLI {
class App;
}

namespace deform::cli {

struct FrameOptions {
  std::vector<std::string> encodings;
  double tolerance = 0;  // Of the rig's diagonal; 0: exact frames.

  // One of the encodings is for clients that hold this.
  bool Need(Needs what) const;

  void AddTo(CLI::App& app);
  // What they need of the binding, into `frames`.
  absl::Status Download(Client& client, const std::string& binding_id,
                        Context& context, DeformOptions& frames) const;
  // A usage error if there is no such encoding, or if it needs a tolerance.
  absl::StatusOr<DeformOptions> For(Delivery delivery) const;
};

}  // namespace deform::cli
