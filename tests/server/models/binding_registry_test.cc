#include "server/models/binding_registry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "core/base/error.h"
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
  ModelRegistry models_{
      {.model_bytes = 1 << 20, .memory = 1 << 20, .count = 10}};
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
  EXPECT_EQ(
      DetailOf(models_.catalogue().Remove("t", model_id_).status()).reason,
      "MODEL_IN_USE");
  bind_.Permit(1);
  const auto created = *waiter->Wait(kLong).value();
  const absl::Status in_use =
      models_.catalogue().Remove("t", model_id_).status();
  EXPECT_THAT(std::string(in_use.message()),
              HasSubstr("is used by binding " + created.record->id));
}

TEST_F(BindingRegistryTest, LetsTheModelGoWithItsBinding) {
  bind_.Permit(1);
  const std::string id =
      (*bindings_->Create(Spec()).value()->Wait(kLong).value()).record->id;
  ASSERT_TRUE(bindings_->catalogue().Remove("t", id).ok());
  EXPECT_TRUE(models_.catalogue().Remove("t", model_id_).ok());
  EXPECT_EQ(bindings_->budget().used(), 0);
}

TEST_F(BindingRegistryTest, AFailedComputationLeavesNothing) {
  bind_.Permit(1);
  // The ball of radius 1 sticks out of this cage.
  const auto failed = bindings_->Create(Spec(0.5)).value()->Wait(kLong).value();
  EXPECT_EQ(failed.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(bindings_->budget().used(), 0);
  EXPECT_TRUE(models_.catalogue().Remove("t", model_id_).ok());
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
  EXPECT_GE(bindings_->budget().used(),
            created.record->binding->weights().bytes());
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

TEST_F(BindingRegistryTest, EndsWhileComputing) {
  auto waiter = bindings_->Create(Spec()).value();
  bind_.AwaitBegun(1);
  waiter.reset();
  bindings_.reset();
  bind_.AwaitCancelled(1);
}

}  // namespace
}  // namespace deform::server
