#include "Core/Threads.h"

#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ChildProcess.h"
#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <memory>
#include <sched.h>
#include <stdexcept>
#include <string>
#include <sys/resource.h>
#include <thread>
#include <time.h>
#include <vector>

// Behaviour of threads if the system refuses them, in the child of a fork(), and under real-time
// scheduling.

namespace palpate {
namespace {

using testing::inChild;

/// Two meshes in contact, detected once for each call of hash().
class Scene {
 public:
  explicit Scene(const Settings& settings) : m_detection(settings) {
    testing::Random random(1);
    const testing::Mesh a = testing::soup(random, 600, 0.05), b = testing::sheet(20, 0.5, 0.3);
    m_a = m_detection.addTriangleMesh(a.positions, a.triangles);
    m_b = m_detection.addTriangleMesh(b.positions, b.triangles);
    PairSettings pair;
    pair.method = Method::Proximity;
    pair.thickness = 0.01;
    m_detection.addCollisionPair(m_a, m_b, pair);
    m_detection.addCollisionPair(m_a, m_a, pair);
  }
  std::uint64_t hash() {
    m_detection.detectCollision();
    return m_detection.collisionData(m_a, m_b).hash() ^
           (m_detection.collisionData(m_a, m_a).hash() << 1);
  }
  std::size_t contacts() const { return m_detection.collisionData(m_a, m_b).edgeEdge().size(); }

 private:
  OctreeBasedCD m_detection;
  GeometryId m_a{}, m_b{};
};

std::uint64_t serialHash() {
  Scene scene({.threads = 1});
  const std::uint64_t hash = scene.hash();
  EXPECT_GT(scene.contacts(), 10u);
  return hash;
}

bool everyIndexRuns(const Threads& threads, std::size_t size = 1000) {
  std::vector<int> runs(size, 0);
  threads.forEach(size, [&](std::size_t i) { ++runs[i]; });
  return std::all_of(runs.begin(), runs.end(), [](int n) { return n == 1; });
}

// --- The system refuses threads

/// Limits the address space to this much more than now.
void limitAddressSpace(std::size_t bytes) {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlim_t most = pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) + bytes;
  const rlimit limit{most, most};
  if (setrlimit(RLIMIT_AS, &limit) != 0) throw std::runtime_error("setrlimit");
}

constexpr int kAsked = 1024;
#ifdef PALPATE_THREADS_TBB
constexpr bool kStartsAsMany =
    false;  // oneTBB starts at most as many threads as there are cores, without a message
#else
constexpr bool kStartsAsMany = true;
#endif

TEST(ThreadFailures, FewerThreadsDoTheWorkIfMemoryIsShort) {
  if (testing::kSanitized || testing::kEmulated)
    GTEST_SKIP() << "sanitizers and emulators reserve address space of their own";
  for (const std::size_t bytes : {std::size_t{16} << 20, std::size_t{200} << 20})
    EXPECT_EQ(inChild([&] {
                limitAddressSpace(bytes);
                const Threads threads(kAsked);
                return (threads.count() < kAsked || !kStartsAsMany) && everyIndexRuns(threads);
              }),
              "passed");
}

TEST(ThreadFailures, FrameIsCorrectIfMemoryForThreadsIsShort) {
  if (testing::kSanitized) GTEST_SKIP() << "sanitizers reserve address space of their own";
  const std::uint64_t truth = serialHash();
  EXPECT_EQ(inChild([&] {
              limitAddressSpace(std::size_t{200} << 20);
              Scene scene({.threads = kAsked});
              return scene.hash() == truth && scene.hash() == truth;
            }),
            "passed");
}

// --- fork()

/// Forks while the pool's threads are awake, about to sleep, and asleep.
void pauseFor(int repeat) {
  if (repeat % 4 != 0) std::this_thread::sleep_for(std::chrono::microseconds(5 * repeat));
}

/// An object that is destroyed there, too.
TEST(ThreadFailures, FrameInTheChildOfAForkIsCorrect) {
  if (!testing::kForksBesideThreads) GTEST_SKIP() << testing::kNoForks;
  const std::uint64_t truth = serialHash();
  auto scene = std::make_unique<Scene>(Settings{.threads = 9});
  for (int repeat = 0; repeat < 50; ++repeat) {
    ASSERT_EQ(scene->hash(), truth);
    pauseFor(repeat);
    ASSERT_EQ(inChild([&] {
                const bool right = scene->hash() == truth && scene->hash() == truth;
                scene.reset();
                return right;
              }),
              "passed")
        << repeat;
  }
  EXPECT_EQ(scene->hash(), truth);
}

TEST(ThreadFailures, ObjectMadeInTheChildOfAForkHasThreads) {
  if (testing::kSanitized || testing::kEmulated)
    GTEST_SKIP() << "sanitizers and emulators do not start threads after a fork()";
  const Threads before(3);
  ASSERT_TRUE(everyIndexRuns(before));
  EXPECT_EQ(inChild([&] {
              const Threads threads(3);
              if (!kStartsAsMany)
                return everyIndexRuns(threads);  // oneTBB has no threads in the child
              std::atomic<int> met{0};
              // This returns only if two threads run.
              threads.forEach(2, [&](std::size_t) {
                ++met;
                while (met < 2) std::this_thread::yield();
              });
              return inChild([&] { return everyIndexRuns(before) && everyIndexRuns(threads); }) ==
                     "passed";
            }),
            "passed");
}

TEST(ThreadFailures, ForkWhileAnotherThreadUsesThePoolIsSafe) {
  if (!testing::kForksBesideThreads) GTEST_SKIP() << testing::kNoForks;
  const std::shared_ptr<Executor> pool = makeThreadPool(3);
  std::atomic<bool> over{false};
  std::thread other([&] {
    const Threads threads(0, pool);
    while (!over) threads.forEach(20, [](std::size_t) {});
  });
  auto threads = std::make_unique<Threads>(0, pool);
  for (int repeat = 0; repeat < 100; ++repeat)
    EXPECT_EQ(inChild([&] {
                const bool right = everyIndexRuns(*threads);
                threads.reset();
                return right;
              }),
              "passed");
  over = true;
  other.join();
}

#ifndef PALPATE_THREADS_TBB
TEST(ThreadFailures, ForkInASharedTaskIsAnErrorInTheChild) {
  if (!testing::kForksBesideThreads) GTEST_SKIP() << testing::kNoForks;
  const Threads threads(2);
  std::atomic<bool> forked{false}, parent{true};
  std::string outcome;
  std::atomic<int> inside{0};
  const auto isError = [&] {
    try {
      threads.forEach(2, [&](std::size_t i) {
        ++inside;
        while (inside < 2) std::this_thread::yield();
        if (i == 0) {
          const pid_t child = fork();
          if (child == 0) {
            parent = false;
            alarm(20);
          } else {
            int status = 0;
            waitpid(child, &status, 0);
            outcome = WIFEXITED(status) ? "exit " + std::to_string(WEXITSTATUS(status)) : "signal";
          }
          forked = true;
        } else {
          while (!forked) std::this_thread::yield();
        }
      });
    } catch (const Error& error) {
      return error.code() == ErrorCode::NotAvailable;
    }
    return false;
  }();
  if (!parent) _exit(isError ? 0 : 1);
  EXPECT_FALSE(isError);
  EXPECT_EQ(outcome, "exit 0");
  EXPECT_TRUE(everyIndexRuns(threads));
}
#endif

// --- Real-time scheduling

std::chrono::nanoseconds cpuTime() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

/// What f() returns in a child whose main thread is real-time, on one core with its workers, which
/// are not.
template <class F>
void expectInRealTime(int threadCount, F&& f) {
  const std::string outcome = inChild(
      [&] {
        cpu_set_t cores;
        CPU_ZERO(&cores);
        CPU_SET(sched_getcpu(), &cores);
        if (sched_setaffinity(0, sizeof cores, &cores) != 0) _exit(77);
        const Threads threads(threadCount);
        if (!everyIndexRuns(threads)) return false;
        const sched_param priority{1};
        if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) _exit(77);
        return f(threads);
      },
      60);
  if (outcome == "exit 77") GTEST_SKIP() << "SCHED_FIFO is not permitted here";
  EXPECT_EQ(outcome, "passed");
}

