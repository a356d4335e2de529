// The gRPC side of DeformStream; for client.cc and deform_stream.cc only.
#pragma once

#include <grpcpp/client_context.h>

#include <atomic>
#include <memory>
#include <optional>

#include "client/cpp/convert.h"
#include "client/cpp/deform_stream.h"
#include "client/cpp/frame_assembler.h"
#include "deform/v1/session.grpc.pb.h"

namespace deform {

class DeformStream::Impl {
 public:
  explicit Impl(v1::SessionService::Stub& stub);
  ~Impl();

  // The first call. Waits for the server's answer.
  absl::Status Join(const v1::Join& join);

  const JoinedSession& joined() const { return joined_; }
  absl::StatusOr<uint64_t> Send(const PoseUpdate& update, uint64_t rig_changes);
  absl::Status RequestKeyframe();
  uint64_t told_changes() const { return told_changes_; }
  const std::vector<RigChange>& rig_changes() const { return rig_changes_; }
  absl::Status NextFrame(Frame& frame);
  uint64_t rejected_sequence() const { return rejected_sequence_; }
  bool ended() const { return ended_; }
  void Close();
  void Cancel() { context_.TryCancel(); }

 private:
  // What came cannot be: ends the stream with this.
  absl::Status Refuse(const absl::Status& status);
  absl::Status End();

  grpc::ClientContext context_;
  const std::unique_ptr<
      grpc::ClientReaderWriter<v1::DeformRequest, v1::DeformResponse>>
      call_;
  JoinedSession joined_;

  // How many of rig_changes_ the caller of NextFrame() knows of.
  std::atomic<uint64_t> told_changes_{0};

  // The sending thread's.
  uint64_t sequence_ = 0;
  bool closed_ = false;

  // The receiving thread's.
  std::optional<FrameAssembler> assembler_;
  v1::DeformResponse response_;  // Kept for its buffers.
  uint64_t rejected_sequence_ = 0;
  std::vector<RigChange> rig_changes_;
  absl::Status in_band_;
  absl::Status end_;
  bool ended_ = false;
};

}  // namespace deform
