#include "server/models/compressor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <optional>
#include <thread>
#include <vector>

#include "core/base/error.h"
#include "core/weights/compress_weights.h"
#include "server/models/binding_registry.h"
#include "tests/server/stores/memory_store.h"
#include "tests/support/shapes.h"

namespace deform::server {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr std::chrono::minutes kLong{1};
constexpr double kTolerance = 1e-5;

// Of no points with weights, and so of hardly any bytes.
std::shared_ptr<const Binding> Compressed(const BindingFacts& facts,
                                          double bound) {
  return std::make_shared<const Binding>(
      facts, std::make_shared<const CompressedWeights>(CompressedWeights::Parts{
                 .columns = facts.column_count(),
                 .slots = std::vector<int32_t>(facts.point_count(), -1),
                 .tolerance = kTolerance,
                 .bound = bound}));
}

// 42 points in 3 tiles of 16, 8 vertices and 12 normals.
constexpr int64_t kDenseBytes = 48 * 20 * 4;

class CompressorTest : public testing::Test {
 protected:
  CompressorTest() { Restart(1 << 20); }

  void Restart(int64_t memory, BindingRegistry::BindFunction bind = &Bind) {
    bindings_.emplace(
        models_, pool_,
        BindingRegistry::Limits{
            .memory = memory, .count = 10, .concurrent = 1, .waiting_calls = 3},
        std::move(bind), Options());
    bindings_->compressor().SetListener(
        [this](const BindingRecord& record) { told_.push_back(record.id); });
  }
  Compressor::Options Options() {
    return {.executor =
                [this](std::function<void()> task) {
                  MutexLock lock(mutex_);
                  tasks_.push_back(std::move(task));
                },
            .compress =
                [this](const Binding& dense, double tolerance,
                       const BindControl& control) {
                  ++compressed_;
                  asked_ = tolerance;
                  return compress_(dense, control);
                },
            .is_worth = [this](int64_t bytes) { return bytes >= worth_; }};
  }
  void RunAll() {
    for (;;) {
      std::function<void()> task;
      {
        MutexLock lock(mutex_);
        if (tasks_.empty()) return;
        task = std::move(tasks_.front());
        tasks_.pop_front();
      }
      task();
    }
  }
  // What is left refers to the registry, which waits for it.
  void TearDown() override { RunAll(); }

  BindSpec Spec(double tolerance = kTolerance) {
    return {.tenant = "t",
            .model_id = model_id_,
            .rig = CageOf(Cuboid(Vec3::Constant(-2), Vec3::Constant(2))),
            .scheme = "green",
            .weight_tolerance = tolerance};
  }
  CreatedBinding Created(BindSpec spec) {
    return *bindings_->Create(std::move(spec)).value()->Wait(kLong).value();
  }
  // Nobody uses its weights.
  std::shared_ptr<const BindingRecord> Record(BindSpec spec) {
    return Created(std::move(spec)).record;
  }
  static WeightsCache::Slot::State StateOf(
      const std::shared_ptr<const BindingRecord>& record) {
    return record->weights->state();
  }
  bool IsWaiting(const std::shared_ptr<const BindingRecord>& record) {
    return bindings_->compressor().ProgressOf(*record).has_value();
  }

  Mutex mutex_;
  std::deque<std::function<void()>> tasks_ ABSL_GUARDED_BY(mutex_);
  int64_t worth_ = 0;
  std::function<absl::StatusOr<std::shared_ptr<const Binding>>(
      const Binding&, const BindControl&)>
      compress_ = [](const Binding& dense, const BindControl&) {
        return Compressed(dense, 0.7e-5);
      };
  int compressed_ = 0;
  double asked_ = 0;
  std::vector<std::string> told_;

