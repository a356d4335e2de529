#include "core/weights/handle_edit.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

constexpr char kField[] = "edits";

// A set of handles while it is edited, by rows before the edits.
class Editing {
 public:
  explicit Editing(const Handles& handles)
      : free_(handles.free_count()),
        size_(handles.size()),
        positions_(handles.positions().topRows(free_)),
        edited_(free_, 0),
        removed_(free_, 0) {}

  absl::Status Apply(size_t number, const HandleEdit& edit) {
    const Positions place = edit.position.transpose();
    if (edit.kind != HandleEdit::Kind::kRemove) {
      DEFORM_RETURN_IF_ERROR(CheckPositions(
          place, absl::StrCat("edit ", number, ": place"), kField));
    }
    if (edit.kind == HandleEdit::Kind::kAdd) {
      added_.push_back(edit);
      return absl::OkStatus();
    }
    DEFORM_RETURN_IF_ERROR(CheckHandle(number, edit.handle));
    edited_[edit.handle] = 1;
    if (edit.kind == HandleEdit::Kind::kMove) {
      positions_.row(edit.handle) = place;
    } else {
      removed_[edit.handle] = 1;
    }
    return absl::OkStatus();
  }

  std::vector<int32_t> Previous() const {
    std::vector<int32_t> previous;
    for (int64_t k = 0; k < free_; ++k) {
      if (!removed_[k]) previous.push_back(static_cast<int32_t>(k));
    }
    previous.insert(previous.end(), added_.size(), -1);
    return previous;
  }

  Positions Free(const std::vector<int32_t>& previous) const {
    Positions positions(std::ssize(previous), 3);
    const auto left = positions.rows() - std::ssize(added_);
    for (int64_t row = 0; row < positions.rows(); ++row) {
      if (row < left) {
        positions.row(row) = positions_.row(previous[row]);
      } else {
        positions.row(row) = added_[row - left].position.transpose();
      }
    }
    return positions;
  }

  // Empty stays empty as long as it means the same.
  std::vector<double> Weights(const std::vector<double>& before,
                              const std::vector<int32_t>& previous) const {
    const bool any =
        std::any_of(added_.begin(), added_.end(),
                    [](const HandleEdit& edit) { return edit.weight != 0; });
    if (before.empty() && !any) return {};
    std::vector<double> weights;
    for (const int32_t row : previous) {
      if (row < 0) break;
      weights.push_back(before.empty() ? 0 : before[row]);
    }
    for (const HandleEdit& edit : added_) weights.push_back(edit.weight);
    return weights;
  }

 private:
  absl::Status CheckHandle(size_t number, int64_t handle) const {
    if (handle >= free_ && handle < size_) {
      return InvalidInput(
          "FIXED_HANDLE", kField,
          absl::StrCat("edit ", number, " names handle ", handle,
                       ", which is fixed, as all from ", free_, " on"));
    }
    if (handle < 0 || handle >= free_) {
      return InvalidInput("INDEX_OUT_OF_RANGE", kField,
                          absl::StrCat("edit ", number, " names handle ",
                                       handle, " of ", free_));
    }
    if (edited_[handle]) {
      return InvalidInput("HANDLE_EDITED_TWICE", kField,
                          absl::StrCat("edit ", number, " names handle ",
                                       handle, " again; once is enough"));
    }
    return absl::OkStatus();
  }

  const int64_t free_;
  const int64_t size_;
  Positions positions_;
  std::vector<char> edited_;
  std::vector<char> removed_;
  std::vector<HandleEdit> added_;
};

}  // namespace

absl::StatusOr<EditedHandles> EditHandles(const Handles& handles,
                                          const SchemeOptions& options,
                                          std::span<const HandleEdit> edits) {
  if (edits.empty()) {
    return InvalidInput("NO_EDITS", kField,
                        "there are no edits: add, move or remove a handle");
  }
  Editing editing(handles);
  for (size_t i = 0; i < edits.size(); ++i) {
    DEFORM_RETURN_IF_ERROR(editing.Apply(i, edits[i]));
  }
  std::vector<int32_t> previous = editing.Previous();
  DEFORM_ASSIGN_OR_RETURN(
      Handles edited,
      Handles::Create(handles.dimension(), editing.Free(previous),
                      handles.positions().bottomRows(handles.fixed_count())));
  SchemeOptions edited_options = options;
  edited_options.handle_weights =
      editing.Weights(options.handle_weights, previous);
  return EditedHandles{std::move(edited), std::move(edited_options),
                       std::move(previous)};
}

}  // namespace deform
