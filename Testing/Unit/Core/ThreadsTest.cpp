#include "Core/Threads.h"
#include "Executors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <numeric>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

namespace palpate {
namespace {

const std::vector<int> kCounts{1, 2, 3, 8};

TEST(Threads, CountIsAsRequestedAndNeverZero) {
  for (int count : kCounts) EXPECT_EQ(Threads(count).count(), count);
  EXPECT_GE(Threads(0).count(), 1);
}

TEST(Threads, ChunksDependOnSizeAndGrainOnly) {
  using Chunk = std::tuple<std::size_t, std::size_t, std::size_t>;
  for (std::size_t size : {0u, 1u, 9u, 10u, 11u, 99u, 1000u}) {
    for (std::size_t grain : {1u, 10u, 2000u}) {
      std::vector<Chunk> expected;
      for (std::size_t begin = 0; begin < size; begin += grain)
        expected.emplace_back(begin / grain, begin, std::min(begin + grain, size));
      for (int count : kCounts) {
        std::vector<Chunk> chunks((size + grain - 1) / grain);
        Threads(count).forChunks(size, grain,
                                 [&](std::size_t i, std::size_t begin, std::size_t end) {
                                   chunks[i] = {i, begin, end};
                                 });
        EXPECT_EQ(chunks, expected) << size << " by " << grain << " on " << count;
      }
    }
  }
}

TEST(Threads, OnePoolRunsManySmallLoops) {
  for (int count : kCounts) {
    const Threads threads(count);
    std::uint64_t sum = 0;
    for (std::size_t run = 0; run < 3000; ++run) {
      std::vector<std::uint64_t> parts(run % 7);
      threads.forEach(parts.size(), [&](std::size_t i) { parts[i] = run + i; });
      sum += std::accumulate(parts.begin(), parts.end(), std::uint64_t{0});
    }
    std::uint64_t expected = 0;
    for (std::uint64_t run = 0; run < 3000; ++run)
      for (std::uint64_t i = 0; i < run % 7; ++i) expected += run + i;
    EXPECT_EQ(sum, expected) << count;
  }
}

TEST(Threads, NestedLoopsAreComplete) {
  for (const Threads& threads : threadsOfEveryKind()) {
    for (int run = 0; run < 20; ++run) {
      std::vector<std::vector<int>> runs(20, std::vector<int>(30, 0));
      threads.forEach(runs.size(), [&](std::size_t i) {
        threads.forEach(runs[i].size(), [&](std::size_t j) { ++runs[i][j]; });
      });
      for (const auto& row : runs) EXPECT_EQ(row, std::vector<int>(30, 1));
    }
  }
}

TEST(Threads, LoopsOfConcurrentCallersAreComplete) {
  const Threads threads(3);
  std::vector<std::vector<int>> runs(4, std::vector<int>(500, 0));
  std::vector<std::thread> callers;
  for (auto& own : runs)
    callers.emplace_back([&] {
      for (int run = 0; run < 100; ++run)
        threads.forEach(own.size(), [&](std::size_t i) { ++own[i]; });
    });
  for (std::thread& caller : callers) caller.join();
  for (const auto& own : runs) EXPECT_EQ(own, std::vector<int>(500, 100));
}

TEST(Threads, ExceptionOfTheLowestIndexIsRethrownAndThePoolStaysUsable) {
  for (const Threads& threads : threadsOfEveryKind()) {
    for (int run = 0; run < 100; ++run) {
      std::string message;
      try {
        threads.forEach(200, [](std::size_t i) {
          if (i >= 60) throw std::runtime_error(std::to_string(i));
        });
      } catch (const std::runtime_error& error) {
        message = error.what();
      }
      EXPECT_EQ(message, "60");
      std::atomic<int> runs{0};
      threads.forEach(100, [&](std::size_t) { ++runs; });
      EXPECT_EQ(runs, 100);
    }
  }
}

TEST(Threads, NestedLoopsWithExceptionsLeaveThePoolUsable) {
  for (const Threads& threads : threadsOfEveryKind()) {
    for (int run = 0; run < 50; ++run) {
      std::atomic<int> caught{0};
      EXPECT_THROW(threads.forEach(8,
                                   [&](std::size_t i) {
                                     try {
                                       threads.forEach(8, [](std::size_t j) {
                                         if (j % 2 == 1) throw std::runtime_error("odd");
                                       });
                                     } catch (const std::runtime_error&) {
                                       ++caught;
                                       if (i == 5) throw;
                                     }
                                   }),
                   std::runtime_error);
      EXPECT_GE(caught, 6);
      std::atomic<int> runs{0};
      threads.forEach(100, [&](std::size_t) { ++runs; });
      EXPECT_EQ(runs, 100);
    }
  }
}

TEST(Threads, PoolMayBeDestroyedRightAfterAnException) {
  for (int count : kCounts)
    for (int run = 0; run < 50; ++run) {
      const Threads threads(count);
      EXPECT_THROW(threads.forEach(10, [](std::size_t i) { throw i; }), std::size_t);
    }
}

/// Deeper than any list that a pool might have reserved.
TEST(Threads, DeeplyNestedLoopsAreComplete) {
  for (int count : kCounts) {
    const Threads threads(count);
    std::atomic<int> runs{0};
    const std::function<void(int)> nest = [&](int depth) {
      threads.forEach(2, [&](std::size_t i) {
        ++runs;
        if (i == 0 && depth > 0) nest(depth - 1);
      });
    };
    nest(200);
    EXPECT_EQ(runs, 402) << count;
  }
}

/// Its wait is in vain first: the caller blocks, and must wake up to help with a later loop.
TEST(Threads, WaitingCallerHelpsWithALaterLoop) {
  const Threads threads(2);
  for (int run = 0; run < 5; ++run) {
    std::atomic<bool> begun{false};
    std::atomic<int> met{0};
    threads.forEach(2, [&](std::size_t i) {
      if (i == 0) {
        while (!begun) std::this_thread::yield();
        return;
      }
      begun = true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      // This returns only if two threads run.
      threads.forEach(2, [&](std::size_t) {
        ++met;
        while (met < 2) std::this_thread::yield();
      });
    });
    EXPECT_EQ(met, 2);
  }
}

// oneTBB warns on stderr when it is asked for more workers than there are cores.
TEST(Threads, MoreThreadsThanCoresPrintNothing) {
  ::testing::internal::CaptureStderr();
  Threads(500).forEach(1000, [](std::size_t) {});
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST(Threads, MovedPoolsWork) {
  Threads first(3);
  Threads second(std::move(first));
  first = Threads(2);
  for (const Threads* threads : {&first, &second}) {
    std::atomic<int> runs{0};
    threads->forEach(100, [&](std::size_t) { ++runs; });
    EXPECT_EQ(runs, 100);
  }
}

}  // namespace
}  // namespace palpate