void work(std::chrono::nanoseconds time) {
  for (const auto end = cpuTime() + time; cpuTime() < end;) {
  }
}

/// A worker that the real-time caller has preempted holds the last index of a loop. On one core it
/// goes on only if the caller blocks, or in the share that the kernel reserves for others (a
/// twentieth).
TEST(ThreadFailures, RealTimeCallerOnTheCoreOfItsWorkerDoesNotSpinForever) {
#ifdef PALPATE_THREADS_TBB
  GTEST_SKIP() << "oneTBB's own rules hold";
#endif
  expectInRealTime(2, [](const Threads& threads) {
    const auto start = cpuTime();
    for (int loop = 0; loop < 50; ++loop) {
      std::atomic<bool> begun{false};
      threads.forEach(2, [&](std::size_t i) {
        if (i == 1) {
          begun = true;
          work(std::chrono::milliseconds(2));
        } else {
          // Gives the core to the worker until it has begun, then is real-time again.
          while (!begun) std::this_thread::sleep_for(std::chrono::microseconds(50));
        }
      });
    }
    return cpuTime() - start < std::chrono::milliseconds(100);  // as much as the worker
  });
}

/// Many short loops. Either thread may hold the pool's lock when the other one preempts it.
TEST(ThreadFailures, RealTimeCallerOnTheCoreOfItsWorkersRunsManyLoops) {
  expectInRealTime(4, [](const Threads& threads) {
    for (int loop = 0; loop < 2000; ++loop) {
      if (!everyIndexRuns(threads, 8)) return false;
      if (loop % 10 == 0) std::this_thread::sleep_for(std::chrono::microseconds(20));
    }
    return true;
  });
}

}  // namespace
}  // namespace palpate