  ThreadPool pool_{{.threads = 2}};
  const std::unique_ptr<Store> store_ = MemoryStore();
  ModelRegistry models_{
      {.model_bytes = 1 << 27, .memory = 1 << 27, .count = 10}, *store_};
  const std::string model_id_ =
      models_.Register("t", "", MeshOf(Icosphere(1, 1))).value().record->id;
  std::optional<BindingRegistry> bindings_;
};

TEST_F(CompressorTest, DenseWeightsServeUntilCompressedOnesTakeTheirPlace) {
  const auto record = Record(Spec());
  EXPECT_FALSE(StateOf(record).compressed);
  EXPECT_EQ(StateOf(record).bytes, kDenseBytes);
  EXPECT_EQ(bindings_->compressor().ProgressOf(*record)->points_total, 42);
  const int64_t before = bindings_->budget().used();
  RunAll();
  EXPECT_EQ(asked_, kTolerance);
  EXPECT_FALSE(IsWaiting(record));
  const auto state = StateOf(record);
  EXPECT_TRUE(state.compressed);
  EXPECT_EQ(state.bound, 0.7e-5);
  EXPECT_LT(state.bytes, kDenseBytes / 2);
  EXPECT_EQ(bindings_->budget().used(), before - kDenseBytes + state.bytes);
  EXPECT_THAT(told_, testing::ElementsAre(record->id));
}

TEST_F(CompressorTest, WhoUsesTheDenseFormKeepsItAndItsMemory) {
  CreatedBinding created = Created(Spec());
  const int64_t before = bindings_->budget().used();
  RunAll();
  EXPECT_EQ(created.binding->compressed(), nullptr);
  EXPECT_NE(created.record->weights->Get()->compressed(), nullptr);
  EXPECT_GT(bindings_->budget().used(), before);
  created.binding = nullptr;
  EXPECT_LT(bindings_->budget().used(), before);
}

TEST_F(CompressorTest, ABindingOfTolerance0StaysDense) {
  const auto record = Record(Spec(0));
  EXPECT_FALSE(IsWaiting(record));
  RunAll();
  EXPECT_EQ(compressed_, 0);
  EXPECT_EQ(StateOf(record).why_dense, "");
}

TEST_F(CompressorTest, AnotherToleranceIsAnotherBinding) {
  const auto record = Record(Spec());
  EXPECT_NE(Record(Spec(0))->id, record->id);
  EXPECT_NE(Record(Spec(1e-4))->id, record->id);
  RunAll();
  const CreatedBinding again = Created(Spec());
  EXPECT_TRUE(again.existed);
  EXPECT_EQ(again.record, record);
  EXPECT_NE(again.binding->compressed(), nullptr);
}

TEST_F(CompressorTest, SmallWeightsStayDense) {
  worth_ = kDenseBytes + 1;
  const auto record = Record(Spec());
  EXPECT_FALSE(IsWaiting(record));
  EXPECT_EQ(StateOf(record).why_dense,
            "they are small: 3.75 KiB lie in the processor's caches");
}

TEST_F(CompressorTest, StayDenseIfTheToleranceCannotBeKept) {
  compress_ = [](const Binding& dense, const BindControl&) {
    return Compressed(dense, 1.5e-5);
  };
  const auto record = Record(Spec());
  RunAll();
  EXPECT_FALSE(StateOf(record).compressed);
  EXPECT_EQ(StateOf(record).why_dense,
            "sums in float keep them within 1.5e-05, not 1e-05");
  EXPECT_THAT(told_, testing::IsEmpty());
}

TEST_F(CompressorTest, StayDenseIfHalfTheirMemoryDoesNotDo) {
  compress_ = [](const Binding&, const BindControl& control)
      -> absl::StatusOr<std::shared_ptr<const Binding>> {
    EXPECT_EQ(control.max_weight_bytes, kDenseBytes / 2);
    return MakeError(absl::StatusCode::kResourceExhausted, "",
                     {.reason = "NOT_SMALLER"});
  };
  const auto record = Record(Spec());
  RunAll();
  EXPECT_EQ(StateOf(record).why_dense,
            "compressed they would take more than 1.875 KiB");
}

TEST_F(CompressorTest, StayDenseIfThereIsNoRoomToCompressThem) {
  Restart(3 * kDenseBytes);
  const auto record = Record(Spec());
  RunAll();
  EXPECT_EQ(compressed_, 0);
  EXPECT_THAT(StateOf(record).why_dense,
              StartsWith("compressing the weights needs "));
  EXPECT_THAT(StateOf(record).why_dense, HasSubstr("(max-bindings-memory)"));
}

TEST_F(CompressorTest, NeverGoesOverTheBudgetWhileCompressing) {
  compress_ = [this](const Binding& dense, const BindControl&) {
    EXPECT_GE(bindings_->budget().used(),
              kDenseBytes + kDenseBytes / 2 + CompressionBytes(42, 20, 1));
    EXPECT_FALSE(bindings_->budget().Reserve((1 << 20) - kDenseBytes, "").ok())
        << "what is being compressed is not evicted";
    return Compressed(dense, 0);
  };
  const auto record = Record(Spec());
  RunAll();
  EXPECT_TRUE(StateOf(record).compressed);
}

TEST_F(CompressorTest, ABindingThatIsRemovedWhileItWaitsIsForgotten) {
  const std::string id = Record(Spec())->id;
  ASSERT_TRUE(bindings_->Remove("t", id).ok());
  EXPECT_EQ(bindings_->budget().used(), 0);
  RunAll();
  EXPECT_EQ(compressed_, 0);
}

TEST_F(CompressorTest, ABindingThatIsRemovedWhileItIsCompressedIsGivenUp) {
  std::string id;
  compress_ = [&](const Binding& dense, const BindControl& control) {
    EXPECT_TRUE(bindings_->Remove("t", id).ok());
    EXPECT_TRUE(models_.Remove("t", model_id_).ok());
    EXPECT_TRUE(control.cancellation->cancelled());
    return Compressed(dense, 0);
  };
  id = Record(Spec())->id;
  RunAll();
  EXPECT_EQ(compressed_, 1);
  EXPECT_THAT(told_, testing::IsEmpty());
  EXPECT_EQ(bindings_->budget().used(), 0);
  // Made again, it begins anew.
  ASSERT_TRUE(models_.Register("t", "", MeshOf(Icosphere(1, 1))).ok());
  compress_ = [](const Binding& dense, const BindControl&) {
    return Compressed(dense, 0);
  };
  const auto again = Record(Spec());
  RunAll();
  EXPECT_TRUE(StateOf(again).compressed);
}

TEST_F(CompressorTest, OneBindingAtATime) {
  const auto first = Record(Spec(1e-4));
  const auto second = Record(Spec(1e-5));
  {
    MutexLock lock(mutex_);
    EXPECT_EQ(tasks_.size(), 1u);
  }
  compress_ = [&](const Binding& dense, const BindControl&) {
    EXPECT_TRUE(IsWaiting(second));
    EXPECT_EQ(IsWaiting(first), compressed_ == 1);
    return Compressed(dense, 0);
  };
  RunAll();
  EXPECT_EQ(compressed_, 2);
}

TEST_F(CompressorTest, StopsAtOnceAndTakesNoMore) {
  const auto record = Record(Spec());
  bindings_->compressor().Stop();
  EXPECT_FALSE(IsWaiting(record));
  const auto later = Record(Spec(1e-4));
  RunAll();
  EXPECT_EQ(compressed_, 0);
  EXPECT_FALSE(StateOf(record).compressed);
}

TEST_F(CompressorTest, TheRegistryEndsWhileCompressing) {
  // Runs until it is cancelled.
  compress_ = [](const Binding&, const BindControl& control)
      -> absl::StatusOr<std::shared_ptr<const Binding>> {
    while (!control.cancellation->cancelled()) std::this_thread::yield();
    return absl::CancelledError();
  };
  Record(Spec());
  std::thread background([this] { RunAll(); });
  bindings_.reset();
  background.join();
  EXPECT_LE(compressed_, 1);
}

TEST_F(CompressorTest, EvictedOnesAreComputedDenseAndCompressedAgain) {
  const auto record = Record(Spec());
  RunAll();
  const auto compressed = StateOf(record);
  const int64_t free = (1 << 20) - bindings_->budget().used();
  ASSERT_TRUE(
      bindings_->budget().Reserve(free + compressed.bytes, "others").ok());
  EXPECT_FALSE(StateOf(record).resident);
  EXPECT_TRUE(StateOf(record).compressed) << "what they were is told";
  {
    const auto use = bindings_->Use("t", record->id, "session s").value();
    EXPECT_EQ(use.binding->compressed(), nullptr);
    EXPECT_TRUE(IsWaiting(record));
  }
  RunAll();
  EXPECT_EQ(compressed_, 2);
  EXPECT_TRUE(StateOf(record).compressed);
  EXPECT_EQ(StateOf(record).bytes, compressed.bytes);
}

// Dense weights of 400,000 points take 32 MB. Compressing needs less: some
// clusters at a time, and room for the outcome.
class WithoutRoomForDenseWeights : public CompressorTest {
 protected:
  static constexpr int64_t kPoints = 400'000;

