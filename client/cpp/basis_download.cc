#include "client/cpp/basis_download.h"

#include "core/base/status_macros.h"
#include "core/frames/leaf_basis.h"

namespace deform {
namespace {

// What it may come to, so that sizes are numbers.
constexpr uint64_t kMaxBytes = uint64_t{1} << 40;

}  // namespace

absl::Status BasisDownload::Add(const v1::DownloadBasisResponse& part) {
  if (!id_.empty()) return bytes_.Add(part.chunk());
  const v1::BasisHeader& header = part.header();
  if (header.basis_id().empty() || header.byte_count() > kMaxBytes) {
    return BadDownload(
        "basis", "the server does not begin with a basis, but \"",
        header.basis_id(), "\" of ", header.byte_count(), " bytes");
  }
  id_ = header.basis_id();
  bytes_ = ChunkedBytes("basis", static_cast<int64_t>(header.byte_count()));
  return absl::OkStatus();
}

absl::StatusOr<HeldBasis> BasisDownload::Finish(const HeldBasis& known) const {
  if (id_.empty()) return BadDownload("basis", "the server sent no basis");
  if (received() == 0 && id_ == known.basis_id) return known;
  DEFORM_RETURN_IF_ERROR(bytes_.CheckComplete());
  const auto* const data =
      reinterpret_cast<const uint8_t*>(bytes_.bytes().data());
  DEFORM_ASSIGN_OR_RETURN(
      auto basis, LeafBasis::FromBytes({data, bytes_.bytes().size()}, total()));
  return HeldBasis{id_, std::move(basis)};
}

}  // namespace deform
