// Options of commands that receive frames.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cpp/deform_stream.h"

namespace CLI {
class App;
}

namespace deform::cli {

struct FrameOptions {
  std::vector<std::string> encodings;

  // One of the encodings is for clients that hold the weights.
  bool NeedsWeights() const;
  double tolerance = 0;  // Of the rig's diagonal; 0: exact frames.

  void AddTo(CLI::App& app);
  // A usage error if there is no such encoding, or if it needs a tolerance.
  absl::StatusOr<DeformOptions> For(Delivery delivery) const;
};

}  // namespace deform::cli
