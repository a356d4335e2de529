// What the process really takes, against what the budgets count.
#include <gtest/gtest.h>
#include <unistd.h>

#include <deque>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "server/models/binding_registry.h"
#include "server/models/model_registry.h"
#include "server/models/process_memory.h"
#include "tests/server/stores/memory_store.h"
#include "tests/support/shapes.h"

// Sanitizers keep what was freed, and shadows of everything.
// GCC tells in one way, Clang in another, and headers lend GCC Clang's way.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define DEFORM_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define DEFORM_SANITIZED 1
#endif
#endif
#ifndef DEFORM_SANITIZED
#define DEFORM_SANITIZED 0
#endif

namespace deform::server {
namespace {

int64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  int64_t size = 0, resident = 0;
  statm >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

class ResidentMemoryTest : public testing::Test {
 protected:
  static constexpr int kModels = 12;

  void SetUp() override {
    if (DEFORM_SANITIZED) GTEST_SKIP() << "a sanitizer's memory is not ours";
    ReturnLargeBlocks();
    // Threads, arenas and tables come with the first.
    Register(kModels);
    Delete();
    begin_ = ResidentBytes();
  }

  // 10 to 43 thousand points: blocks on both sides of what malloc() maps.
  void Register(int count) {
    for (int k = 0; k < count; ++k) {
      const int64_t points = 10'000 + 3000 * k;
      Positions positions = Positions::Random(points, 3) * 0.5;
      positions(0, 0) = 0.01 * ++made_;
      const auto model =
          models_
              .Register("t", "",
                        Mesh::Create(3, std::move(positions), {}).value())
              .value();
      model_ids_.push_back(model.record->id);
      const auto waiter =
          bindings_
              .Create(
                  {.tenant = "t",
                   .model_id = model.record->id,
                   .rig = CageOf(Cuboid(Vec3::Constant(-2), Vec3::Constant(2))),
                   .scheme = "green",
                   .weight_tolerance = 1e-3})
              .value();
      binding_ids_.push_back(
          waiter->Wait(std::chrono::minutes(1)).value().value().record->id);
    }
  }
  void Delete() {
    for (const auto& id : binding_ids_) {
      ASSERT_TRUE(bindings_.Remove("t", id).ok());
    }
    for (const auto& id : model_ids_) ASSERT_TRUE(models_.Remove("t", id).ok());
    binding_ids_.clear();
    model_ids_.clear();
  }
  int64_t Counted() {
    return models_.budget().used() + bindings_.budget().used();
  }
  int64_t Grown() const { return ResidentBytes() - begin_; }

  void TearDown() override { Compress(); }
  void Compress() {
    while (!compressions_.empty()) {
      const auto task = std::move(compressions_.front());
      compressions_.pop_front();
      task();
    }
  }

  std::deque<std::function<void()>> compressions_;
  ThreadPool pool_{{.threads = 2}};
  const std::unique_ptr<Store> store_ = MemoryStore();
  ModelRegistry models_{
      {.model_bytes = 1 << 30, .memory = 1 << 30, .count = 1000}, *store_};
  BindingRegistry bindings_{
      models_,
      pool_,
      {.memory = 1 << 30, .count = 1000, .concurrent = 1, .waiting_calls = 1},
      &Bind,
      {.executor = [this](auto task) { compressions_.push_back(task); },
       .is_worth = [](int64_t) { return true; }}};
  std::vector<std::string> model_ids_, binding_ids_;
  int made_ = 0;
  int64_t begin_ = 0;
};

// Beside what is counted: records of some kilobytes, tiles padded to 16 points,
// and what threads work with.
constexpr int64_t kSlack = 8 << 20;

TEST_F(ResidentMemoryTest, GrowsAsWhatIsKept) {
  Register(kModels);
  EXPECT_LT(Grown(), Counted() * 1.1 + kSlack);
  EXPECT_GT(Grown(), Counted() * 0.9 - kSlack) << "the budgets count too much";
}

TEST_F(ResidentMemoryTest, ComesBackWithDeletion) {
  Register(kModels);
  Delete();
  EXPECT_EQ(Counted(), 0);
  EXPECT_LT(Grown(), kSlack);
}

TEST_F(ResidentMemoryTest, DoesNotGrowWithWhatIsMadeAndDeletedAgain) {
  for (int round = 0; round < 2; ++round) {
    Register(kModels);
    Delete();
  }
  EXPECT_LT(Grown(), kSlack);
}

TEST_F(ResidentMemoryTest, FallsWithCompression) {
  Register(kModels);
  const int64_t dense = Counted(), grown = Grown();
  Compress();
  // Points at random, far from a cage of 20 columns: few directions.
  EXPECT_LT(bindings_.budget().used(), dense / 4);
  EXPECT_LT(Grown(), grown - (dense - Counted()) * 0.9 + kSlack);
  EXPECT_LT(Grown(), Counted() * 1.1 + kSlack);
}

TEST_F(ResidentMemoryTest, ComesBackWithEviction) {
  Register(kModels);
  const int64_t weights = bindings_.budget().used();
  ASSERT_TRUE(
      bindings_.budget().Reserve((1 << 30) - weights / 8, "others need").ok());
  EXPECT_LT(Grown(), Counted() * 1.1 + kSlack);
}

}  // namespace
}  // namespace deform::server
