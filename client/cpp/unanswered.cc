#include "client/cpp/unanswered.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform {

absl::Status Unanswered::Add(uint64_t sequence, v1::DeformRequest request) {
  const size_t bytes = request.ByteSizeLong();
  if (entries_.size() >= kMaxRequests || bytes_ + bytes > kMaxBytes) {
    return MakeError(
        absl::StatusCode::kResourceExhausted,
        absl::StrCat(entries_.size(), " requests of ", bytes_,
                     " bytes wait for an answer, as many as may: read frames"),
        {.reason = "UNANSWERED_LIMIT"});
  }
  bytes_ += bytes;
  if (sequence != 0) last_ = sequence;
  entries_.push_back(
      {.sequence = sequence,
       .request = std::make_shared<const v1::DeformRequest>(std::move(request)),
       .bytes = bytes});
  return absl::OkStatus();
}

Unanswered::Request Unanswered::TakeUnsent() {
  if (!has_unsent()) return nullptr;
  Request request = entries_[sent_].request;
  if (entries_[sent_].sequence == 0) {
    Erase(sent_);
  } else {
    ++sent_;
  }
  return request;
}

void Unanswered::Erase(size_t index) {
  bytes_ -= entries_[index].bytes;
  entries_.erase(entries_.begin() + static_cast<int64_t>(index));
  if (index < sent_) --sent_;
}

void Unanswered::AnsweredUpTo(uint64_t sequence, uint64_t revision) {
  while (sent_ > 0 && entries_.front().sequence <= sequence) {
    if (entries_.front().request->has_pose()) {
      answered_.push_back(entries_.front());
      answered_.back().revision = revision;
      answered_bytes_ += answered_.back().bytes;
    }
    Erase(0);
  }
  while (answered_.size() > kMaxAnswered ||
         answered_bytes_ > kMaxAnsweredBytes) {
    ForgetOldestAnswered();
  }
}

void Unanswered::DurableUpTo(uint64_t revision) {
  while (!answered_.empty() && answered_.front().revision <= revision) {
    ForgetOldestAnswered();
  }
}

void Unanswered::ForgetOldestAnswered() {
  answered_bytes_ -= answered_.front().bytes;
  answered_.pop_front();
}

bool Unanswered::Answered(uint64_t sequence) {
  for (size_t i = 0; i < sent_; ++i) {
    if (entries_[i].sequence != sequence) continue;
    Erase(i);
    return true;
  }
  return false;
}

uint64_t Unanswered::answered_up_to() const {
  for (const Entry& entry : entries_) {
    if (entry.sequence != 0) return entry.sequence - 1;
  }
  return last_;
}

void Unanswered::Rejoined(uint64_t accepted, bool restarted) {
  while (restarted && !answered_.empty()) {
    if (answered_.back().sequence > accepted) {
      bytes_ += answered_.back().bytes;
      entries_.push_front(std::move(answered_.back()));
    }
    answered_.pop_back();
  }
  if (restarted) answered_bytes_ = 0;
  for (size_t i = entries_.size(); i-- > 0;) {
    if (entries_[i].sequence == 0) Erase(i);
  }
  sent_ = 0;
  while (sent_ < entries_.size() && entries_[sent_].sequence <= accepted) {
    ++sent_;
  }
}

bool Unanswered::CountRigChangesFrom(uint64_t base,
                                     v1::DeformRequest& request) {
  const auto rebase = [base](auto* message) {
    if (message->rig_changes() < base) return false;
    message->set_rig_changes(message->rig_changes() - base);
    return true;
  };
  if (request.has_pose()) return rebase(request.mutable_pose());
  if (request.has_lock()) return rebase(request.mutable_lock());
  if (request.has_unlock()) return rebase(request.mutable_unlock());
  return true;
}

bool Unanswered::CountRigChangesFrom(uint64_t base) {
  if (base == 0) return true;
  for (Entry& entry : entries_) {
    v1::DeformRequest request = *entry.request;
    if (!CountRigChangesFrom(base, request)) return false;
    entry.request =
        std::make_shared<const v1::DeformRequest>(std::move(request));
  }
  return true;
}

}  // namespace deform
