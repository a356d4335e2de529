#include "client/cpp/model_download.h"

#include <cstring>
#include <limits>
#include <utility>

#include "core/base/status_macros.h"

namespace deform {
namespace {

// Of either kind: then sizes in bytes are numbers.
constexpr uint64_t kMaxRows = std::numeric_limits<int32_t>::max();

}  // namespace

absl::Status ModelDownload::Begin(const v1::Model& model) {
  if ((model.dimension() != 2 && model.dimension() != 3) ||
      model.vertex_count() > kMaxRows || model.face_count() > kMaxRows) {
    return BadDownload("model", "the server tells of a model of ",
                       model.vertex_count(), " vertices and ",
                       model.face_count(), " faces in ", model.dimension(),
                       "D");
  }
  model_ = model;
  position_bytes_ = static_cast<int64_t>(model.vertex_count()) *
                    model.dimension() * int64_t{sizeof(double)};
  bytes_ = ChunkedBytes(
      "model", position_bytes_ + static_cast<int64_t>(model.face_count()) * 3 *
                                     int64_t{sizeof(int32_t)});
  return absl::OkStatus();
}

absl::Status ModelDownload::Add(const v1::DownloadModelResponse& part) {
  if (model_) return bytes_.Add(part.chunk());
  if (part.has_model()) return Begin(part.model());
  return BadDownload("model", "chunks come before their model");
}

absl::StatusOr<ModelArrays> ModelDownload::Finish() && {
  DEFORM_RETURN_IF_ERROR(bytes_.CheckComplete());
  if (!model_) return BadDownload("model", "the server sent no model");
  const auto dimension = static_cast<int>(model_->dimension());
  const auto vertices = static_cast<int64_t>(model_->vertex_count());
  ModelArrays arrays(
      dimension, Positions::Zero(vertices, 3),
      Faces::Zero(static_cast<int64_t>(model_->face_count()), 3));
  const int64_t row_bytes = dimension * int64_t{sizeof(double)};
  for (int64_t i = 0; i < vertices; ++i) {
    std::memcpy(arrays.positions.row(i).data(),
                bytes_.bytes().data() + i * row_bytes, row_bytes);
  }
  // Not memcpy: without faces there may be no address.
  bytes_.bytes().copy(reinterpret_cast<char*>(arrays.faces.data()),
                      total() - position_bytes_, position_bytes_);
  return arrays;
}

}  // namespace deform
