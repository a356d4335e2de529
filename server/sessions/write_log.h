// Who wrote which vertex last, and since which revision others can know.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/deform/pose.h"

namespace deform::server {

// Finds writers who did not know of each other. Per vertex it keeps the newest
// write and the newest by somebody else than its writer: enough to tell, for
// any participant, when others wrote last. Not thread-safe.
class WriteLog {
 public:
  // Revisions remembered. A base older than these counts as knowing of nothing.
  static constexpr size_t kMaxRevisions = 1024;

  // `rows` of a pose, and its stretch blend as one more.
  explicit WriteLog(int64_t rows) : rows_(rows + 1) {}

  // Accepted, to be part of a coming revision. Returns its number: writes count
  // from 1.
  uint64_t Wrote(int64_t who, const PoseUpdate& update);
  // The revision contains all writes up to this number. Revisions rise.
  void Published(uint64_t revision, uint64_t writes);

  // The first vertex of `update` that another than `who` has written after
  // revision `base`: -1 for the stretch blend.
  std::optional<int32_t> Conflict(int64_t who, const PoseUpdate& update,
                                  uint64_t base) const;

  uint64_t writes() const { return writes_; }

  // The rig has changed: `previous` tells of each row which one it was before,
  // or -1.
  void Renumber(std::span<const int32_t> previous);

 private:
  struct Write {
    int64_t who = 0;
    uint64_t number = 0;
  };
  struct Row {
    Write newest;
    Write other;  // The newest by another than newest.who.
  };

  uint64_t WritesIn(uint64_t revision) const;
  // Of the newest write by another than `who`; 0 if there is none.
  static uint64_t ByOthers(const Row& row, int64_t who);

  std::vector<Row> rows_;
  uint64_t writes_ = 0;
  // Revision and writes, oldest first.
  std::deque<std::pair<uint64_t, uint64_t>> published_;
};

}  // namespace deform::server
