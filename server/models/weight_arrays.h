// Weights as a store keeps them, in either form.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "core/weights/binding.h"
#include "server/stores/records.h"

namespace deform::server {

WeightsForm FormOf(const Binding& binding);

// The arrays that poses are deformed with; nothing is copied.
StoredArrays ArraysOf(std::shared_ptr<const Binding> binding);

// The binding of `facts` with these weights, read where they lie. DataLoss
// FILE_DAMAGED if they are not of this form, or of another binding.
absl::StatusOr<std::shared_ptr<const Binding>> BindingFrom(
    const BindingFacts& facts, const StoredWeights& weights);

}  // namespace deform::server
