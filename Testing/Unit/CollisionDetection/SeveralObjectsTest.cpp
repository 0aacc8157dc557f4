#include "Common/PairRun.h"

#ifdef PALPATE_TESTS_WITH_TBB
#include <tbb/parallel_for.h>
#endif

#include <atomic>
#include <thread>

// Objects in several threads, and threads of every number: the answers are those of one object with
// one thread.

namespace palpate::testing {
namespace {

std::vector<std::uint64_t> framesOf(const Settings& settings, std::uint64_t seed, int frames = 3) {
  Random random(seed);
  const Mesh a = soup(random, 150, 0.1), b = soup(random, 150, 0.1);
  OctreeBasedCD detection(settings);
  const GeometryId idA = addMesh(detection, a), idB = addMesh(detection, b);
  detection.addCollisionPair(idA, idB, {.thickness = 0.01});
  detection.addCollisionPair(idA, idA, {.method = Method::Proximity, .thickness = 0.01});
  std::vector<std::uint64_t> hashes;
  for (int frame = 0; frame < frames; ++frame) {
    std::vector<Eigen::Vector3d> before = a.positions, now = a.positions;
    for (Eigen::Vector3d& p : now) p += randomPoint(random, -0.02, 0.02);
    detection.setPositions(idA, before, now);
    detection.detectCollision();
    hashes.push_back(detection.collisionData(idA, idB).hash());
    hashes.push_back(detection.collisionData(idA, idA).hash());
  }
  return hashes;
}

// Objects with threads of their own, and objects that share a pool with the one that works.
TEST(SeveralObjects, AreMadeAndDestroyedWhileAnotherWorks) {
  Settings shared;
  shared.executor = makeThreadPool(3);
  for (const Settings& settings : {Settings{.threads = 3}, shared}) {
    const std::vector<std::uint64_t> truth = framesOf({.threads = 1}, 7, 10);
    std::atomic<bool> done{false};
    std::thread other([&] {
      while (!done) framesOf(settings, 8, 1);
    });
    for (int repeat = 0; repeat < casesOf(5); ++repeat) EXPECT_EQ(framesOf(settings, 7, 10), truth);
    done = true;
    other.join();
  }
}

TEST(SeveralObjects, AnyNumberOfThreadsGivesTheSameBits) {
  const std::vector<std::uint64_t> truth = framesOf({.threads = 1}, 3, 1);
  for (int threads = 2; threads <= 64; threads += kShareOfCases)
    EXPECT_EQ(framesOf({.threads = threads}, 3, 1), truth) << threads << " threads";
}

TEST(SeveralObjects, AnswerConstFunctionsInManyThreads) {
  Random random(3);
  const Mesh a = soup(random, 300, 0.2), b = soup(random, 300, 0.2);
  OctreeBasedCD engine(settingsOf(Engine::Octree, 2));
  const GeometryId idA = addMesh(engine, a);
  const GeometryId idB = addMesh(engine, b);
  engine.addCollisionPair(idA, idB, {.thickness = 0.01});
  std::vector<Eigen::Vector3d> now = b.positions;
  for (int frame = 0; frame < 10; ++frame) {
    for (Eigen::Vector3d& p : now) p.x() += 0.01;
    engine.setPositions(idB, now);
    engine.detectCollision();
    std::array<std::size_t, 4> answers{};
    std::vector<std::thread> threads;
    for (std::size_t& answer : answers) {
      threads.emplace_back([&] {
        answer = engine.collisionData(idA, idB).hash() + engine.octree().nodes(idA).size() +
                 engine.octree().validate().size() + engine.statistics().contacts +
                 engine.pairs().size();
      });
    }
    for (std::thread& thread : threads) thread.join();
    for (std::size_t answer : answers) EXPECT_EQ(answer, answers[0]);
    engine.advance();
  }
}

#ifdef PALPATE_TESTS_WITH_TBB
TEST(SeveralObjects, InNestedTasksOfOneTbb) {
  std::vector<std::vector<std::uint64_t>> truth, found(8);
  for (std::uint64_t i = 0; i < found.size(); ++i) truth.push_back(framesOf({.threads = 1}, i));
  tbb::parallel_for(std::size_t{0}, found.size() / 2, [&](std::size_t i) {
    tbb::parallel_for(2 * i, 2 * i + 2,
                      [&](std::size_t j) { found[j] = framesOf({.threads = 2}, j); });
  });
  EXPECT_EQ(found, truth);
}
#endif

}  // namespace
}  // namespace palpate::testing
