#include "server/models/model_registry.h"

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/server/stores/memory_store.h"
#include "tests/support/shapes.h"

namespace deform::server {
namespace {

constexpr ModelRegistry::Limits kLimits = {
    .model_bytes = 1 << 20, .memory = 1 << 20, .count = 10};

TEST(ModelRegistry, FindsTheSameArraysAgain) {
  const auto store = MemoryStore();
  ModelRegistry models(kLimits, *store);
  const auto first =
      models.Register("t", "ball", MeshOf(Icosphere(1, 1))).value();
  const auto again =
      models.Register("t", "other", MeshOf(Icosphere(1, 1))).value();
  EXPECT_FALSE(first.existed);
  EXPECT_TRUE(again.existed);
  EXPECT_EQ(again.record->id, first.record->id);
  EXPECT_EQ(again.record->display_name, "ball");
}

TEST(ModelRegistry, GivesDifferentArraysDifferentIds) {
  const auto store = MemoryStore();
  ModelRegistry models(kLimits, *store);
  const Shape shape = Icosphere(1, 1);
  const auto id = [&](const Shape& s) {
    return models.Register("t", "", MeshOf(s)).value().record->id;
  };
  Shape moved = shape;
  moved.positions(0, 0) += 1e-12;
  EXPECT_NE(id(shape), id(moved));
  EXPECT_NE(id(shape), id(Turned(shape)));
}

TEST(ModelRegistry, TenantsDoNotShareIds) {
  const auto store = MemoryStore();
  ModelRegistry models(kLimits, *store);
  const auto a = models.Register("a", "", MeshOf(Icosphere(1, 1))).value();
  const auto b = models.Register("b", "", MeshOf(Icosphere(1, 1))).value();
  EXPECT_FALSE(b.existed);
  EXPECT_NE(a.record->id, b.record->id);
}

TEST(ModelRegistry, CountsMemoryAndGivesItBack) {
  const auto store = MemoryStore();
  ModelRegistry models(kLimits, *store);
  // 2562 points and 5120 faces: 123 KB; the ninth is beyond 1 MiB.
  for (int i = 1; i <= 8; ++i) {
    ASSERT_TRUE(models.Register("t", "", MeshOf(Icosphere(i, 4))).ok());
  }
  const auto refused = models.Register("t", "", MeshOf(Icosphere(9, 4)));
  EXPECT_EQ(DetailOf(refused.status()).reason, "MEMORY_LIMIT");
  EXPECT_EQ(DetailOf(refused.status()).field, "max-models-memory");
  const auto page = models.catalogue().List(
      "t", {.size = 1}, [](const ModelRecord&) { return true; });
  ASSERT_TRUE(models.Remove("t", page.records[0]->id).ok());
}

}  // namespace
}  // namespace deform::server
