#include "server/sessions/rig_moves.h"

namespace deform::server {

std::function<void(const absl::StatusOr<RigMoved>&)> RigMoves::Add(
    const std::string& session_id) {
  MutexLock lock(board_->mutex);
  const size_t place = board_->outcomes.size();
  board_->outcomes.push_back({session_id, absl::UnknownError("under way")});
  ++board_->missing;
  return [board = board_, place](const absl::StatusOr<RigMoved>& moved) {
    MutexLock told(board->mutex);
    board->outcomes[place].moved = moved;
    --board->missing;
    board->changed.NotifyAll();
  };
}

bool RigMoves::Wait(std::chrono::milliseconds timeout) const {
  const auto end = std::chrono::steady_clock::now() + timeout;
  MutexLock lock(board_->mutex);
  while (board_->missing > 0) {
    const auto left = end - std::chrono::steady_clock::now();
    if (left <= left.zero()) return false;
    board_->changed.WaitFor(board_->mutex, left);
  }
  return true;
}

std::vector<RigMoves::Outcome> RigMoves::outcomes() const {
  MutexLock lock(board_->mutex);
  return board_->outcomes;
}

}  // namespace deform::server
