// Sessions without a socket: steps run when told, time passes when told.
#pragma once

#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/frames/encoding.h"
#include "server/models/binding_registry.h"
#include "server/models/model_registry.h"
#include "server/sessions/session.h"
#include "tests/server/stores/memory_store.h"
#include "tests/support/shapes.h"

namespace deform::server {

// Runs tasks one by one, on the caller's thread.
class ManualExecutor {
 public:
  Executor executor() {
    return [this](std::function<void()> task) {
      tasks_.push_back(std::move(task));
    };
  }
  bool RunOne() {
    if (tasks_.empty()) return false;
    const auto task = std::move(tasks_.front());
    tasks_.pop_front();
    task();
    return true;
  }
  // How many tasks ran.
  int RunAll() {
    int count = 0;
    while (RunOne()) ++count;
    return count;
  }
  size_t waiting() const { return tasks_.size(); }

 private:
  std::deque<std::function<void()>> tasks_;
};

class ManualClock {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  Clock clock() {
    return [this] { return now_; };
  }
  // As SessionEnvironment::call_at.
  std::function<void(TimePoint, std::function<void()>)> call_at() {
    return [this](TimePoint time, std::function<void()> task) {
      calls_.emplace(time, std::move(task));
    };
  }
  // And makes the calls that are due then.
  void Advance(std::chrono::milliseconds time) {
    now_ += time;
    while (!calls_.empty() && calls_.begin()->first <= now_) {
      const auto task = std::move(calls_.begin()->second);
      calls_.erase(calls_.begin());
      task();
    }
  }
  size_t waiting_calls() const { return calls_.size(); }

 private:
  TimePoint now_{};
  std::multimap<TimePoint, std::function<void()>> calls_;
};

class CountingReceiver : public Receiver {
 public:
  void Wake() override { ++wakes; }
  int wakes = 0;
};

// A stream that takes what it is told to.
struct FakeStream {
  std::shared_ptr<CountingReceiver> receiver =
      std::make_shared<CountingReceiver>();
  std::unique_ptr<Participant> participant;
  SessionState joined;
  Pose pose;

  FrameToSend TakeFrame() {
    const auto next = participant->Take();
    if (!next || !std::holds_alternative<FrameToSend>(*next)) {
      ADD_FAILURE() << "no frame";
      return {};
    }
    return std::get<FrameToSend>(*next);
  }
  absl::Status TakeEnd() {
    const auto next = participant->Take();
    if (!next || !std::holds_alternative<Ended>(*next)) {
      ADD_FAILURE() << "no end";
      return absl::UnknownError("no end");
    }
    return std::get<Ended>(*next).status;
  }
};

// A ball of 42 points in a cube.
inline constexpr int64_t kBallPoints = 42;
inline Cage BallCage() {
  return CageOf(Cuboid(Vec3::Constant(-1), Vec3::Constant(1)));
}

// One binding of tenant "t" and what sessions of it need.
class SessionRooms {
 public:
  SessionRooms() {
    BindSpec spec{
        .tenant = "t",
        .model_id = models_.Register("t", "", MeshOf(Icosphere(0.5, 1)))
                        .value()
                        .record->id,
        .rig = BallCage(),
        .scheme = "green"};
    binding_id = Created(std::move(spec));
  }

  // Of the same ball in a larger cage.
  std::string AnotherBinding() {
    BindSpec spec{
        .tenant = "t",
        .model_id =
            bindings_.catalogue().Find("t", binding_id).value()->model_id,
        .rig = CageOf(Cuboid(Vec3::Constant(-2), Vec3::Constant(2))),
        .scheme = "green"};
    return Created(std::move(spec));
  }

  SessionEnvironment Environment() {
    return {.scheduler = &scheduler,
            .clock = clock.clock(),
            .max_participants = 3,
            .stall_timeout = std::chrono::seconds(10),
            .call_at = clock.call_at()};
  }
  BindingRegistry& bindings() { return bindings_; }

