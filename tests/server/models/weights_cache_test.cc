#include "server/models/weights_cache.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "tests/support/shapes.h"

namespace deform::server {
namespace {

std::shared_ptr<const Binding> BindBall() {
  return Bind({.model = std::make_shared<const Mesh>(MeshOf(Icosphere(0.5, 1))),
               .rig = CageOf(Cuboid(Vec3::Constant(-1), Vec3::Constant(1))),
               .scheme = "green"},
              {})
      .value();
}

class WeightsCacheTest : public testing::Test {
 protected:
  std::shared_ptr<const Binding> Put(WeightsCache::Slot& slot, int64_t bytes) {
    return slot.Put(ball_, cache_.budget().Reserve(bytes, "it needs").value());
  }
  bool Reserve(int64_t bytes) {
    return cache_.budget().Reserve(bytes, "it needs").ok();
  }

  const std::shared_ptr<const Binding> ball_ = BindBall();
  WeightsCache cache_{100, "limit"};
};

TEST_F(WeightsCacheTest, HandsOutWhatWasPut) {
  const auto slot = cache_.MakeSlot();
  EXPECT_EQ(slot->Get(), nullptr);
  EXPECT_EQ(Put(*slot, 60).get(), ball_.get());
  EXPECT_EQ(slot->Get().get(), ball_.get());
  EXPECT_TRUE(slot->state().resident);
  EXPECT_EQ(slot->state().bytes, 60);
  EXPECT_EQ(slot->state().users, 0);
}

TEST_F(WeightsCacheTest, CountsUsers) {
  const auto slot = cache_.MakeSlot();
  const auto first = Put(*slot, 60);
  const auto second = slot->Get();
  EXPECT_EQ(slot->state().users, 2);
}

TEST_F(WeightsCacheTest, LettingGoIsAUse) {
  const auto a = cache_.MakeSlot();
  const auto b = cache_.MakeSlot();
  auto user = Put(*a, 40);
  Put(*b, 40);
  user = nullptr;
  EXPECT_TRUE(Reserve(30));
  EXPECT_TRUE(a->state().resident);
  EXPECT_FALSE(b->state().resident);
}

TEST_F(WeightsCacheTest, DropsAsManyAsAreNeededAndNoMore) {
  std::vector<std::shared_ptr<WeightsCache::Slot>> slots;
  for (int i = 0; i < 4; ++i) {
    slots.push_back(cache_.MakeSlot());
    Put(*slots.back(), 25);
  }
  EXPECT_TRUE(Reserve(40));
  EXPECT_FALSE(slots[0]->state().resident);
  EXPECT_FALSE(slots[1]->state().resident);
  EXPECT_TRUE(slots[2]->state().resident);
  EXPECT_TRUE(slots[3]->state().resident);
  EXPECT_EQ(cache_.budget().used(), 50);
}

TEST_F(WeightsCacheTest, MemoryStaysReservedWhileSomebodyUsesFormerWeights) {
  const auto slot = cache_.MakeSlot();
  auto user = Put(*slot, 60);
  Put(*slot, 10);
  EXPECT_EQ(slot->state().bytes, 10);
  EXPECT_EQ(cache_.budget().used(), 70);
  EXPECT_FALSE(Reserve(41)) << "former weights are still used";
  user = nullptr;
  EXPECT_EQ(cache_.budget().used(), 10);
}

TEST_F(WeightsCacheTest, MemoryGoesWithTheSlotOrItsLastUser) {
  auto slot = cache_.MakeSlot();
  auto user = Put(*slot, 60);
  slot = nullptr;
  EXPECT_EQ(cache_.budget().used(), 60);
  user = nullptr;
  EXPECT_EQ(cache_.budget().used(), 0);
}

// What threads see is weights, or none; never some that have been dropped, and
// never more than the limit.
TEST_F(WeightsCacheTest, ManyThreadsTakeEvictAndPut) {
  const auto slots = {cache_.MakeSlot(), cache_.MakeSlot(), cache_.MakeSlot()};
  std::atomic<int> wrong = 0;
  const auto work = [&] {
    for (int i = 0; i < 2000; ++i) {
      for (const auto& slot : slots) {
        auto weights = slot->Get();
        if (weights == nullptr) {
          auto memory = cache_.budget().Reserve(40, "it needs");
          if (!memory.ok()) continue;
          weights = slot->Put(ball_, *std::move(memory));
        }
        wrong += weights->weights().points() != 42;
        wrong += cache_.budget().used() > 100;
      }
    }
  };
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
  for (const auto& slot : slots) EXPECT_EQ(slot->state().users, 0);
}

}  // namespace
}  // namespace deform::server
