// A binding on its way in. What cannot be is InvalidArgument BAD_ANSWER.
#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cpp/client.h"
#include "client/cpp/info.h"
#include "core/weights/binding.h"

namespace deform {

// What GetBinding tells of a binding, as far as deforming needs it, with its
// model and its rig.
absl::StatusOr<BindingFacts> FactsOf(const BindingInfo& info, Mesh mesh,
                                     Rig rig);

// Takes what GetWeights answers, in order. Not thread-safe.
class WeightsDownload {
 public:
  WeightsDownload(int64_t points, int64_t columns)
      : weights_(points, columns) {}

  absl::Status Add(const WeightRows& rows);

  // Points, so far and at the end.
  int64_t received() const { return received_; }
  int64_t total() const { return weights_.points(); }

  absl::StatusOr<std::shared_ptr<const WeightTiles>> Finish() &&;

 private:
  WeightTiles weights_;
  int64_t received_ = 0;
};

}  // namespace deform
