#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/models/binding_registry.h"
#include "server/models/model_registry.h"
#include "server/sessions/batch_scheduler.h"
#include "server/sessions/session.h"
#include "tests/bench/benches.h"
#include "tests/bench/contest.h"
#include "tests/bench/scenes.h"
#include "tests/server/stores/memory_store.h"

namespace deform::bench {
namespace {

using server::BatchScheduler;
using server::BindingRegistry;
using server::Delivery;
using server::FrameToSend;
using server::ModelRegistry;
using server::Participant;
using server::Receiver;
using server::Session;

// Answers every frame with the next pose until it has seen so many.
class Player : public Receiver {
 public:
  void Join(const std::shared_ptr<Session>& session,
            const std::shared_ptr<Player>& self) {
    auto joined = session->Join(Delivery::kLatest, server::FrameWishes{}, self);
    MutexLock lock(mutex_);
    pose_ = {.positions = joined->pose.vertices};
    participant_ = std::move(joined->participant);
    Continue();
  }
  void Wake() override {
    MutexLock lock(mutex_);
    if (participant_ != nullptr) Continue();
  }
  void Play(int64_t frames) {
    MutexLock lock(mutex_);
    left_ = frames;
    Send();
  }
  void Await() {
    MutexLock lock(mutex_);
    while (left_ > 0) done_.Wait(mutex_);
  }
  void Leave() {
    MutexLock lock(mutex_);
    participant_ = nullptr;
  }

 private:
  void Continue() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    while (const auto next = participant_->Take()) {
      if (!std::holds_alternative<FrameToSend>(*next) || left_ == 0) continue;
      if (--left_ == 0) {
        done_.NotifyAll();
      } else {
        Send();
      }
    }
  }
  // Every vertex moves: no step is a small one.
  void Send() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    pose_.positions.col(2) *= sent_ % 2 == 0 ? 1.01 : 1 / 1.01;
    participant_->Submit(++sent_, pose_);
  }

  Mutex mutex_;
  CondVar done_;
  std::unique_ptr<Participant> participant_ ABSL_GUARDED_BY(mutex_);
  PoseUpdate pose_ ABSL_GUARDED_BY(mutex_);
  uint64_t sent_ ABSL_GUARDED_BY(mutex_) = 0;
  int64_t left_ ABSL_GUARDED_BY(mutex_) = 0;
};

// All sessions of one scheduler.
class House {
 public:
  House(BindingRegistry& bindings, const std::string& binding_id, int count,
        int64_t at_once)
      : scheduler_(
            {.executor = [this](auto task) { pool_->Submit(std::move(task)); },
             .pool = pool_.get(),
             .concurrent = pool_->threads(),
             .max_sessions = at_once}) {
    for (int i = 0; i < count; ++i) {
      const auto session = Session::Create(
          absl::StrCat("s", i),
          bindings.Use("t", binding_id, "session").value(), {},
          {.scheduler = &scheduler_,
           .clock = [] { return std::chrono::steady_clock::now(); }});
      players_.push_back(std::make_shared<Player>());
      players_.back()->Join(session, players_.back());
    }
  }
  ~House() {
    for (const auto& player : players_) player->Leave();
    pool_.reset();
  }
  void Play(int64_t frames) {
    for (const auto& player : players_) player->Play(frames);
    for (const auto& player : players_) player->Await();
  }

 private:
  std::unique_ptr<ThreadPool> pool_ =
      std::make_unique<ThreadPool>(ThreadPool::Options{});
  BatchScheduler scheduler_;
  std::vector<std::shared_ptr<Player>> players_;
};

// The binding of an organ in a cage, in registries as a server has them.
class Bound {
 public:
  Bound(int64_t points, const Cage& cage) {
    const auto model =
        models_
            .Register("t", "",
                      Mesh::Create(3, 0.5 * OrganPoints(points), {}).value())
            .value();
    const auto waiter = bindings_
                            .Create({.tenant = "t",
                                     .model_id = model.record->id,
                                     .rig = cage,
                                     .scheme = "green"})
                            .value();
    id = waiter->Wait(std::chrono::hours(1)).value().value().record->id;
  }
  BindingRegistry& bindings() { return bindings_; }

  std::string id;

 private:
  const std::unique_ptr<server::Store> store_ = server::MemoryStore();
  ModelRegistry models_{
      {.model_bytes = 1 << 28, .memory = 1 << 28, .count = 10}, *store_};
  ThreadPool binds_{{}};
  BindingRegistry bindings_{models_,
                            binds_,
                            {.memory = int64_t{1} << 31,
                             .count = 10,
                             .concurrent = 1,
                             .waiting_calls = 1}};
};

void Measure(int sessions, int64_t points, const Cage& cage, int64_t frames,
             const Settings& settings, const AddRow& add) {
  const std::string scene =
      absl::StrCat("sessions ", sessions, " x ", points, " points, ",
                   cage.vertex_count() + cage.face_count(), " columns");
  if (!settings.Wants(scene)) return;
  Bound bound(points, cage);
  House alone(bound.bindings(), bound.id, sessions, 1);
  House together(bound.bindings(), bound.id, sessions,
                 BatchScheduler::kMaxSessions);
  Contest contest;
  const auto steps = static_cast<double>(sessions * frames);
  const auto play = [&](const char* name, House& house) {
    contest.Add(
        name, [&] { house.Play(frames); }, steps, Contest::Clock::kWall);
  };
  play("one at a time, all cores", alone);
  play("this, batched, all cores", together);
  contest.Run(5, settings.Seconds(5));
  for (const std::string& name : contest.Names()) {
    const double seconds = contest.Best(name);
    add({.name = absl::StrCat(scene, "/", name),
         .seconds = seconds,
         .rate = 1 / seconds,
         .unit = "steps/s",
         .to_naive = contest.Best("one at a time, all cores") / seconds});
  }
}

}  // namespace

void MeasureSessions(const Settings& settings, const AddRow& add) {
  Measure(100, settings.Points(1000), OrganCage(2, 7), 20, settings, add);
  Measure(8, settings.Points(settings.quick ? 40'000 : 173'000),
          OrganCage(9, 12), 4, settings, add);
}

}  // namespace deform::bench
