// CreateBinding requests: any bytes that are a message.
#include "core/base/error.h"
#include "deform/v1/binding.pb.h"
#include "server/rpc/convert.h"
#include "tests/fuzz/expect.h"

namespace deform::server {
namespace {

void Check(const uint8_t* data, size_t size) {
  v1::CreateBindingRequest request;
  if (!request.ParseFromArray(data, static_cast<int>(size))) return;
  static const Mesh model =
      Mesh::Create(3, Positions::Identity(3, 3), Faces(0, 3)).value();
  const auto spec = FromProto(request, &model);
  if (!spec.ok()) {
    FUZZ_EXPECT(spec.status().code() == absl::StatusCode::kInvalidArgument);
    FUZZ_EXPECT(!DetailOf(spec.status()).reason.empty());
    FUZZ_EXPECT(!DetailOf(spec.status()).field.empty());
    return;
  }
  FUZZ_EXPECT(!spec->tenant.empty() && !spec->model_id.empty());
  // What was accepted is accepted when it comes back.
  v1::CreateBindingRequest again = request;
  again.clear_rig();
  again.set_add_box_handles(false);
  ToProto(spec->rig, again.mutable_rig());
  FUZZ_EXPECT(FromProto(again).ok());
}

}  // namespace
}  // namespace deform::server

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  deform::server::Check(data, size);
  return 0;
}
