// Sessions over a store on a simulated disk, as one server has them.
#pragma once

#include <gtest/gtest.h>

#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/sessions/session_manager.h"
#include "tests/server/models/stored_life.h"
#include "tests/server/sessions/support.h"

namespace deform::server {

// Steps run, and sessions wake up, when told.
class SessionLife {
 public:
  explicit SessionLife(SimulatedDisk& disk, const Life::Limits& limits = {})
      : life_(disk, limits) {}

  absl::StatusOr<Losses> Load() {
    auto losses = life_.Load();
    if (!losses.ok()) return losses;
    const auto contents = life_.store().Load();
    if (!contents.ok()) return contents.status();
    const auto more = sessions_.Load(contents->sessions);
    if (!more.ok()) return more;
    losses->insert(losses->end(), more->begin(), more->end());
    return losses;
  }

  // The ball of 42 points in a cube.
  absl::StatusOr<std::string> BindBall(double half_size = 1) {
    const auto model = life_.Register(MeshOf(Icosphere(0.5, 1)));
    if (!model.ok()) return model.status();
    const auto created = life_.Create(InCube(*model, half_size));
    if (!created.ok()) return created.status();
    return created->record->id;
  }
  absl::Status Create(const std::string& binding_id, const std::string& id) {
    return sessions_.Create("t", binding_id, id).status();
  }
  std::shared_ptr<Session> Find(const std::string& id) {
    return sessions_.catalogue().Find("t", id).value();
  }

  // Joins; the stream lives as long as this.
  FakeStream& Join(const std::string& id) {
    FakeStream& stream = streams_.emplace_back();
    auto joined =
        Find(id)->Join(Delivery::kLatest, FrameWishes{}, stream.receiver);
    EXPECT_TRUE(joined.ok()) << joined.status();
    stream.participant = std::move(joined->participant);
    stream.joined = joined->state;
    stream.pose = joined->pose;
    return stream;
  }
  // Until nothing is left to be done.
  void Run() {
    while (patient_.RunOne() || steps_.RunOne()) {
    }
  }
  // Until the disk has all, or has refused it.
  absl::Status Sync() { return life_.store().Sync(); }

  Life& life() { return life_; }
  SessionManager& sessions() { return sessions_; }
  ManualExecutor& patient() { return patient_; }

  Reports reported;

 private:
  SessionEnvironment Environment() {
    return {
        .scheduler = &scheduler_,
        .clock = clock_.clock(),
        .max_participants = 50,
        .stall_timeout = std::chrono::seconds(10),
        .report = [this](const absl::Status& status) { reported.Add(status); }};
  }

  Life life_;
  ManualClock clock_;
  ManualExecutor steps_;
  ManualExecutor patient_;
  BatchScheduler scheduler_{{.executor = steps_.executor()}};
  SessionManager sessions_{life_.bindings(),
                           {.memory = 1 << 24, .count = 100},
                           Environment(),
                           patient_.executor()};
  std::deque<FakeStream> streams_;
};

}  // namespace deform::server
