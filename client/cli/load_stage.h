// What a load run poses: a binding that is there, or models of its own.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cli/command.h"
#include "client/cpp/client.h"
#include "client/load/load_run.h"
#include "client/verify/run_case.h"

namespace deform::cli {

struct LoadStageOptions {
  std::string binding;  // Or:
  int64_t models = 1;
  int64_t points = 1000;
  int64_t cage_faces = 80;
  int64_t handles = 0;

  std::string pattern = "drag";
  std::vector<std::string> poses;  // Files and folders of them.
  int editors = 1;
  double rate = 60;
  bool check = true;
  double tolerance = 1e-6;  // Beside that of compressed weights and:
  double frame_tolerance = 0;
  // What participants hold, to deform by themselves.
  bool hold_weights = false;
  bool hold_basis = false;
};

// "drag", "jitter", "whole", "recorded".
const std::vector<std::string>& LoadPatterns();

// Not thread-safe.
class LoadStage {
 public:
  // `client` is borrowed.
  explicit LoadStage(Client& client) : client_(client) {}
  // Deletes what Prepare() made, if Close() was not called.
  ~LoadStage();

  // Errors of files, arguments and the server; Cancelled on Ctrl-C.
  absl::Status Prepare(Context& context, const LoadStageOptions& options);
  const std::vector<LoadTarget>& targets() const { return targets_; }
  const std::string& scheme() const { return scheme_; }
  int64_t columns() const { return columns_; }

  absl::Status Close();

 private:
  absl::Status Generate(Context& context, const LoadStageOptions& options,
                        int64_t number);
  absl::Status UseBinding(const LoadStageOptions& options);
  absl::Status AddTarget(const LoadStageOptions& options,
                         const BindingInfo& binding, const Rig& rig,
                         std::shared_ptr<const FrameJudge> judge);

  Client& client_;
  CreatedThings created_;
  std::vector<LoadTarget> targets_;
  std::string scheme_;
  int64_t columns_ = 0;
};

}  // namespace deform::cli
