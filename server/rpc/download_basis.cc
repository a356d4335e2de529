// BindingService::DownloadBasis.
#include <zlib.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/models/names.h"
#include "server/models/retry.h"
#include "server/rpc/binding_service.h"

namespace deform::server {
namespace {

constexpr int64_t kMaxChunk = int64_t{1} << 20;

// What there is instead.
absl::Status NoBasis(const BindingRecord& record, bool compressing) {
  const std::string why = record.weights->state().why_dense;
  const auto status = MakeError(
      absl::StatusCode::kFailedPrecondition,
      absl::StrCat("binding ", Quoted(record.id),
                   " has no leaf basis: its weights are ",
                   compressing    ? "being compressed, try again"
                   : !why.empty() ? absl::StrCat("dense (", why, ")")
                                  : "dense; bind with a weight_tolerance"),
      {.reason = "NO_BASIS",
       .resource_type = "binding",
       .resource_name = record.id});
  return compressing ? RetryLater(status) : status;
}

void SetChunk(std::span<const std::byte> piece, int64_t offset,
              v1::BasisChunk& chunk) {
  chunk.set_offset(offset);
  chunk.set_crc32(static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(piece.data()),
            static_cast<uInt>(piece.size()))));
  chunk.set_data(piece.data(), piece.size());
}

}  // namespace

grpc::Status BindingService::DownloadBasis(
    grpc::ServerContext* context, const v1::DownloadBasisRequest* request,
    grpc::ServerWriter<v1::DownloadBasisResponse>* writer) {
  return calls_.Run("DownloadBasis", *context, [&]() -> absl::Status {
    PeerWriter<v1::DownloadBasisResponse> peer(calls_, *context, *writer);
    DEFORM_ASSIGN_OR_RETURN(const auto record, Find(*request));
    // Asked before the weights: who has been compressed meanwhile is not dense.
    const bool compressing =
        bindings_.compressor().ProgressOf(*record).has_value();
    DEFORM_ASSIGN_OR_RETURN(
        const auto weights,
        bindings_.WeightsOf(record, [&] { return !peer.IsGone(); }));
    const auto named = sessions_.frame_tables().BasisOf(weights);
    if (named == nullptr) return NoBasis(*record, compressing);
    v1::DownloadBasisResponse message;
    message.mutable_header()->set_basis_id(named->id);
    message.mutable_header()->set_byte_count(named->basis->byte_count());
    if (!peer.Write(message)) return absl::CancelledError();
    if (request->known_basis_id() == named->id) return absl::OkStatus();
    int64_t offset = 0;
    for (const auto piece : named->basis->Pieces(kMaxChunk)) {
      SetChunk(piece, offset, *message.mutable_chunk());
      if (!peer.Write(message)) return absl::CancelledError();
      offset += std::ssize(piece);
    }
    return absl::OkStatus();
  });
}

}  // namespace deform::server