  // Nobody uses them.
  void EvictWeights() {
    EXPECT_TRUE(bindings_.budget().Reserve(kMemory - 1000, "others need").ok());
    EXPECT_FALSE(bindings_.catalogue()
                     .Find("t", binding_id)
                     .value()
                     ->weights->state()
                     .resident);
  }
  // Computations do not begin until they are let go.
  void HoldBinding() {
    pool_.Submit([future = held_.get_future().share()] { future.wait(); });
  }
  void LetBindingGo() { held_.set_value(); }

  std::string binding_id;

 private:
  std::string Created(BindSpec spec) {
    const auto waiter = bindings_.Create(std::move(spec)).value();
    return waiter->Wait(std::chrono::minutes(1)).value().value().record->id;
  }

  static constexpr ModelRegistry::Limits kModelLimits = {
      .model_bytes = 1 << 20, .memory = 1 << 20, .count = 10};
  // Little more than two bindings of the ball take.
  static constexpr int64_t kMemory = 16'000;
  static constexpr BindingRegistry::Limits kBindingLimits = {
      .memory = kMemory, .count = 10, .concurrent = 1, .waiting_calls = 1};

  std::promise<void> held_;
  ThreadPool pool_{{.threads = 1}};
  const std::unique_ptr<Store> store_ = MemoryStore();
  ModelRegistry models_{kModelLimits, *store_};
  BindingRegistry bindings_{models_, pool_, kBindingLimits};

 public:
  ManualClock clock;
  ManualExecutor executor;
  // What it holds are sessions: it goes first.
  BatchScheduler scheduler{
      {.executor = executor.executor(), .max_sessions = 3}};
};

// The whole cage moved.
inline PoseUpdate MovedBy(const Vec3& offset) {
  Positions vertices = BallCage().vertices();
  vertices.rowwise() += offset.transpose();
  return {.positions = vertices};
}

inline PoseUpdate MoveVertex(int32_t vertex, const Vec3& to) {
  Positions position = to.transpose();
  return {.vertices = {vertex}, .positions = position};
}

// The other end of a stream: what the chunks of its frames say.
class FrameDecoder {
 public:
  // Back in model units, N x 3. Frames as they were sent: each refers to none,
  // or to the one on a grid before.
  Positions Decode(const Frame& frame) {
    const int64_t points =
        frame.chunks.back().first_vertex + frame.chunks.back().vertex_count;
    std::vector<float> all(points * frame.dimension);
    const bool on_grid = frame.encoding->uses_grid();
    Grid grid(on_grid ? points : 0);
    if (frame.reference_revision) {
      EXPECT_TRUE(held_.has_value());
      EXPECT_EQ(*frame.reference_revision, held_revision_);
    }
    for (const Frame::Chunk& chunk : frame.chunks) {
      EXPECT_TRUE(
          frame.encoding
              ->Decode(
                  {chunk.bytes.get(), static_cast<size_t>(chunk.size)},
                  {.dimension = frame.dimension,
                   .first = chunk.first_vertex,
                   .count = chunk.vertex_count,
                   .positions = std::span(all).subspan(
                       chunk.first_vertex * frame.dimension,
                       chunk.vertex_count * frame.dimension),
                   .grid = on_grid ? &grid : nullptr,
                   .reference = frame.reference_revision ? &*held_ : nullptr})
              .ok());
    }
    if (on_grid) {
      TakeOffGrid(grid, frame.held->step, *frame.order, frame.dimension, all);
      held_ = std::move(grid);
      held_revision_ = frame.info.revision;
    }
    Positions positions = Positions::Zero(points, 3);
    for (int64_t i = 0; i < points; ++i) {
      for (int c = 0; c < frame.dimension; ++c) {
        positions(i, c) = frame.info.origin[c] + all[i * frame.dimension + c];
      }
    }
    return positions;
  }

 private:
  std::optional<Grid> held_;
  uint64_t held_revision_ = 0;
};
inline Positions Decoded(const Frame& frame) {
  return FrameDecoder().Decode(frame);
}

}  // namespace deform::server
