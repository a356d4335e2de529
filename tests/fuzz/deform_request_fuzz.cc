// Messages of a Deform stream: any bytes, then what a session makes of them.
#include <chrono>
#include <vector>

#include "core/base/error.h"
#include "core/deform/pose.h"
#include "grpcpp/support/slice.h"
#include "server/rpc/convert.h"
#include "server/rpc/message_bytes.h"
#include "tests/fuzz/expect.h"
#include "tests/support/shapes.h"

namespace deform::server {
namespace {

void CheckRefusal(const absl::Status& status) {
  FUZZ_EXPECT(status.code() == absl::StatusCode::kInvalidArgument);
  FUZZ_EXPECT(!DetailOf(status).reason.empty());
  FUZZ_EXPECT(!DetailOf(status).field.empty());
  FUZZ_EXPECT(!status.message().empty());
}

const Rig& CubeRig() {
  static const Rig rig(CageOf(Cuboid(Vec3::Constant(-1), Vec3::Constant(1))));
  return rig;
}

const Rig& SquareRig() {
  static const Rig rig(CageOf(RegularLoop2d(1, 4)));
  return rig;
}

void CheckPose(const v1::Pose& message, const Rig& rig) {
  const auto update = FromProto(message, DimensionOf(rig));
  if (!update.ok()) return CheckRefusal(update.status());
  const absl::Status status = CheckPoseUpdate(*update, rig);
  if (!status.ok()) return CheckRefusal(status);
  // A pose that was accepted leaves a pose that is right.
  Pose pose = RestPose(rig);
  ApplyPoseUpdate(*update, pose);
  FUZZ_EXPECT(pose.vertices.rows() == RestVertices(rig).rows());
  FUZZ_EXPECT(pose.vertices.allFinite());
  FUZZ_EXPECT(pose.stretch_blend >= 0 && pose.stretch_blend <= 1);
}

void CheckIntroduction(const v1::Join& message) {
  const auto who = IntroductionOf(message);
  if (!who.ok()) return CheckRefusal(who.status());
  FUZZ_EXPECT(who->token.size() <= 64);
  const absl::Status status = Presence::CheckName(who->name);
  if (!status.ok()) CheckRefusal(status);
}

void CheckPresence(const v1::Presence& message) {
  const auto shown = FromProto(message);
  if (!shown.ok()) return CheckRefusal(shown.status());
  const absl::Status status = Presence::Check(*shown, PoseRows(CubeRig()));
  if (!status.ok()) CheckRefusal(status);
}

void CheckLock(const v1::LockHandles& message) {
  const auto handles = ToHandles(message.vertices(), "lock.vertices");
  if (!handles.ok()) return CheckRefusal(handles.status());
  for (const int32_t handle : *handles) FUZZ_EXPECT(handle >= 0);
}

void CheckJoin(const v1::Join& message) {
  const auto join = FromProto(message);
  if (!join.ok()) return CheckRefusal(join.status());
  static const Mesh model = MeshOf(Icosphere(0.5, 0));
  const auto wanted = Subscribe(join->delivery, join->frames, CubeRig(), model);
  if (!wanted.ok()) return CheckRefusal(wanted.status());
  const FrameFormat& format = wanted->format;
  FUZZ_EXPECT(format.encoding != nullptr);
  FUZZ_EXPECT(format.encoding->is_exact() == (format.tolerance == 0));
  FUZZ_EXPECT(wanted->otherwise.encoding->needs() == Needs::kNothing);
  FUZZ_EXPECT(wanted->interval.count() >= 0);
  FUZZ_EXPECT(wanted->interval <= std::chrono::seconds(100));
  FUZZ_EXPECT(!join->tenant.empty() && !join->session_id.empty());
}

void Check(const uint8_t* data, size_t size) {
  const grpc::Slice slice(data, size);
  v1::DeformRequest request;
  if (!ParseMessage(grpc::ByteBuffer(&slice, 1), request)) return;
  CheckPose(request.pose(), CubeRig());
  CheckPose(request.pose(), SquareRig());
  CheckJoin(request.join());
  CheckIntroduction(request.join());
  CheckPresence(request.presence());
  CheckLock(request.lock());
}

}  // namespace
}  // namespace deform::server

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  deform::server::Check(data, size);
  return 0;
}
