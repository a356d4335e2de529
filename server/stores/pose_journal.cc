#include "server/stores/pose_journal.h"

#include <algorithm>
#include <future>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/stores/store_errors.h"

namespace deform::server {
namespace {

// Nothing can follow what is lost but a whole pose.
void MoveBack(PoseHead& head) {
  head.accepted = head.durable;
  head.rows = 0;
}

}  // namespace

PoseJournal::PoseJournal(int64_t max_waiting_bytes, Commit commit)
    : max_waiting_bytes_(max_waiting_bytes),
      commit_(std::move(commit)),
      thread_([this] { Run(); }) {}

PoseJournal::~PoseJournal() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
    changed_.NotifyAll();
  }
  thread_.join();
}

void PoseJournal::Add(const StoreKey& session, const PoseHead& head) {
  MutexLock lock(mutex_);
  heads_[session] = head;
}

void PoseJournal::Remove(const StoreKey& session) {
  MutexLock lock(mutex_);
  heads_.erase(session);
}

void PoseJournal::TakeOver(const StoreKey& session, uint64_t epoch) {
  MutexLock lock(mutex_);
  const auto head = heads_.find(session);
  if (head == heads_.end()) return;
  head->second.epoch = epoch;
  MoveBack(head->second);
}

absl::Status PoseJournal::Append(PoseAppend append, Store::Done done) {
  const int64_t bytes = BytesOf(append);
  MutexLock lock(mutex_);
  const auto found = heads_.find(append.session);
  if (found == heads_.end()) return NotStored("session", append.session);
  PoseHead& head = found->second;
  DEFORM_RETURN_IF_ERROR(CheckFollows(append, append.revision - 1, head));
  if (waiting_bytes_ + bytes > max_waiting_bytes_) {
    return MakeError(
        absl::StatusCode::kResourceExhausted,
        absl::StrCat(waiting_bytes_, " bytes of poses wait for the disk, of ",
                     max_waiting_bytes_, " that may"),
        {.reason = "JOURNAL_BEHIND"});
  }
  waiting_bytes_ += bytes;
  const uint64_t after = std::exchange(head.accepted, append.revision);
  if (append.whole) head.rows = append.positions.rows();
  queue_.push_back({.session = head.session,
                    .after = after,
                    .append = std::move(append),
                    .bytes = bytes,
                    .done = std::move(done)});
  changed_.NotifyAll();
  return absl::OkStatus();
}

uint64_t PoseJournal::DurableRevision(const StoreKey& session) {
  MutexLock lock(mutex_);
  const auto head = heads_.find(session);
  return head == heads_.end() ? 0 : head->second.durable;
}

absl::Status PoseJournal::Sync() {
  const auto outcome = std::make_shared<std::promise<absl::Status>>();
  {
    MutexLock lock(mutex_);
    queue_.push_back({.done = [outcome](const absl::Status& status) {
      outcome->set_value(status);
    }});
    changed_.NotifyAll();
  }
  return outcome->get_future().get();
}

void PoseJournal::Run() {
  while (true) {
    Batch batch;
    {
      MutexLock lock(mutex_);
      while (queue_.empty() && !stopping_) changed_.Wait(mutex_);
      if (queue_.empty()) return;
      batch.swap(queue_);
    }
    std::vector<Entry> entries = FoldAll(batch);
    const absl::Status status =
        entries.empty() ? absl::OkStatus() : commit_(entries);
    Settle(entries, status, batch);
    Tell(batch, entries, status);
  }
}

void PoseJournal::Tell(const Batch& batch, const std::vector<Entry>& entries,
                       const absl::Status& status) {
  if (!status.ok()) failure_ = status;
  for (const Item& item : batch) {
    if (!item.done) continue;
    if (item.session == 0) {
      item.done(std::exchange(failure_, absl::OkStatus()));
    } else {
      item.done(status.ok() ? entries[item.entry].status : status);
    }
  }
}

std::vector<PoseJournal::Entry> PoseJournal::FoldAll(Batch& batch) {
  std::vector<Entry> entries;
  std::map<std::pair<int64_t, uint64_t>, size_t> places;  // Session, epoch.
  for (Item& item : batch) {
    if (item.session == 0) continue;
    const auto [place, first] = places.emplace(
        std::pair(item.session, item.append.epoch), entries.size());
    item.entry = place->second;
    if (first) {
      entries.push_back({.session = item.session,
                         .after = item.after,
                         .append = std::move(item.append)});
    } else {
      Fold(item.append, entries[item.entry].append);
    }
  }
  return entries;
}

void PoseJournal::Settle(const std::vector<Entry>& entries,
                         const absl::Status& status, Batch& batch) {
  MutexLock lock(mutex_);
  for (const Item& item : batch) waiting_bytes_ -= item.bytes;
  if (!status.ok()) FailWhatWaits(batch);
  for (const Entry& entry : entries) {
    const auto found = heads_.find(entry.append.session);
    if (found == heads_.end()) continue;
    PoseHead& head = found->second;
    if (head.session != entry.session) continue;
    if (status.ok() && entry.status.ok()) {
      head.durable = entry.append.revision;
      head.accepted = std::max(head.accepted, head.durable);
    } else if (head.epoch == entry.append.epoch) {
      MoveBack(head);
    }
  }
}

void PoseJournal::FailWhatWaits(Batch& batch) {
  for (Item& item : queue_) {
    const auto head = heads_.find(item.append.session);
    if (head != heads_.end()) MoveBack(head->second);
    waiting_bytes_ -= item.bytes;
    batch.push_back(std::move(item));
  }
  queue_.clear();
}

}  // namespace deform::server
