#include "server/models/binding_registry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "core/base/error.h"
#include "tests/server/stores/memory_store.h"
#include "tests/support/shapes.h"

namespace deform::server {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

// Tests that hang are ended by this; none waits for it.
constexpr milliseconds kLong{60'000};

// Bind() that waits for a permit or a cancellation before it computes.
class GatedBind {
 public:
  absl::StatusOr<std::shared_ptr<const Binding>> operator()(
      const BindRequest& request, const BindControl& control) {
    MutexLock lock(mutex_);
    ++begun_;
    changed_.NotifyAll();
    while (permits_ == 0 && !control.cancellation->cancelled()) {
      // A cancellation wakes nobody up.
      changed_.WaitFor(mutex_, milliseconds(1));
    }
    if (control.cancellation->cancelled()) {
      ++cancelled_;
      changed_.NotifyAll();
      return absl::CancelledError();
    }
    --permits_;
    return Bind(request, control);
  }

  void Permit(int count) {
    MutexLock lock(mutex_);
    permits_ += count;
    changed_.NotifyAll();
  }
  void AwaitBegun(int count) {
    MutexLock lock(mutex_);
    while (begun_ < count) changed_.Wait(mutex_);
  }
  void AwaitCancelled(int count) {
    MutexLock lock(mutex_);
    while (cancelled_ < count) changed_.Wait(mutex_);
  }
  int begun() {
    MutexLock lock(mutex_);
    return begun_;
  }

 private:
  Mutex mutex_;
  CondVar changed_;
  int permits_ = 0;
  int begun_ = 0;
  int cancelled_ = 0;
};

class BindingRegistryTest : public testing::Test {
 protected:
  BindingRegistryTest() { Restart(kLimits); }

  void Restart(const BindingRegistry::Limits& limits) {
    bindings_.emplace(models_, pool_, limits,
                      [this](const BindRequest& r, const BindControl& c) {
                        return bind_(r, c);
                      });
  }

  // The id of what `spec` asks for.
  std::string IdOf(const BindSpec& spec) {
    bind_.Permit(1);
    return bindings_->Create(spec)
        .value()
        ->Wait(kLong)
        .value()
        .value()
        .record->id;
  }

  BindSpec Spec(double cage_size = 2) {
    return {.tenant = "t",
            .model_id = model_id_,
            .rig = CageOf(
                Cuboid(Vec3::Constant(-cage_size), Vec3::Constant(cage_size))),
            .scheme = "green"};
  }

  static constexpr BindingRegistry::Limits kLimits = {
      .memory = 1 << 20, .count = 10, .concurrent = 1, .waiting_calls = 3};

  ThreadPool pool_{{.threads = 3}};
  const std::unique_ptr<Store> store_ = MemoryStore();
  ModelRegistry models_{
      {.model_bytes = 1 << 20, .memory = 1 << 20, .count = 10}, *store_};
  const std::string model_id_ =
      models_.Register("t", "", MeshOf(Icosphere(1, 1))).value().record->id;
  GatedBind bind_;
  std::optional<BindingRegistry> bindings_;
};

TEST_F(BindingRegistryTest, ComputesABindingOnce) {
  bind_.Permit(1);
  const auto first = *bindings_->Create(Spec()).value()->Wait(kLong).value();
  EXPECT_FALSE(first.existed);
  EXPECT_EQ(first.record->model_id, model_id_);
  const auto again = *bindings_->Create(Spec()).value()->Wait(kLong).value();
  EXPECT_TRUE(again.existed);
  EXPECT_EQ(again.record, first.record);
  EXPECT_EQ(bind_.begun(), 1);
}

TEST_F(BindingRegistryTest, DifferentRigsAreDifferentBindings) {
  bind_.Permit(2);
  const auto a = *bindings_->Create(Spec(2)).value()->Wait(kLong).value();
  const auto b = *bindings_->Create(Spec(3)).value()->Wait(kLong).value();
  EXPECT_NE(a.record->id, b.record->id);
}

TEST_F(BindingRegistryTest, ClampedPointsAndFixedHandlesAreContent) {
  BindSpec spec = Spec();
  const std::string plain = IdOf(spec);
  spec.clamped = {3};
  EXPECT_NE(IdOf(spec), plain);
  // The same places, of which the last rest.
  const Positions places = RestVertices(Spec().rig);
  spec.scheme = "s_cc";
  spec.rig = Handles::Create(3, places).value();
  const std::string free = IdOf(spec);
  spec.rig =
      Handles::Create(3, places.topRows(7), places.bottomRows(1)).value();
  EXPECT_NE(IdOf(spec), free);
}

TEST_F(BindingRegistryTest, CallsThatAskTheSameShareOneComputation) {
  const auto first = bindings_->Create(Spec()).value();
  const auto second = bindings_->Create(Spec()).value();
  bind_.Permit(1);
  const auto a = *first->Wait(kLong).value();
  const auto b = *second->Wait(kLong).value();
  EXPECT_EQ(a.record, b.record);
  EXPECT_EQ(bind_.begun(), 1);
}

TEST_F(BindingRegistryTest, GoesOnWhileOneCallWaits) {
  auto first = bindings_->Create(Spec()).value();
  const auto second = bindings_->Create(Spec()).value();
  bind_.AwaitBegun(1);
  first.reset();
  bind_.Permit(1);
  EXPECT_TRUE(second->Wait(kLong).value().ok());
}

TEST_F(BindingRegistryTest, StopsWhenTheLastCallLeaves) {
  auto only = bindings_->Create(Spec()).value();
  bind_.AwaitBegun(1);
  only.reset();
  bind_.AwaitCancelled(1);
  // Who comes later does not inherit the cancellation.
  bind_.Permit(1);
  EXPECT_TRUE(bindings_->Create(Spec()).value()->Wait(kLong).value().ok());
}

TEST_F(BindingRegistryTest, ForgetsWhatWaitedForItsTurnInVain) {
  const auto running = bindings_->Create(Spec(2)).value();
  const int64_t used = bindings_->budget().used();
  bind_.AwaitBegun(1);
  bindings_->Create(Spec(3)).value().reset();
  EXPECT_EQ(bindings_->budget().used(), used);
  bind_.Permit(1);
  ASSERT_TRUE(running->Wait(kLong).value().ok());
  EXPECT_EQ(bind_.begun(), 1);
}

TEST_F(BindingRegistryTest, ComputesAtMostAsManyAtATimeAsItMay) {
  const auto first = bindings_->Create(Spec(2)).value();
  const auto second = bindings_->Create(Spec(3)).value();
  bind_.AwaitBegun(1);
  EXPECT_FALSE(second->Wait(milliseconds(0)).has_value());
  EXPECT_EQ(bind_.begun(), 1);
  bind_.Permit(2);
  EXPECT_TRUE(first->Wait(kLong).value().ok());
  EXPECT_TRUE(second->Wait(kLong).value().ok());
}

TEST_F(BindingRegistryTest, RefusesMoreWaitingCallsThanItMayHave) {
  const auto a = bindings_->Create(Spec(2)).value();
  const auto b = bindings_->Create(Spec(3)).value();
  const auto c = bindings_->Create(Spec(3)).value();
  const absl::Status refused = bindings_->Create(Spec(4)).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(refused.message(),
            "3 calls wait for bindings (max-waiting-binds): try again later");
  EXPECT_EQ(DetailOf(refused).reason, "TOO_MANY_BINDS");
}

TEST_F(BindingRegistryTest, KeepsTheModelWhileItsBindingIsComputedAndKept) {
  const auto waiter = bindings_->Create(Spec()).value();
  EXPECT_EQ(DetailOf(models_.Remove("t", model_id_)).reason, "MODEL_IN_USE");
  bind_.Permit(1);
  const auto created = *waiter->Wait(kLong).value();
  const absl::Status in_use = models_.Remove("t", model_id_);
  EXPECT_THAT(std::string(in_use.message()),
              HasSubstr("is used by binding " + created.record->id));
}

TEST_F(BindingRegistryTest, LetsTheModelGoWithItsBinding) {
  bind_.Permit(1);
  const std::string id =
      (*bindings_->Create(Spec()).value()->Wait(kLong).value()).record->id;
  ASSERT_TRUE(bindings_->Remove("t", id).ok());
  EXPECT_TRUE(models_.Remove("t", model_id_).ok());
  EXPECT_EQ(bindings_->budget().used(), 0);
}

TEST_F(BindingRegistryTest, AFailedComputationLeavesNothing) {
  bind_.Permit(1);
  // The ball of radius 1 sticks out of this cage.
  const auto failed = bindings_->Create(Spec(0.5)).value()->Wait(kLong).value();
  EXPECT_EQ(failed.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(bindings_->budget().used(), 0);
  EXPECT_TRUE(models_.Remove("t", model_id_).ok());
}

TEST_F(BindingRegistryTest, RefusesWeightsBeyondTheMemoryLimit) {
  Restart({.memory = 1000, .count = 10, .concurrent = 1, .waiting_calls = 3});
  const absl::Status refused = bindings_->Create(Spec()).status();
  EXPECT_EQ(DetailOf(refused).reason, "MEMORY_LIMIT");
  EXPECT_EQ(DetailOf(refused).field, "max-bindings-memory");
  EXPECT_THAT(std::string(refused.message()), HasSubstr("the binding needs"));
}

TEST_F(BindingRegistryTest, ReservesWhatTheWeightsTake) {
  bind_.Permit(1);
  const auto created = *bindings_->Create(Spec()).value()->Wait(kLong).value();
  EXPECT_GE(bindings_->budget().used(), created.binding->weights().bytes());
}

TEST_F(BindingRegistryTest, NamesUnknownModelsAndSchemes) {
  BindSpec spec = Spec();
  spec.model_id = "m-1";
  EXPECT_EQ(DetailOf(bindings_->Create(std::move(spec)).status()).reason,
            "MODEL_NOT_FOUND");
  spec = Spec();
  spec.tenant = "other";
  EXPECT_EQ(DetailOf(bindings_->Create(std::move(spec)).status()).reason,
            "MODEL_NOT_FOUND");
  spec = Spec();
  spec.scheme = "blue";
  const absl::Status unknown = bindings_->Create(std::move(spec)).status();
  EXPECT_EQ(DetailOf(unknown).reason, "UNKNOWN_SCHEME");
  EXPECT_THAT(std::string(unknown.message()), HasSubstr("green"));
}

TEST_F(BindingRegistryTest, TellsHowFarItIs) {
  const auto waiter = bindings_->Create(Spec()).value();
  EXPECT_EQ(waiter->progress().points_done, 0);
  EXPECT_EQ(waiter->progress().points_total, 42);
  bind_.Permit(1);
  ASSERT_TRUE(waiter->Wait(kLong).value().ok());
  EXPECT_EQ(waiter->progress().points_done, 42);
}

// A registry whose memory holds the weights of two bindings, and what is known
// of many.
class EvictionTest : public BindingRegistryTest {
 protected:
  // 42 points in 3 tiles of 16, 8 vertices and 12 normals.
  static constexpr int64_t kWeightBytes = 48 * 20 * 4;

  EvictionTest() {
    Restart({.memory = 3 * kWeightBytes,
             .count = 10,
             .concurrent = 2,
             .waiting_calls = 4});
    bind_.Permit(2);
    a_ = Created(2);
    b_ = Created(3);
  }
  ~EvictionTest() override {
    bind_.Permit(10);
    a_ = {};
    b_ = {};
  }

  CreatedBinding Created(double cage_size) {
    return *bindings_->Create(Spec(cage_size)).value()->Wait(kLong).value();
  }
  static bool IsResident(const CreatedBinding& created) {
    return created.record->weights->state().resident;
  }
  static void LetGo(CreatedBinding& created) { created.binding = nullptr; }

  CreatedBinding a_;
  CreatedBinding b_;
};

TEST_F(EvictionTest, MakesRoomByDroppingWhatWasUnusedForLongest) {
  LetGo(b_);
  LetGo(a_);
  bind_.Permit(1);
  ASSERT_TRUE(bindings_->Create(Spec(4)).value()->Wait(kLong).value().ok());
  EXPECT_TRUE(IsResident(a_));
  EXPECT_FALSE(IsResident(b_));
}

TEST_F(EvictionTest, KeepsWhatIsInUse) {
  LetGo(b_);
  const auto user = bindings_->Use("t", b_.record->id, "session s");
  ASSERT_TRUE(user.ok());
  LetGo(a_);
  bind_.Permit(1);
  const auto c = *bindings_->Create(Spec(4)).value()->Wait(kLong).value();
  EXPECT_FALSE(IsResident(a_));
  EXPECT_TRUE(IsResident(b_));
}

TEST_F(EvictionTest, RefusesWithFiguresWhatDoesNotFitBesideWhatIsInUse) {
  LetGo(a_);
  const absl::Status refused =
      bindings_->budget()
          .Reserve(2 * kWeightBytes, "the binding needs")
          .status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  // The weights of b and what is known of both: 336 bytes each.
  EXPECT_EQ(
      refused.message(),
      "the binding needs 7.5 KiB; 4.406 KiB of 11.25 KiB "
      "(max-bindings-memory) are in use: delete what is no longer needed");
  EXPECT_EQ(DetailOf(refused).reason, "MEMORY_LIMIT");
  EXPECT_EQ(DetailOf(refused).field, "max-bindings-memory");
  EXPECT_TRUE(IsResident(a_)) << "nothing is dropped in vain";
}

TEST_F(EvictionTest, NeverGoesOverTheLimitWhileComputing) {
  LetGo(a_);
  LetGo(b_);
  const auto c = bindings_->Create(Spec(4)).value();
  const auto d = bindings_->Create(Spec(5)).value();
  bind_.AwaitBegun(4);
  EXPECT_LE(bindings_->budget().used(), bindings_->budget().limit());
  EXPECT_FALSE(IsResident(a_));
  EXPECT_FALSE(IsResident(b_));
  EXPECT_EQ(DetailOf(bindings_->Create(Spec(6)).status()).reason,
            "MEMORY_LIMIT");
}

TEST_F(EvictionTest, KnowsAllButTheWeightsOfAnEvictedBinding) {
  const double error = a_.binding->quality().reproduction_error;
  LetGo(a_);
  ASSERT_TRUE(bindings_->budget().Reserve(kWeightBytes, "others need").ok());
  const auto found = bindings_->catalogue().Find("t", a_.record->id).value();
  EXPECT_FALSE(IsResident(a_));
  EXPECT_EQ(found->weights->state().bytes, kWeightBytes);
  EXPECT_EQ(found->facts.point_count(), 42);
  EXPECT_EQ(found->facts.normal_count(), 12);
  EXPECT_GT(error, 0);
  EXPECT_EQ(found->facts.quality().reproduction_error, error);
  EXPECT_EQ(DetailOf(models_.Remove("t", model_id_)).reason, "MODEL_IN_USE");
}

TEST_F(EvictionTest, ComputesEvictedWeightsAgainToTheSameBits) {
  const WeightTiles& weights = a_.binding->weights();
  const std::vector<float> before(weights.tile(0),
                                  weights.tile(0) + kWeightBytes / 4);
  const double seconds = a_.record->facts.compute_seconds();
  LetGo(a_);
  ASSERT_TRUE(bindings_->budget().Reserve(kWeightBytes, "others need").ok());
  bind_.Permit(1);
  const auto again = bindings_->Use("t", a_.record->id, "session s").value();
  const float* after = again.binding->weights().tile(0);
  EXPECT_EQ(std::vector<float>(after, after + kWeightBytes / 4), before);
  EXPECT_EQ(again.lease.record(), a_.record);
  EXPECT_EQ(again.binding->compute_seconds(), seconds);
  EXPECT_TRUE(IsResident(a_));
}

TEST_F(EvictionTest, CreatingABindingBringsItsWeightsBack) {
  LetGo(a_);
  ASSERT_TRUE(bindings_->budget().Reserve(kWeightBytes, "others need").ok());
  bind_.Permit(1);
  const CreatedBinding again = Created(2);
  EXPECT_TRUE(again.existed);
  EXPECT_EQ(again.record, a_.record);
  EXPECT_TRUE(IsResident(a_));
}

TEST_F(EvictionTest, ThoseWhoNeedTheSameWeightsShareTheirComputation) {
  LetGo(a_);
  ASSERT_TRUE(bindings_->budget().Reserve(kWeightBytes, "others need").ok());
  const auto first = bindings_->Create(Spec(2)).value();
  absl::StatusOr<BindingInUse> second;
  std::thread other(
      [&] { second = bindings_->Use("t", a_.record->id, "session s"); });
  bind_.AwaitBegun(3);
  EXPECT_EQ(bindings_->ProgressOf(*a_.record)->points_total, 42);
  bind_.Permit(1);
  other.join();
  const auto created = *first->Wait(kLong).value();
  EXPECT_EQ(created.binding->weights().tile(0),
            second->binding->weights().tile(0));
  EXPECT_EQ(bind_.begun(), 3);
  EXPECT_FALSE(bindings_->ProgressOf(*a_.record).has_value());
}

TEST_F(EvictionTest, StopsComputingAgainWhenNobodyWaits) {
  LetGo(a_);
  ASSERT_TRUE(bindings_->budget().Reserve(kWeightBytes, "others need").ok());
  const int64_t used = bindings_->budget().used();
  const absl::Status left = bindings_
                                ->Use("t", a_.record->id, "session s",
                                      [&] {
                                        bind_.AwaitBegun(3);
                                        return false;
                                      })
                                .status();
  EXPECT_EQ(left.code(), absl::StatusCode::kCancelled);
  bind_.AwaitCancelled(1);
  // The memory comes back as soon as the job has ended.
  while (bindings_->budget().used() != used) std::this_thread::yield();
  bind_.Permit(1);
  EXPECT_TRUE(bindings_->Use("t", a_.record->id, "session s").ok());
}

TEST_F(EvictionTest, ARemovedBindingIsNotFoundByItsLastComputation) {
  LetGo(a_);
  LetGo(b_);
  ASSERT_TRUE(bindings_->budget().Reserve(kWeightBytes, "others need").ok());
  const auto before = bindings_->Create(Spec(2)).value();
  bind_.AwaitBegun(3);
  ASSERT_TRUE(bindings_->Remove("t", a_.record->id).ok());
  const auto after = bindings_->Create(Spec(2)).value();
  bind_.Permit(2);
  EXPECT_EQ((*before->Wait(kLong).value()).record, a_.record);
  const auto created = *after->Wait(kLong).value();
  EXPECT_FALSE(created.existed);
  EXPECT_NE(created.record, a_.record);
}

TEST_F(BindingRegistryTest, EndsWhileComputing) {
  auto waiter = bindings_->Create(Spec()).value();
  bind_.AwaitBegun(1);
  waiter.reset();
  bindings_.reset();
  bind_.AwaitCancelled(1);
}

}  // namespace
}  // namespace deform::server
