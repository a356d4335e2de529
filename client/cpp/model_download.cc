#include "client/cpp/model_download.h"

#include <zlib.h>

#include <cstring>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

// Of either kind: then sizes in bytes are numbers.
constexpr uint64_t kMaxRows = std::numeric_limits<int32_t>::max();

template <typename... Parts>
absl::Status BadAnswer(const Parts&... parts) {
  return InvalidInput("BAD_ANSWER", "model", absl::StrCat(parts...));
}

}  // namespace

absl::Status ModelDownload::Begin(const v1::Model& model) {
  if ((model.dimension() != 2 && model.dimension() != 3) ||
      model.vertex_count() > kMaxRows || model.face_count() > kMaxRows) {
    return BadAnswer("the server tells of a model of ", model.vertex_count(),
                     " vertices and ", model.face_count(), " faces in ",
                     model.dimension(), "D");
  }
  model_ = model;
  position_bytes_ = static_cast<int64_t>(model.vertex_count()) *
                    model.dimension() * int64_t{sizeof(double)};
  total_ = position_bytes_ + static_cast<int64_t>(model.face_count()) * 3 *
                                 int64_t{sizeof(int32_t)};
  return absl::OkStatus();
}

absl::Status ModelDownload::Add(const v1::DownloadModelResponse& part) {
  if (!model_) {
    if (!part.has_model()) return BadAnswer("chunks come before their model");
    return Begin(part.model());
  }
  const v1::ModelChunk& chunk = part.chunk();
  const std::string& data = chunk.data();
  if (chunk.offset() != bytes_.size() || data.empty() ||
      static_cast<int64_t>(data.size()) > total_ - received()) {
    return BadAnswer("a chunk of ", data.size(), " bytes comes at ",
                     chunk.offset(), ", where ", received(), " of ", total_,
                     " bytes were reached");
  }
  const auto sum = static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(data.data()),
            static_cast<uInt>(data.size())));
  if (sum != chunk.crc32()) {
    return BadAnswer("the chunk at ", chunk.offset(),
                     " has another checksum than it tells");
  }
  bytes_ += data;
  return absl::OkStatus();
}

absl::StatusOr<ModelArrays> ModelDownload::Finish() && {
  if (!model_ || received() != total_) {
    return BadAnswer("a model ends after ", received(), " of ", total_,
                     " bytes");
  }
  const auto dimension = static_cast<int>(model_->dimension());
  const auto vertices = static_cast<int64_t>(model_->vertex_count());
  ModelArrays arrays(
      dimension, Positions::Zero(vertices, 3),
      Faces::Zero(static_cast<int64_t>(model_->face_count()), 3));
  const int64_t row_bytes = dimension * int64_t{sizeof(double)};
  for (int64_t i = 0; i < vertices; ++i) {
    std::memcpy(arrays.positions.row(i).data(), bytes_.data() + i * row_bytes,
                row_bytes);
  }
  // Not memcpy: without faces there may be no address.
  bytes_.copy(reinterpret_cast<char*>(arrays.faces.data()),
              total_ - position_bytes_, position_bytes_);
  return arrays;
}

}  // namespace deform
