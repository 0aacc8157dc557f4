#include "CollisionDetection/BurstMemory.h"

#include <gtest/gtest.h>

namespace palpate {
namespace {

constexpr std::size_t kMany = BurstMemory::kFewBytes + 1;
constexpr int kMost = 2 * BurstMemory::kDetections;

/// The first law, wherever in the count the burst comes, and of both kinds of work.
TEST(BurstMemory, ABurstIsOverInTimeAndOnce) {
  for (int start = 0; start < kMost; ++start)
    for (const bool ofContacts : {false, true}) {
      BurstMemory memory;
      const BurstMemory::Work calm{1000, 100};
      const BurstMemory::Work burst{ofContacts ? 1000u : 4001u, ofContacts ? 401u : 100u};
      for (int i = 0; i < start; ++i) EXPECT_FALSE(memory.isOver(calm, kMany));
      EXPECT_FALSE(memory.isOver(burst, kMany));
      int over = 0, last = 0;
      for (int i = 1; i <= 5 * kMost; ++i)
        if (memory.isOver(calm, kMany)) ++over, last = i;
      EXPECT_EQ(over, 1) << start;
      EXPECT_LE(last, kMost) << start;
      EXPECT_GE(last, BurstMemory::kDetections) << start;
    }
}

/// The second law, with bursts again and again.
TEST(BurstMemory, WorkThatVariesIsNoBurst) {
  for (const int period : {2, 7, 100, 300, 1000}) {
    BurstMemory memory;
    for (int i = 0; i < 10 * kMost; ++i)
      EXPECT_FALSE(memory.isOver(
          i % period == 0 ? BurstMemory::Work{4000, 400} : BurstMemory::Work{1000, 100}, kMany));
  }
}

TEST(BurstMemory, FewBytesAreKept) {
  BurstMemory memory;
  EXPECT_FALSE(memory.isOver({1'000'000, 1'000'000}, kMany));
  for (int i = 0; i < 5 * kMost; ++i) EXPECT_FALSE(memory.isOver({0, 0}, BurstMemory::kFewBytes));
}

}  // namespace
}  // namespace palpate
