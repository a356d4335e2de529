#include "server/sessions/write_log.h"

#include <algorithm>

namespace deform::server {
namespace {

// Calls `function` with each row that `update` writes, the blend's last, until
// it returns true; then returns that.
template <typename Function>
bool AnyRow(const PoseUpdate& update, size_t blend, Function function) {
  if (update.vertices.empty()) {
    for (int64_t i = 0; i < update.positions.rows(); ++i) {
      if (function(static_cast<size_t>(i))) return true;
    }
  }
  for (const int32_t vertex : update.vertices) {
    if (function(static_cast<size_t>(vertex))) return true;
  }
  return update.stretch_blend && function(blend);
}

}  // namespace

uint64_t WriteLog::Wrote(int64_t who, const PoseUpdate& update) {
  ++writes_;
  AnyRow(update, rows_.size() - 1, [&](size_t i) {
    Row& row = rows_[i];
    if (row.newest.who != who) row.other = row.newest;
    row.newest = {.who = who, .number = writes_};
    return false;
  });
  return writes_;
}

void WriteLog::Published(uint64_t revision, uint64_t writes) {
  published_.emplace_back(revision, writes);
  if (published_.size() > kMaxRevisions) published_.pop_front();
}

uint64_t WriteLog::WritesIn(uint64_t revision) const {
  const auto after = std::upper_bound(
      published_.begin(), published_.end(), revision,
      [](uint64_t wanted, const auto& entry) { return wanted < entry.first; });
  return after == published_.begin() ? 0 : std::prev(after)->second;
}

uint64_t WriteLog::ByOthers(const Row& row, int64_t who) {
  return row.newest.who == who ? row.other.number : row.newest.number;
}

std::optional<int32_t> WriteLog::Conflict(int64_t who, const PoseUpdate& update,
                                          uint64_t base) const {
  const uint64_t known = WritesIn(base);
  const size_t blend = rows_.size() - 1;
  std::optional<int32_t> conflict;
  AnyRow(update, blend, [&](size_t i) {
    if (ByOthers(rows_[i], who) <= known) return false;
    conflict = i == blend ? -1 : static_cast<int32_t>(i);
    return true;
  });
  return conflict;
}

void WriteLog::Renumber(std::span<const int32_t> previous) {
  std::vector<Row> renumbered(previous.size() + 1);
  for (size_t k = 0; k < previous.size(); ++k) {
    if (previous[k] >= 0) renumbered[k] = rows_[previous[k]];
  }
  renumbered.back() = rows_.back();
  rows_.swap(renumbered);
}

}  // namespace deform::server
