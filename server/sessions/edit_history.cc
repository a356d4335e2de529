#include "server/sessions/edit_history.h"

#include <utility>

namespace deform::server {

void EditHistory::Record(uint64_t edit, const PoseUpdate& update,
                         const Pose& pose) {
  // An edit goes on only while it is the last thing that was done.
  const bool goes_on =
      undone_.empty() && !done_.empty() && done_.back().number == edit;
  undone_.clear();
  if (!goes_on) done_.push_back({.number = edit});
  Edit& into = done_.back();
  const auto vertex = [&update](int64_t i) {
    return update.vertices.empty() ? static_cast<int32_t>(i)
                                   : update.vertices[i];
  };
  const int64_t count = update.positions.rows();
  for (int64_t i = 0; i < count; ++i) {
    const Vec3 now = pose.vertices.row(vertex(i)).transpose();
    Places& places =
        into.vertices.try_emplace(vertex(i), Places{now, now}).first->second;
    // Somebody else wrote between two poses of this edit: theirs is what was
    // before.
    if (places.after != now) places = {now, now};
  }
  for (int64_t i = 0; i < count; ++i) {
    into.vertices[vertex(i)].after = update.positions.row(i).transpose();
  }
  if (update.stretch_blend) {
    if (!into.blend || into.blend->after != pose.stretch_blend) {
      into.blend = {.before = pose.stretch_blend};
    }
    into.blend->after = *update.stretch_blend;
  }
  Trim();
}

void EditHistory::Trim() {
  size_t vertices = 0;
  for (const Edit& edit : done_) vertices += edit.vertices.size();
  while (done_.size() > 1 &&
         (done_.size() > kMaxEdits || vertices > kMaxVertices)) {
    vertices -= done_.front().vertices.size();
    done_.pop_front();
  }
}

std::optional<EditHistory::Reversal> EditHistory::Plan(Direction direction,
                                                       const Pose& pose) const {
  const bool undo = direction == Direction::kUndo;
  if (undo ? done_.empty() : undone_.empty()) return std::nullopt;
  const Edit& edit = undo ? done_.back() : undone_.back();
  Reversal reversal{.edit = edit.number};
  std::vector<Vec3> places;
  for (const auto& [vertex, place] : edit.vertices) {
    const Vec3& from = undo ? place.after : place.before;
    const Vec3& to = undo ? place.before : place.after;
    if (pose.vertices.row(vertex).transpose() != from) {
      reversal.left_out.push_back(vertex);
      continue;
    }
    reversal.update.vertices.push_back(vertex);
    places.push_back(to);
  }
  reversal.update.positions.resize(std::ssize(places), 3);
  for (size_t i = 0; i < places.size(); ++i) {
    reversal.update.positions.row(static_cast<int64_t>(i)) =
        places[i].transpose();
  }
  if (edit.blend &&
      pose.stretch_blend == (undo ? edit.blend->after : edit.blend->before)) {
    reversal.update.stretch_blend =
        undo ? edit.blend->before : edit.blend->after;
  }
  return reversal;
}

void EditHistory::Advance(Direction direction) {
  if (direction == Direction::kUndo) {
    if (done_.empty()) return;
    undone_.push_back(std::move(done_.back()));
    done_.pop_back();
  } else {
    if (undone_.empty()) return;
    done_.push_back(std::move(undone_.back()));
    undone_.pop_back();
  }
}

void EditHistory::TransferEdit(const PoseTransfer& transfer, Edit& edit) {
  std::map<int32_t, Places> next;
  for (const auto& [vertex, place] : edit.vertices) {
    PoseUpdate both{.vertices = {vertex, vertex}, .positions = Positions(2, 3)};
    both.positions << place.before.transpose(), place.after.transpose();
    const auto moved = transfer.Transfer(both);
    if (!moved.ok()) continue;  // Its handle was removed.
    next[moved->vertices[0]] = {moved->positions.row(0).transpose(),
                                moved->positions.row(1).transpose()};
  }
  edit.vertices.swap(next);
}

void EditHistory::Transfer(const PoseTransfer& transfer) {
  const auto is_empty = [](const Edit& edit) {
    return edit.vertices.empty() && !edit.blend;
  };
  for (Edit& edit : done_) TransferEdit(transfer, edit);
  for (Edit& edit : undone_) TransferEdit(transfer, edit);
  std::erase_if(done_, is_empty);
  std::erase_if(undone_, is_empty);
}

}  // namespace deform::server
