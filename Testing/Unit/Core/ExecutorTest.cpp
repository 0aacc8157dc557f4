#include <palpate/Executor.h>

#include "Core/Threads.h"
#include "Executors.h"

#include <palpate/Capture.h>
#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/SupportedMethods.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

// Executors of the caller. Their way to run tasks changes no result.

namespace palpate {
namespace {

/// Two meshes that move: contacts of each method in a few frames.
std::vector<std::uint64_t> hashesOf(const Settings& settings, std::uint64_t seed) {
  std::vector<std::uint64_t> hashes;
  for (const Method method :
       testing::supportedMethods(GeometryType::Triangles, GeometryType::Triangles)) {
    testing::Random random(seed);
    testing::Mesh a = testing::soup(random, 400, 0.05);
    const testing::Mesh b = testing::sheet(24, 0.5, 0.3);
    OctreeBasedCD detection(settings);
    const GeometryId idA = detection.addTriangleMesh(a.positions, a.triangles),
                     idB = detection.addTriangleMesh(b.positions, b.triangles);
    PairSettings pair;
    pair.method = method;
    pair.thickness = 0.01;
    detection.addCollisionPair(idA, idB, pair);
    detection.addCollisionPair(idA, idA, pair);
    for (int frame = 0; frame < 4; ++frame) {
      const std::vector<Eigen::Vector3d> before = a.positions;
      for (Eigen::Vector3d& p : a.positions) p.z() += 0.01;
      detection.setPositions(idA, before, a.positions);
      detection.detectCollision();
      hashes.push_back(detection.collisionData(idA, idB).hash());
      hashes.push_back(detection.collisionData(idA, idA).hash());
    }
  }
  return hashes;
}

Settings sharing(std::shared_ptr<Executor> executor, int threads = 0) {
  Settings settings;
  settings.threads = threads;
  settings.executor = std::move(executor);
  return settings;
}

bool allRun(const Threads& threads, std::size_t size = 1000) {
  std::vector<int> runs(size, 0);
  threads.forEach(size, [&](std::size_t i) { ++runs[i]; });
  return std::all_of(runs.begin(), runs.end(), [](int n) { return n == 1; });
}

TEST(Executor, RunsTheWorkOfAFrame) {
  const auto executor = executorOf(2, backwards);
  hashesOf(sharing(executor), 1);
  EXPECT_GT(executor->calls, 4);
  const auto unused = executorOf(2, backwards);
  hashesOf(sharing(unused, 1), 1);
  EXPECT_EQ(unused->calls, 0) << "one thread needs none";
}

TEST(Executor, IsSharedByObjectsInSeveralThreads) {
  for (const auto& [name, shared] : executors()) {
    const std::shared_ptr<Executor>& executor = shared;
    std::vector<std::vector<std::uint64_t>> truth, found(3);
    for (std::uint64_t i = 0; i < found.size(); ++i) truth.push_back(hashesOf({.threads = 1}, i));
    std::vector<std::thread> threads;
    for (std::uint64_t i = 0; i < found.size(); ++i)
      threads.emplace_back([&, i] { found[i] = hashesOf(sharing(executor), i); });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(found, truth) << name;
  }
}

TEST(Executor, ThreadCountIsAtMostItsConcurrency) {
  EXPECT_EQ(Threads(0, executorOf(5, backwards)).count(), 5);
  EXPECT_EQ(Threads(3, executorOf(5, backwards)).count(), 3);
  EXPECT_EQ(Threads(9, executorOf(5, backwards)).count(), 5);
  EXPECT_EQ(Threads(0, makeThreadPool(4)).count(), 4);
  EXPECT_EQ(makeThreadPool(1)->concurrency(), 1);
  EXPECT_GE(makeThreadPool()->concurrency(), 1);
}

TEST(Executor, NoMoreThreadsThanRequested) {
  for (const std::shared_ptr<Executor>& executor :
       {makeThreadPool(8), std::shared_ptr<Executor>(executorOf(8, onThreads))}) {
    const Threads threads(2, executor);
    std::atomic<int> now{0}, most{0};
    threads.forEach(200, [&](std::size_t) {
      const int inside = ++now;
      for (int seen = most; seen < inside && !most.compare_exchange_weak(seen, inside);) {
      }
      std::this_thread::sleep_for(std::chrono::microseconds(20));
      --now;
    });
    EXPECT_LE(most, 2);
  }
}

TEST(Executor, WithoutConcurrencyIsRefused) {
  for (const int concurrency : {0, -1})
    testing::expectRefused(ErrorCode::InvalidSettings, "", [&] {
      OctreeBasedCD detection(sharing(executorOf(concurrency, backwards)));
    });
  for (const int threads : {-1, 1025}) EXPECT_THROW(makeThreadPool(threads), Error) << threads;
}

/// Tasks that a faulty executor has postponed.
struct Later {
  Executor::Task task;
  void* context;
};

TEST(Executor, ReturningEarlyIsAnErrorAndLaterTasksDoNothing) {
  std::vector<Later> later;
  bool faulty = true;
  const auto executor = executorOf(3, [&](std::size_t count, Executor::Task task, void* context) {
    std::size_t i = 0;
    if (!faulty)
      for (; i < count; ++i) task(context, i);
    for (; i < count; ++i) later.push_back({task, context});
  });
  {
    const Threads threads(0, executor);
    std::atomic<int> runs{0};
    for (int repeat = 0; repeat < 3; ++repeat) {
      testing::expectRefused(ErrorCode::InvalidSettings, "",
                             [&] { threads.forEach(10, [&](std::size_t) { ++runs; }); });
      faulty = false;
      EXPECT_TRUE(allRun(threads));
      faulty = true;
    }
    EXPECT_EQ(runs, 0);
    ASSERT_EQ(later.size(), 9u);
    for (std::size_t i = 0; i + 2 < later.size(); ++i) later[i].task(later[i].context, 0);
    faulty = false;
    EXPECT_TRUE(allRun(threads));
    EXPECT_EQ(runs, 0);
    // The last two tasks run in the end, so that the memory of all loops is returned.
    for (std::size_t i = 7; i < later.size(); ++i) later[i].task(later[i].context, 0);
  }
}

TEST(Executor, ReturningWhileTasksRunWaitsForThem) {
  std::vector<std::thread> running;
  const auto executor = executorOf(3, [&](std::size_t count, Executor::Task task, void* context) {
    std::atomic<std::size_t> begun{0};
    for (std::size_t i = 0; i < count; ++i) running.emplace_back([=] { task(context, i); });
    while (begun++ < 1000) std::this_thread::yield();
  });
  const Threads threads(0, executor);
  for (int repeat = 0; repeat < testing::casesOf(20); ++repeat) {
    std::vector<int> runs(40, 0);
    bool complete = true;
    try {
      threads.forEach(runs.size(), [&](std::size_t i) {
        std::this_thread::sleep_for(std::chrono::microseconds(100));
        ++runs[i];
      });
    } catch (const Error&) {
      complete = false;
    }
    // No task runs any more: reading is no race, and without an error all have run.
    for (const int n : runs) EXPECT_TRUE(n == 1 || (n == 0 && !complete));
    for (std::thread& thread : running) thread.join();
    running.clear();
  }
}

TEST(Executor, ItsExceptionIsRethrownAfterStartedTasksEnd) {
  std::thread running;
  bool faulty = true;
  const auto executor = executorOf(2, [&](std::size_t count, Executor::Task task, void* context) {
    if (!faulty) return backwards(count, task, context);
    std::atomic<bool> begun{false};
    running = std::thread([&, task, context] {
      begun = true;
      task(context, 0);
    });
    while (!begun) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    throw std::bad_alloc();
  });
  auto threads = std::make_unique<Threads>(0, executor);
  std::vector<int> runs(1000, 0);
  EXPECT_THROW(threads->forEach(runs.size(),
                                [&](std::size_t i) {
                                  // Some systems sleep for whole milliseconds, or not at all.
                                  using Clock = std::chrono::steady_clock;
                                  const auto end = Clock::now() + std::chrono::microseconds(10);
                                  while (Clock::now() < end) {
                                  }
                                  ++runs[i];
                                }),
               std::bad_alloc);
  EXPECT_LT(std::count(runs.begin(), runs.end(), 1), 1000);
  running.join();
  faulty = false;
  EXPECT_TRUE(allRun(*threads));
}

TEST(Executor, IsNotPartOfACollisionProblem) {
  OctreeBasedCD detection(sharing(executorOf(2, backwards)));
  EXPECT_TRUE(detection.settings().executor);
  const CollisionProblem problem = detection.problem();
  EXPECT_FALSE(problem.settings.executor);
  EXPECT_FALSE(setUp(problem).settings().executor);
}

TEST(Executor, PoolRunsTasksOfTheProgram) {
  const std::shared_ptr<Executor> pool = makeThreadPool(3);
  std::vector<int> runs(100, 0);
  pool->run(
      runs.size(),
      [](void* context, std::size_t i) noexcept {
        ++(*static_cast<std::vector<int>*>(context))[i];
      },
      &runs);
  EXPECT_EQ(runs, std::vector<int>(100, 1));
}

}  // namespace
}  // namespace palpate
