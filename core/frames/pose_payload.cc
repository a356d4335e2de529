#include "core/frames/pose_payload.h"

#include <bit>
#include <cassert>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/frames/encoding.h"

namespace deform {
namespace {

static_assert(std::endian::native == std::endian::little,
              "numbers are copied as they lie in memory");

enum Form : uint8_t { kAllRows = 0, kSomeRows = 1 };

template <typename Number>
void Append(Number number, std::vector<uint8_t>& bytes) {
  const auto* from = reinterpret_cast<const uint8_t*>(&number);
  bytes.insert(bytes.end(), from, from + sizeof(number));
}

// False if there are not so many bytes left.
template <typename Number>
bool Take(std::span<const uint8_t>& bytes, Number& number) {
  if (bytes.size() < sizeof(number)) return false;
  std::memcpy(&number, bytes.data(), sizeof(number));
  bytes = bytes.subspan(sizeof(number));
  return true;
}

// Bit by bit: 0 and -0 differ.
std::vector<int32_t> ChangedRows(const Pose& pose, const Pose& reference,
                                 int64_t rows) {
  std::vector<int32_t> changed;
  for (int64_t i = 0; i < rows; ++i) {
    if (std::memcmp(pose.vertices.row(i).data(),
                    reference.vertices.row(i).data(),
                    3 * sizeof(double)) != 0) {
      changed.push_back(static_cast<int32_t>(i));
    }
  }
  return changed;
}

absl::Status TakeRows(std::span<const uint8_t>& bytes, const PoseShape& shape,
                      std::vector<int32_t>& rows) {
  uint32_t count = 0;
  if (!Take(bytes, count)) return BadFrameData("a pose ends before its rows");
  if (count > bytes.size() / sizeof(uint32_t)) {
    return BadFrameData(
        absl::StrCat("a pose ends within its ", count, " rows"));
  }
  rows.reserve(count);
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t row = 0;
    Take(bytes, row);
    if (row >= static_cast<uint64_t>(shape.rows) ||
        (i > 0 && row <= static_cast<uint32_t>(rows.back()))) {
      return BadFrameData(absl::StrCat("row ", i, " of a pose is ", row, " of ",
                                       shape.rows,
                                       ": not rising, or beyond the last"));
    }
    rows.push_back(static_cast<int32_t>(row));
  }
  return absl::OkStatus();
}

}  // namespace

std::vector<uint8_t> EncodePose(const Pose& pose, const Pose* reference,
                                const PoseShape& shape) {
  assert(pose.vertices.rows() >= shape.rows);
  const int64_t row_bytes = shape.dimension * int64_t{sizeof(double)};
  std::vector<int32_t> changed;
  bool some = false;
  if (reference != nullptr) {
    changed = ChangedRows(pose, *reference, shape.rows);
    const auto count = static_cast<int64_t>(changed.size());
    some = 4 + count * (4 + row_bytes) < shape.rows * row_bytes;
  }
  std::vector<uint8_t> bytes;
  Append<uint8_t>(some ? kSomeRows : kAllRows, bytes);
  Append(pose.stretch_blend, bytes);
  if (some) {
    Append(static_cast<uint32_t>(changed.size()), bytes);
    for (const int32_t row : changed) Append(row, bytes);
  }
  const int64_t rows = some ? static_cast<int64_t>(changed.size()) : shape.rows;
  for (int64_t i = 0; i < rows; ++i) {
    for (int d = 0; d < shape.dimension; ++d) {
      Append(pose.vertices(some ? changed[i] : i, d), bytes);
    }
  }
  return bytes;
}

absl::StatusOr<PoseUpdate> DecodePose(std::span<const uint8_t> bytes,
                                      const PoseShape& shape) {
  uint8_t form = 0;
  double blend = 0;
  if (!Take(bytes, form) || form > kSomeRows) {
    return BadFrameData("a pose begins with neither 0 nor 1");
  }
  if (!Take(bytes, blend)) {
    return BadFrameData("a pose ends within its stretch blend");
  }
  PoseUpdate update{.stretch_blend = blend};
  int64_t rows = shape.rows;
  if (form == kSomeRows) {
    DEFORM_RETURN_IF_ERROR(TakeRows(bytes, shape, update.vertices));
    rows = static_cast<int64_t>(update.vertices.size());
  }
  const int64_t needed = rows * shape.dimension * int64_t{sizeof(double)};
  if (static_cast<int64_t>(bytes.size()) != needed) {
    return BadFrameData(absl::StrCat("a pose has ", bytes.size(),
                                     " bytes of coordinates, its ", rows,
                                     " rows need ", needed));
  }
  update.positions = Positions::Zero(rows, 3);
  for (int64_t i = 0; i < rows; ++i) {
    for (int d = 0; d < shape.dimension; ++d) {
      Take(bytes, update.positions(i, d));
    }
  }
  DEFORM_RETURN_IF_ERROR(CheckPoseUpdate(update, shape));
  return update;
}

}  // namespace deform
