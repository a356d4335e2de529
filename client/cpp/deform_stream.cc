#include "client/cpp/deform_stream.h"

#include <algorithm>
#include <utility>

#include "client/cpp/deform_stream_impl.h"

namespace deform {

Positions Frame::DoublePositions() const {
  const int64_t count = point_count();
  Positions result = Positions::Zero(count, 3);
  for (int64_t i = 0; i < count; ++i) {
    for (int k = 0; k < dimension; ++k) {
      result(i, k) = origin[k] + positions[i * dimension + k];
    }
  }
  return result;
}

DeformStream::DeformStream(std::unique_ptr<Impl> impl)
    : impl_(std::move(impl)) {}
DeformStream::DeformStream(DeformStream&&) noexcept = default;
DeformStream& DeformStream::operator=(DeformStream&&) noexcept = default;
DeformStream::~DeformStream() = default;

const JoinedSession& DeformStream::joined() const { return impl_->joined(); }
absl::StatusOr<uint64_t> DeformStream::Send(const PoseUpdate& update) {
  return impl_->Send(update, {});
}
absl::StatusOr<uint64_t> DeformStream::Send(const PoseUpdate& update,
                                            uint64_t rig_changes) {
  return impl_->Send(update, {.rig_changes = rig_changes});
}
absl::StatusOr<uint64_t> DeformStream::Send(const PoseUpdate& update,
                                            const PoseOptions& options) {
  return impl_->Send(update, options);
}

absl::StatusOr<uint64_t> DeformStream::Lock(std::span<const int32_t> handles,
                                            std::chrono::milliseconds lease) {
  v1::DeformRequest request;
  request.mutable_lock()->mutable_vertices()->Add(handles.begin(),
                                                  handles.end());
  request.mutable_lock()->set_lease_ms(
      static_cast<uint32_t>(std::clamp<int64_t>(lease.count(), 0, UINT32_MAX)));
  request.mutable_lock()->set_rig_changes(impl_->told_changes());
  return impl_->Ask(std::move(request));
}

absl::StatusOr<uint64_t> DeformStream::Unlock(
    std::span<const int32_t> handles) {
  v1::DeformRequest request;
  request.mutable_unlock()->mutable_vertices()->Add(handles.begin(),
                                                    handles.end());
  request.mutable_unlock()->set_rig_changes(impl_->told_changes());
  return impl_->Ask(std::move(request));
}

absl::StatusOr<uint64_t> DeformStream::Undo() {
  v1::DeformRequest request;
  request.mutable_undo();
  return impl_->Ask(std::move(request));
}

absl::StatusOr<uint64_t> DeformStream::Redo() {
  v1::DeformRequest request;
  request.mutable_redo();
  return impl_->Ask(std::move(request));
}

absl::Status DeformStream::Show(std::span<const int32_t> grabbed,
                                absl::string_view cursor) {
  v1::DeformRequest request;
  request.mutable_presence()->mutable_grabbed()->Add(grabbed.begin(),
                                                     grabbed.end());
  request.mutable_presence()->set_cursor(cursor.data(), cursor.size());
  return impl_->Tell(std::move(request));
}

absl::Status DeformStream::RequestKeyframe() {
  v1::DeformRequest request;
  request.mutable_keyframe();
  return impl_->Tell(std::move(request));
}
const std::vector<RigChange>& DeformStream::rig_changes() const {
  return impl_->rig_changes();
}
absl::Status DeformStream::Hold(const HeldBinding& weights) {
  return impl_->Hold(weights);
}
absl::Status DeformStream::Hold(const HeldBasis& basis) {
  return impl_->Hold(basis);
}
absl::Status DeformStream::NextFrame(Frame& frame) {
  return impl_->NextFrame(frame);
}
const std::vector<ParticipantInfo>& DeformStream::participants() const {
  return impl_->participants();
}
const std::optional<CurrentPose>& DeformStream::conflict() const {
  return impl_->conflict();
}
int64_t DeformStream::reconnections() const { return impl_->reconnections(); }
uint64_t DeformStream::rejected_sequence() const {
  return impl_->rejected_sequence();
}
bool DeformStream::ended() const { return impl_->ended(); }
void DeformStream::Close() { impl_->Close(); }
void DeformStream::Cancel() { impl_->Cancel(); }

}  // namespace deform
