// A request that keeps a server busy for a while, unless it is stopped.
#pragma once

#include "client/cpp/client.h"
#include "deform/v1/binding.pb.h"
#include "tests/support/shapes.h"

namespace deform {

// 40,962 points among 2,562 handles: half a second of work and more on two
// cores. Registers the model.
inline v1::CreateBindingRequest LongBindingRequest(Client& client) {
  v1::CreateBindingRequest request;
  request.set_model_id(
      client.RegisterModel(MeshOf(Icosphere(0.5, 6)), "").value().model_id);
  request.set_scheme("s_cc");
  auto* handles = request.mutable_rig()->mutable_handles();
  handles->set_dimension(3);
  const Shape shape = Icosphere(1, 4);
  handles->mutable_positions()->Add(
      shape.positions.data(), shape.positions.data() + shape.positions.size());
  return request;
}

}  // namespace deform
