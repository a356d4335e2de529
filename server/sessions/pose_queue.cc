#include "server/sessions/pose_queue.h"

#include <algorithm>
#include <utility>

namespace deform::server {

void PoseQueue::Push(const Answer& answer, const PoseUpdate& update,
                     bool own_revision) {
  if (own_revision || steps_.empty() || steps_.back().own_revision) {
    steps_.push_back(
        {.pose = newest(), .answers = {}, .own_revision = own_revision});
  }
  Step& step = steps_.back();
  ApplyPoseUpdate(update, step.pose);
  const auto answered = std::find_if(
      step.answers.begin(), step.answers.end(), [&](const Answer& other) {
        return other.participant == answer.participant;
      });
  if (answered == step.answers.end()) {
    step.answers.push_back(answer);
  } else {
    *answered = answer;
  }
}

std::optional<PoseQueue::Step> PoseQueue::Pop() {
  if (steps_.empty()) return std::nullopt;
  Step step = std::move(steps_.front());
  steps_.pop_front();
  if (steps_.empty()) pose_ = step.pose;
  return step;
}

void PoseQueue::Transfer(const PoseTransfer& transfer) {
  pose_ = transfer.Transfer(pose_);
  for (Step& step : steps_) step.pose = transfer.Transfer(step.pose);
}

int64_t PoseQueue::OwnStepsOf(int64_t participant) const {
  return std::count_if(steps_.begin(), steps_.end(), [&](const Step& step) {
    return step.own_revision && step.answers[0].participant == participant;
  });
}

}  // namespace deform::server
