// What is known of a binding, as bytes of our own: versioned, and right, since
// the store seals them. Enough to bind again, and not to have to.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "core/weights/binding.h"

namespace deform::server {

// The request without its model, and to what the weights are compressed.
std::string EncodeRequest(const BindRequest& request, double weight_tolerance);
struct DecodedRequest {
  BindRequest request;  // Of dense weights.
  double weight_tolerance = 0;
};
// DataLoss BINDING_DAMAGED if they are not such bytes, or a rig that is refused
// by now.
absl::StatusOr<DecodedRequest> DecodeRequest(std::span<const std::byte> bytes,
                                             std::shared_ptr<const Mesh> model);

std::string EncodeFacts(const BindingFacts& facts);
// Likewise, of this request; or if its scheme is not known any more.
absl::StatusOr<BindingFacts> DecodeFacts(std::span<const std::byte> bytes,
                                         BindRequest request);

}  // namespace deform::server
