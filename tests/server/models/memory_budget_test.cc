#include "server/models/memory_budget.h"

#include <gtest/gtest.h>

#include <optional>

#include "core/base/error.h"

namespace deform::server {
namespace {

TEST(FormatBytes, UsesTheLargestUnit) {
  EXPECT_EQ(FormatBytes(0), "0 B");
  EXPECT_EQ(FormatBytes(1023), "1023 B");
  EXPECT_EQ(FormatBytes(1536), "1.5 KiB");
  EXPECT_EQ(FormatBytes(int64_t{5} << 40), "5 TiB");
}

TEST(MemoryBudget, RefusesWhatDoesNotFitWithFigures) {
  MemoryBudget budget(1024, "max-things-memory");
  const auto first = budget.Reserve(1000, "the thing needs");
  ASSERT_TRUE(first.ok());
  const absl::Status refused = budget.Reserve(25, "the thing needs").status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(refused.message(),
            "the thing needs 25 B; 1000 B of 1 KiB (max-things-memory) are in "
            "use: delete what is no longer needed");
  EXPECT_EQ(DetailOf(refused).reason, "MEMORY_LIMIT");
  EXPECT_EQ(DetailOf(refused).field, "max-things-memory");
  EXPECT_TRUE(budget.Reserve(24, "the thing needs").ok());
}

TEST(MemoryBudget, TakesBackWhatAReservationHeld) {
  MemoryBudget budget(100, "limit");
  {
    const auto reservation = budget.Reserve(100, "it needs");
    EXPECT_EQ(budget.used(), 100);
  }
  EXPECT_EQ(budget.used(), 0);
}

TEST(MemoryBudget, ReservationsShrinkAndGrow) {
  MemoryBudget budget(100, "limit");
  auto held = budget.Reserve(60, "it needs").value();
  ASSERT_TRUE(held.Resize(20, "it needs").ok());
  EXPECT_EQ(budget.used(), 20);
  ASSERT_TRUE(held.Resize(100, "it needs").ok());
  EXPECT_EQ(held.bytes(), 100);
  const absl::Status refused = held.Resize(130, "it needs");
  EXPECT_EQ(refused.message(),
            "it needs 30 B; 100 B of 100 B (limit) are in use: delete what is "
            "no longer needed");
  EXPECT_EQ(held.bytes(), 100);
}

TEST(MemoryBudget, APartOfAReservationGoesOnItsOwn) {
  MemoryBudget budget(100, "limit");
  auto held = budget.Reserve(60, "it needs").value();
  {
    const auto part = held.Split(40);
    EXPECT_EQ(part.bytes(), 40);
    EXPECT_EQ(held.bytes(), 20);
    EXPECT_EQ(budget.used(), 60);
  }
  EXPECT_EQ(budget.used(), 20);
}

TEST(MemoryBudget, ReclaimsWhatNobodyNeeds) {
  MemoryBudget::Reservation idle;
  MemoryBudget budget(100, "limit", [&](int64_t missing) {
    const int64_t bytes = idle.bytes();
    if (bytes >= missing) idle = MemoryBudget::Reservation();
    return bytes;
  });
  idle = budget.Reserve(30, "it needs").value();
  const auto held = budget.Reserve(50, "it needs").value();
  const absl::Status refused = budget.Reserve(51, "it needs").status();
  EXPECT_EQ(
      refused.message(),
      "it needs 51 B; 50 B of 100 B (limit) are in use: delete what is no "
      "longer needed");
  EXPECT_EQ(idle.bytes(), 30) << "in vain";
  EXPECT_TRUE(budget.Reserve(21, "it needs").ok());
  EXPECT_EQ(budget.used(), 50);
}

TEST(MemoryBudget, CountsAMovedReservationOnce) {
  MemoryBudget budget(100, "limit");
  MemoryBudget::Reservation held;
  {
    auto reservation = budget.Reserve(60, "it needs");
    held = *std::move(reservation);
  }
  EXPECT_EQ(budget.used(), 60);
  held = {};
  EXPECT_EQ(budget.used(), 0);
}

}  // namespace
}  // namespace deform::server
