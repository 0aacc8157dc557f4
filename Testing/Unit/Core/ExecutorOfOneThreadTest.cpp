#include "Core/Threads.h"
#include "Unit/Core/Executors.h"

#include <gtest/gtest.h>

#include <vector>

namespace palpate {
namespace {

TEST(ExecutorOfOneThread, RunsAllTasks) {
  const Threads threads(0, executorOf(1, backwards));
  EXPECT_EQ(threads.count(), 1);
  std::vector<int> runs(10, 0);
  threads.forEach(runs.size(), [&](std::size_t i) { ++runs[i]; });
  EXPECT_EQ(runs, std::vector<int>(10, 1));
}

}  // namespace
}  // namespace palpate
