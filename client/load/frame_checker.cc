#include "client/load/frame_checker.h"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace deform {
namespace {

constexpr int kNiceness = 10;

}  // namespace

FrameChecker::FrameChecker(
    std::function<FrameJudge::Verdict(const FrameToCheck&)> judge,
    std::function<void()> wrong)
    : judge_(std::move(judge)), wrong_(std::move(wrong)), thread_([this] {
        // On Linux of this thread only.
        setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)),
                    kNiceness);
        Work();
      }) {}

FrameChecker::~FrameChecker() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.NotifyAll();
  thread_.join();
}

void FrameChecker::Check(FrameToCheck frame, int64_t points) {
  {
    MutexLock lock(mutex_);
    if (waiting_.size() >= kMaxWaiting) {
      ++findings_.dropped;
      return;
    }
    waiting_.push_back({std::move(frame), points});
  }
  changed_.NotifyAll();
}

FrameChecker::Findings FrameChecker::Finish() {
  MutexLock lock(mutex_);
  while (busy_ || !waiting_.empty()) changed_.Wait(mutex_);
  return findings_;
}

void FrameChecker::Work() {
  MutexLock lock(mutex_);
  while (true) {
    while (waiting_.empty() && !stopping_) changed_.Wait(mutex_);
    if (waiting_.empty()) return;
    const Item item = std::move(waiting_.front());
    waiting_.pop_front();
    busy_ = true;
    mutex_.Unlock();
    const FrameJudge::Verdict verdict = judge_(item.frame);
    mutex_.Lock();
    busy_ = false;
    ++findings_.frames;
    findings_.points += item.points;
    const bool first = !verdict.ok && !findings_.wrong;
    if (first) {
      findings_.wrong = {item.frame.session, item.frame.frame.revision,
                         verdict.vertex, verdict.error};
    } else if (verdict.ok) {
      findings_.worst = std::max(findings_.worst, verdict.error);
    }
    mutex_.Unlock();
    if (first) wrong_();
    changed_.NotifyAll();
    mutex_.Lock();
  }
}

}  // namespace deform