  WithoutRoomForDenseWeights() {
    Restart(int64_t{28} << 20,
            [this](const BindRequest& request, const BindControl& control) {
              return Made(request, control);
            });
    model_ = models_
                 .Register(
                     "t", "",
                     Mesh::Create(3, Positions::Random(kPoints, 3), {}).value())
                 .value()
                 .record->id;
  }
  ~WithoutRoomForDenseWeights() override { bindings_.reset(); }

  absl::StatusOr<std::shared_ptr<const Binding>> Made(
      const BindRequest& request, const BindControl& control) {
    EXPECT_EQ(request.weight_tolerance, kTolerance);
    EXPECT_EQ(control.max_weight_bytes, kPoints * 20 * 4 / 4);
    EXPECT_GE(bindings_->budget().used(), control.max_weight_bytes);
    if (bound_ < 0) {
      return MakeError(absl::StatusCode::kResourceExhausted, "",
                       {.reason = "NOT_SMALLER"});
    }
    return Compressed(
        BindingFacts({.request = request,
                      .scheme = FindScheme(request.scheme).value(),
                      .columns = 20}),
        bound_);
  }
  BindSpec LargeSpec(double tolerance = kTolerance) {
    BindSpec spec = Spec(tolerance);
    spec.model_id = model_;
    return spec;
  }
  absl::Status Refusal() {
    return bindings_->Create(LargeSpec()).value()->Wait(kLong)->status();
  }

