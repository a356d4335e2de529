// How a DeformCall begins; for client.cc only.
#pragma once

#include <memory>

#include "client/cpp/deform_call.h"
#include "deform/v1/session.grpc.pb.h"

namespace deform {

// `join` says how; `events` is borrowed until OnEnd() has returned.
std::unique_ptr<DeformCall> StartDeformCall(v1::SessionService::Stub& stub,
                                            const v1::Join& join,
                                            const DeformOptions& options,
                                            DeformEvents& events);

}  // namespace deform
