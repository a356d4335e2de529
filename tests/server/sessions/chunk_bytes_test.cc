#include "server/sessions/chunk_bytes.h"

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <thread>
#include <vector>

#include "core/frames/encoding.h"

namespace deform::server {
namespace {

TEST(ChunkBytes, AreTakenAgainOnceTheyAreGivenBack) {
  ChunkBytes first = TakeChunkBytes();
  std::memset(first.get(), 1, kMaxChunkBytes);
  const uint8_t* const place = first.get();
  const ChunkBytes second = TakeChunkBytes();
  EXPECT_NE(second.get(), place);
  first.reset();
  EXPECT_EQ(TakeChunkBytes().get(), place);
}

TEST(ChunkBytes, MayBeOrdinaryMemory) {
  const uint8_t* place = nullptr;
  {
    const ChunkBytes small = std::make_unique<uint8_t[]>(3);
    place = small.get();
    EXPECT_FALSE(small.get_deleter().kept);
  }
  EXPECT_NE(TakeChunkBytes().get(), place);
}

TEST(ChunkBytes, AreEachTakenOnceByManyThreads) {
  constexpr int kThreads = 4, kEach = 30;  // More than are kept.
  std::vector<std::vector<ChunkBytes>> taken(kThreads);
  std::vector<std::thread> threads;
  for (auto& own : taken) {
    threads.emplace_back([&own] {
      for (int i = 0; i < kEach; ++i) {
        TakeChunkBytes();
        own.push_back(TakeChunkBytes());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  std::set<const uint8_t*> places;
  for (const auto& own : taken) {
    for (const ChunkBytes& bytes : own) places.insert(bytes.get());
  }
  EXPECT_EQ(places.size(), size_t{kThreads} * kEach);
}

}  // namespace
}  // namespace deform::server