  double bound_ = 0.5e-5;
  std::string model_;
};

TEST_F(WithoutRoomForDenseWeights, CompressedOnesAreMadeWithoutThem) {
  const auto record = Record(LargeSpec());
  EXPECT_TRUE(StateOf(record).compressed);
  EXPECT_FALSE(IsWaiting(record));
  EXPECT_EQ(record->weight_tolerance, kTolerance);
  EXPECT_LT(bindings_->budget().used(), 8 << 20);
  // So they are again after an eviction.
  const int64_t free = (int64_t{28} << 20) - bindings_->budget().used();
  ASSERT_TRUE(bindings_->budget().Reserve(free + 1, "others").ok());
  EXPECT_FALSE(StateOf(record).resident);
  EXPECT_NE(bindings_->Use("t", record->id, "session s")->binding->compressed(),
            nullptr);
}

TEST_F(WithoutRoomForDenseWeights, DenseOnesAreRefused) {
  const absl::Status refused = bindings_->Create(LargeSpec(0)).status();
  EXPECT_EQ(DetailOf(refused).reason, "MEMORY_LIMIT");
  EXPECT_THAT(std::string(refused.message()),
              StartsWith("the binding needs 36.62 MiB; "));
}

TEST_F(WithoutRoomForDenseWeights, RefusesWhatCannotBeMadeSmallEnough) {
  bound_ = -1;
  const absl::Status refused = Refusal();
  EXPECT_EQ(DetailOf(refused).reason, "MEMORY_LIMIT");
  EXPECT_EQ(DetailOf(refused).field, "max-bindings-memory");
  EXPECT_EQ(refused.message(),
            "dense weights do not fit into max-bindings-memory, and "
            "compressed to a tolerance of 1e-05 they would take more than "
            "7.629 MiB");
  EXPECT_EQ(bindings_->budget().used(), 0);
}

TEST_F(WithoutRoomForDenseWeights, RefusesWhatCannotKeepTheTolerance) {
  bound_ = 2e-5;
  EXPECT_EQ(Refusal().message(),
            "dense weights do not fit into max-bindings-memory, and "
            "compressed, sums in float keep them within 2e-05, not 1e-05");
}

}  // namespace
}  // namespace deform::server
