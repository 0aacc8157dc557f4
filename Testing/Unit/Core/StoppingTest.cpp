#include "Core/Stopping.h"

#include "Core/Threads.h"
#include "Executors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <numeric>
#include <random>
#include <span>
#include <stdexcept>
#include <vector>

namespace palpate {
namespace {

/// A deadline that is over once it was asked so many times.
class Asked {
 public:
  explicit Asked(std::int64_t end)
      : m_clock([this] { return timeOf(m_looks.fetch_add(1) + 1); }),
        m_deadline(timeOf(end), m_isCancelled, m_clock) {}
  StopScope::Token token() const { return &m_deadline; }
  std::int64_t looks() const { return m_looks; }
  void cancel() { m_isCancelled = true; }

 private:
  static Deadline::Time timeOf(std::int64_t looks) {
    return Deadline::Time(std::chrono::microseconds(looks));
  }
  std::atomic<std::int64_t> m_looks{0};
  std::atomic<bool> m_isCancelled{false};
  const Deadline::Clock m_clock;
  const Deadline m_deadline;
};

constexpr std::int64_t kNever = 1'000'000'000;

TEST(Stopping, ScopesNest) {
  const Asked outer(kNever), inner(kNever);
  EXPECT_FALSE(isTimed());
  {
    const StopScope first(outer.token());
    EXPECT_EQ(StopScope::current(), outer.token());
    EXPECT_THROW(
        {
          const StopScope second(inner.token());
          EXPECT_EQ(StopScope::current(), inner.token());
          throw 7;
        },
        int);
    EXPECT_EQ(StopScope::current(), outer.token());
    {
      const StopScope none(nullptr);
      EXPECT_FALSE(isTimed());
    }
    EXPECT_TRUE(isTimed());
  }
  EXPECT_FALSE(isTimed());
  checkTime();  // without a token nothing is thrown
}

/// Each look but the last one lets an index begin. On one thread exactly these have run.
TEST(Stopping, LoopsEndAtEachLook) {
  constexpr std::size_t kSize = 50;
  for (const Threads& threads : threadsOfEveryKind())
    for (std::int64_t end = 1; end < 70; ++end) {
      const Asked asked(end);
      std::vector<int> runs(kSize, 0);
      const bool isComplete = endsInTime([&] {
        const StopScope scope(asked.token());
        threads.forEach(kSize, [&](std::size_t i) { ++runs[i]; });
      });
      EXPECT_FALSE(isTimed());
      const auto begun = static_cast<std::size_t>(std::count(runs.begin(), runs.end(), 1));
      EXPECT_EQ(begun, std::min(kSize, static_cast<std::size_t>(end - 1)));
      EXPECT_EQ(isComplete, begun == kSize);
      EXPECT_LE(*std::max_element(runs.begin(), runs.end()), 1);
      std::atomic<std::size_t> after{0};
      threads.forEach(kSize, [&](std::size_t) { ++after; });
      EXPECT_EQ(after, kSize);
    }
}

/// Tasks have the token of the thread that runs the loop, loops in them too.
TEST(Stopping, TokensFollowTheLoop) {
  for (const Threads& threads : threadsOfEveryKind()) {
    const Asked asked(kNever);
    std::atomic<int> wrong{0}, inner{0};
    const auto isWrong = [&](StopScope::Token token) { return StopScope::current() != token; };
    {
      const StopScope scope(asked.token());
      threads.forEach(20, [&](std::size_t) {
        wrong += isWrong(asked.token());
        threads.forEach(5, [&](std::size_t) { wrong += isWrong(asked.token()), ++inner; });
        wrong += isWrong(asked.token());
        {
          const StopScope none(nullptr);
          threads.forEach(3, [&](std::size_t) { wrong += isWrong(nullptr); });
        }
        wrong += isWrong(asked.token());
      });
    }
    threads.forEach(20, [&](std::size_t) { wrong += isWrong(nullptr); });
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(inner, 100);
  }
}

TEST(Stopping, ExecutorsHaveNoToken) {
  int seen = 0, timed = 0;
  const Threads threads(0,
                        executorOf(3, [&](std::size_t count, Executor::Task task, void* context) {
                          ++seen;
                          timed += isTimed();
                          for (std::size_t i = 0; i < count; ++i) {
                            task(context, i);
                            timed += isTimed();
                          }
                        }));
  Asked asked(kNever);
  const StopScope scope(asked.token());
  threads.forEach(9, [](std::size_t) { EXPECT_TRUE(isTimed()); });
  EXPECT_TRUE(isTimed());
  asked.cancel();
  EXPECT_THROW(threads.forEach(9, [](std::size_t) {}), OutOfTime);
  EXPECT_TRUE(isTimed());
  EXPECT_EQ(seen, 2);
  EXPECT_EQ(timed, 0);
}

/// What a task throws is not lost because other tasks are out of time.
TEST(Stopping, ErrorsHavePrecedence) {
  for (const Threads& threads : threadsOfEveryKind())
    for (int run = 0; run < 20; ++run) {
      Asked asked(kNever);
      const StopScope scope(asked.token());
      EXPECT_THROW(threads.forEach(40,
                                   [&](std::size_t i) {
                                     if (i > 0) throwOutOfTime();
                                     asked.cancel();
                                     throw std::runtime_error("0");
                                   }),
                   std::runtime_error);
    }
}

TEST(Stopping, SortInTime) {
  std::vector<int> values(3000);
  std::iota(values.begin(), values.end(), 0);
  const std::vector<int> sorted = values;
  std::shuffle(values.begin(), values.end(), std::mt19937(5));
  const auto looksOf = [&](std::int64_t end) {
    const Asked asked(end);
    const StopScope scope(asked.token());
    std::vector<int> copy = values;
    const bool isComplete =
        endsInTime([&] { sortInTime(copy.begin(), copy.end(), std::less<>()); });
    EXPECT_EQ(isComplete, asked.looks() < end);
    EXPECT_EQ(copy == sorted, isComplete);
    return asked.looks();
  };
  const std::int64_t all = looksOf(kNever);
  EXPECT_GT(all, 30);
  for (std::int64_t end = 1; end <= all + 1; ++end) EXPECT_EQ(looksOf(end), std::min(end, all));
  std::vector<int> copy = values;
  sortInTime(copy.begin(), copy.end(), std::less<>());
  EXPECT_EQ(copy, sorted);
}

TEST(Stopping, ForEachPart) {
  std::vector<int> items(100);
  std::iota(items.begin(), items.end(), 0);
  std::vector<int> seen;
  std::size_t parts = 0;
  const auto collect = [&] {
    seen.clear();
    parts = 0;
    forEachPart(std::span<const int>(items), [&](std::span<const int> part) {
      ++parts;
      seen.insert(seen.end(), part.begin(), part.end());
    });
  };
  collect();
  EXPECT_EQ(parts, 1u);
  EXPECT_EQ(seen, items);
  for (std::int64_t end = 1; end < 10; ++end) {
    const Asked asked(end);
    const StopScope scope(asked.token());
    EXPECT_EQ(endsInTime(collect), end > 7);
    EXPECT_EQ(parts, std::min<std::size_t>(7, static_cast<std::size_t>(end - 1)));
    EXPECT_EQ(seen.size(), std::min<std::size_t>(100, 16 * parts));
    EXPECT_TRUE(std::equal(seen.begin(), seen.end(), items.begin()));
  }
}

TEST(Stopping, TimeCheckAsksInOneOfSoManyCalls) {
  const Asked asked(3);
  const StopScope scope(asked.token());
  TimeCheck check(10);
  for (int i = 0; i < 29; ++i) check();
  EXPECT_EQ(asked.looks(), 2);
  EXPECT_THROW(check(), OutOfTime);
  EXPECT_THROW(checkTime(), OutOfTime);
  EXPECT_EQ(asked.looks(), 3);  // once over, no clock is read
}

}  // namespace
}  // namespace palpate
