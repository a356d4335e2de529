#include "server/sessions/batch_scheduler.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/deform/deformer.h"
#include "server/sessions/session.h"

namespace deform::server {
namespace {

// Encoding fewer points than this is not worth sharing among threads.
constexpr int64_t kParallelPoints = 1 << 15;

// Deforms those that have a step, one pass for each binding.
void Deform(std::vector<Session::Step>& steps, ThreadPool* pool) {
  // One binding, unless a session has changed its own since it was added.
  std::map<const Binding*, std::vector<Session::Step*>> passes;
  for (Session::Step& step : steps) {
    if (step.pose) passes[&step.deformer->binding()].push_back(&step);
  }
  for (const auto& [binding, members] : passes) {
    std::vector<DeformJob> jobs;
    for (Session::Step* step : members) {
      jobs.push_back({.deformer = step->deformer, .pose = &step->pose->pose});
    }
    const auto begin = std::chrono::steady_clock::now();
    MoveTogether(jobs, pool);
    const auto time = std::chrono::steady_clock::now() - begin;
    for (size_t k = 0; k < members.size(); ++k) {
      members[k]->report = jobs[k].report;
      members[k]->deform_time =
          std::chrono::duration_cast<std::chrono::microseconds>(time);
    }
  }
}

}  // namespace

int64_t BatchScheduler::SessionsPerPass(const BindingFacts& binding) {
  const int64_t products =
      std::max<int64_t>(1, binding.point_count() * binding.column_count());
  return std::clamp<int64_t>(kMaxProducts / products, 1, kMaxSessions);
}

void BatchScheduler::Add(std::shared_ptr<Session> session,
                         const Binding& binding) {
  MutexLock lock(mutex_);
  const auto [group, is_new] = groups_.try_emplace(&binding);
  if (is_new) {
    group->second = turns_.insert(
        turns_.end(),
        {.binding = &binding,
         .at_once = std::min(options_.max_sessions, SessionsPerPass(binding))});
  }
  group->second->waiting.push_back(std::move(session));
  if (running_ < options_.concurrent) {
    ++running_;
    Start();
  }
}

void BatchScheduler::Start() {
  options_.executor([this] { Work(); });
}

void BatchScheduler::Work() {
  {
    const Sessions sessions = Take();
    Run(sessions);
  }
  MutexLock lock(mutex_);
  if (turns_.empty()) {
    --running_;
  } else {
    Start();
  }
}

BatchScheduler::Sessions BatchScheduler::Take() {
  MutexLock lock(mutex_);
  if (turns_.empty()) return {};
  const auto group = turns_.begin();
  auto& waiting = group->waiting;
  const auto count =
      std::min<int64_t>(group->at_once, static_cast<int64_t>(waiting.size()));
  Sessions sessions(std::make_move_iterator(waiting.begin()),
                    std::make_move_iterator(waiting.begin() + count));
  waiting.erase(waiting.begin(), waiting.begin() + count);
  if (waiting.empty()) {
    groups_.erase(group->binding);
    turns_.erase(group);
  } else {
    turns_.splice(turns_.end(), turns_, group);
  }
  return sessions;
}

void BatchScheduler::Run(const Sessions& sessions) {
  std::vector<Session::Step> steps;
  steps.reserve(sessions.size());
  int64_t points = 0;
  for (const auto& session : sessions) {
    steps.push_back(session->BeginStep());
    points += steps.back().deformer->binding().point_count();
  }
  Deform(steps, options_.pool);
  // Each is sent as soon as it is encoded; other batches go on meanwhile.
  const auto finish = [&](int64_t i) {
    sessions[i]->FinishStep(std::move(steps[i]), options_.pool);
  };
  const auto count = static_cast<int64_t>(sessions.size());
  if (options_.pool != nullptr && count > 1 && points > kParallelPoints) {
    options_.pool->ParallelFor(count, nullptr, finish);
  } else {
    for (int64_t i = 0; i < count; ++i) finish(i);
  }
}

}  // namespace deform::server
