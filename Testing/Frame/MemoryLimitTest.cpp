// Settings::memoryLimit, FrameStatistics::memory and releaseMemory().
#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/WholeScene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace palpate::testing {
namespace {

Settings limited(int threads, std::size_t memoryLimit) {
  Settings settings = settingsOf(Engine::Octree, threads);
  settings.memoryLimit = memoryLimit;
  return settings;
}

/// Calls a function. Returns whether it was refused by the memory limit.
template <class F>
bool isRefused(F&& call) {
  try {
    call();
    return false;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::MemoryLimit) << error.what();
    return true;
  }
}

/// n triangles in planes at right angles to an axis. All triangles of two axes cross.
Mesh fan(std::uint32_t n, int axis) {
  Mesh mesh;
  const int other = 1 - axis;
  for (std::uint32_t i = 0; i < n; ++i) {
    Vector3d p = Vector3d::Zero();
    p[axis] = 0.5 * i / n - 0.25;
    for (const auto& [along, up] : {std::pair(-1.0, -1.0), {1.0, -1.0}, {0.0, 1.0}}) {
      p[other] = along;
      p[2] = up;
      mesh.positions.push_back(p);
    }
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

class MemoryLimit : public ::testing::TestWithParam<int> {};

/// The object states what operator new was asked for, and gives all of it back.
TEST_P(MemoryLimit, StatesWhatIsAllocated) {
  const WholeSceneInput input(40);
  FailingAllocation::arm(0);
  {
    WholeScene scene(input, limited(GetParam(), 0));
    const auto check = [&](const char* when) {
      // Lists of pairs and stacks of queries, threads, names of small objects, and what malloc()
      // rounds up.
      const double stated = static_cast<double>(scene.detection.memoryUse().total),
                   allocated = static_cast<double>(FailingAllocation::bytes());
      EXPECT_LE(stated, allocated) << when;
      EXPECT_GE(stated, 0.97 * allocated - 1e5) << when;
    };
    check("added");
    for (int frame = 0; frame < 3; ++frame) {
      scene.move(frame);
      scene.detection.detectCollision();
      check("frame");
      scene.detection.advance();
      scene.detection.publish();
      check("published");
      scene.query(scene.detection.queries());
      check("queries");
    }
    const auto snapshot = scene.detection.latestSnapshot();
    scene.query(snapshot->queries());
    scene.detection.forEachCandidate([](auto&&...) {});
    check("candidates");
    const MemoryUse& use = scene.detection.statistics().memory;
    EXPECT_EQ(use.total, use.geometries + use.octrees + use.pairs + use.narrowPhase + use.results +
                             use.queries + use.snapshots);
    for (const std::size_t bytes : {use.geometries, use.octrees, use.pairs, use.narrowPhase,
                                    use.results, use.queries, use.snapshots})
      EXPECT_GT(bytes, 1000u);
    EXPECT_GE(scene.detection.statistics().peakMemory.total, use.total);
    const std::uint64_t hash = scene.hash();
    scene.detection.releaseMemory();
    check("released");
    EXPECT_LT(scene.detection.memoryUse().total, use.total);
    EXPECT_LT(scene.detection.memoryUse().narrowPhase, 1000u);
    EXPECT_EQ(scene.hash(), hash);
    EXPECT_EQ(scene.detection.octree().validate(), std::vector<std::string>{});
    scene.query(scene.detection.queries());
    scene.query(snapshot->queries());
  }
  FailingAllocation::disarm();
  EXPECT_LT(FailingAllocation::bytes(), 10000u);
}

/// What a burst allocated is given back by releaseMemory(), or within so many detections without a
/// call. Answers are those of an object that never had the burst. It is given back once: later
/// frames allocate nothing.
TEST_P(MemoryLimit, ABurstIsGivenBack) {
  const Mesh a = fan(300, 0), b = fan(300, 1);
  std::vector<Positions> away(7, b.positions);
  for (std::size_t i = 0; i < away.size(); ++i)
    for (Vector3d& p : away[i]) p[2] += 100 + 1e-3 * static_cast<double>(i);
  const auto settings = limited(GetParam(), 0);
  const PairSettings pair{.method = Method::Intersection, .trackContacts = true};
  PairRun bursting(settings, a, b, pair, false), calm(settings, a, b, pair, false);
  const auto set = [](PairRun& run, const Positions& positions) {
    run.detection().advance();
    run.detection().setPositions(run.b(), positions);
    run.detection().detectCollision();
  };
  const auto memory = [](PairRun& run) { return run.detection().memoryUse().total; };
  for (PairRun* run : {&bursting, &calm}) set(*run, away[0]);
  for (const bool isReleased : {true, false, false}) {
    for (int frame = 0; frame < 50 && !isReleased; ++frame) set(bursting, away[1]);
    set(bursting, b.positions);
    EXPECT_EQ(bursting.data().intersectingTriangles().size(), 90000u);
    EXPECT_GT(memory(bursting), 10 * memory(calm));
    EXPECT_GE(bursting.detection().statistics().peakMemory.total, memory(bursting));
    if (isReleased) {
      const std::uint64_t hash = bursting.data().hash();
      bursting.detection().releaseMemory();
      EXPECT_EQ(bursting.data().hash(), hash);
      for (const Positions& positions : {away[0], away[1]}) set(bursting, positions);  // ended ones
      bursting.detection().releaseMemory();
      EXPECT_LT(memory(bursting), memory(calm) + memory(calm) / 4);
    }
    for (std::size_t frame = 0; frame < 256; ++frame)
      for (PairRun* run : {&bursting, &calm}) set(*run, away[frame % away.size()]);
    EXPECT_LT(memory(bursting), memory(calm) + memory(calm) / 4 + 100'000);
    EXPECT_EQ(bursting.data().hash(), calm.data().hash());
    EXPECT_EQ(bursting.data().validity(), calm.data().validity());
  }
  for (std::size_t frame = 0; frame < 8; ++frame) set(bursting, away[frame % away.size()]);
  FailingAllocation::arm(0);
  for (std::size_t frame = 0; frame < 300; ++frame) set(bursting, away[frame % away.size()]);
  FailingAllocation::disarm();
#ifndef PALPATE_VALIDATE  // the check of an octree allocates
  EXPECT_EQ(FailingAllocation::count(), 0u);
#endif
  for (PairRun* run : {&bursting, &calm}) set(*run, b.positions);
  EXPECT_EQ(bursting.data().hash(), calm.data().hash());
}

/// Each limit gives complete answers or the error. The last answers stay, and frames that fit work
/// again.
void expectEveryLimitIsKept(int threads, bool withProxy, std::size_t limits) {
  const WholeSceneInput input(8);
  // `easy` frames have everything that deforms far from the rest.
  const auto easy = [](WholeScene& scene, double time) {
    scene.move(time, 10.0);
    scene.detection.detectCollision();
  };
  const auto hard = [](WholeScene& scene, double time) {
    scene.move(time);
    scene.detection.detectCollision();
    scene.detection.publish();
    scene.query(scene.detection.queries());
  };
  std::size_t easyPeak = 0, peak = 0, peakAfterwards = 0;
  std::uint64_t easyHash = 0, hardHash = 0;
  {
    WholeScene scene(input, limited(threads, 0), withProxy);
    // As many detections as below: a check of the start of a step has a budget for several.
    easy(scene, 0), easy(scene, 1);
    easyPeak = scene.detection.statistics().peakMemory.total;
    easyHash = scene.hash();  // of time 1
    hard(scene, 2);
    hardHash = scene.hash();
    scene.detection.update();
    peak = scene.detection.statistics().peakMemory.total;
    // The snapshot stays, and so do the results until the next ones are complete.
    scene.detection.releaseMemory();
    easy(scene, 1);
    peakAfterwards = scene.detection.statistics().peakMemory.total;
  }
  ASSERT_NE(easyHash, hardHash);
  int refusedScenes = 0, refusedFrames = 0, completeFrames = 0;
  std::vector<std::size_t> tested{1};
  constexpr int kShareOfLimits = std::min(kShareOfCases, 5);
  const std::size_t step = kShareOfLimits * peak / limits;
  for (std::size_t limit = peak + peak / 50; limit > 0; limit -= std::min(limit, step))
    tested.push_back(limit);
  for (const std::size_t limit : tested) {
    SCOPED_TRACE("limit " + std::to_string(limit) + " of " + std::to_string(peak));
    std::unique_ptr<WholeScene> made;
    if (isRefused([&] {
          made = std::make_unique<WholeScene>(input, limited(threads, limit), withProxy);
        })) {
      ++refusedScenes;
      continue;
    }
    WholeScene& scene = *made;
    bool works = !isRefused([&] { easy(scene, 0), easy(scene, 1); });
    ASSERT_TRUE(works || limit < easyPeak);
    if (!works) continue;
    ASSERT_EQ(scene.hash(), easyHash);
    if (isRefused([&] { hard(scene, 2); })) {
      ++refusedFrames;
      const std::uint64_t hash = scene.hash();
      ASSERT_TRUE(hash == easyHash || hash == hardHash);
      ASSERT_EQ(scene.detection.octree().validate(), std::vector<std::string>{});
    } else {
      ++completeFrames;
      ASSERT_EQ(scene.hash(), hardHash);
    }
    ASSERT_LE(scene.detection.memoryUse().total, limit);
    ASSERT_LE(scene.detection.statistics().peakMemory.total, limit);
    works = !isRefused([&] { easy(scene, 1); });
    ASSERT_TRUE(works || limit < std::max(easyPeak, peakAfterwards));
    ASSERT_TRUE(!works || scene.hash() == easyHash);
  }
  EXPECT_GT(refusedScenes, 0);
  EXPECT_GT(completeFrames, 0);
  // The leaves of a proxy take more than all the rest, in the first frame.
  EXPECT_GT(refusedFrames, withProxy ? -1 : 5 / kShareOfLimits);
}

TEST_P(MemoryLimit, EveryLimitIsKept) { expectEveryLimitIsKept(GetParam(), false, 100); }
TEST_P(MemoryLimit, EveryLimitIsKeptWithProxies) { expectEveryLimitIsKept(GetParam(), true, 12); }

INSTANTIATE_TEST_SUITE_P(Threads, MemoryLimit, ::testing::Values(1, 2));

/// The message says what needs how much, and the limit.
TEST(MemoryUse, AFrameWithTooManyContactsIsRefused) {
  const Mesh a = fan(400, 0), b = fan(400, 1);
  Positions away = b.positions;
  for (Vector3d& p : away) p[2] += 100;
  PairRun run(limited(1, 4'000'000), a, b, {Method::Intersection}, false);
  run.detection().setPositions(run.b(), away);
  run.detect();
  run.detection().setPositions(run.b(), b.positions);
  for (const char* words : {"the narrow phase would need ", "memoryLimit is 4000000 bytes"})
    expectRefused(ErrorCode::MemoryLimit, words, [&] { run.detect(); });
  EXPECT_TRUE(run.data().intersectingTriangles().empty());
  run.detection().setPositions(run.b(), away);
  run.detect();
}

/// Memory that earlier frames needed does not refuse a frame that fits without it.
TEST(MemoryUse, SpareMemoryIsGivenBackFirst) {
  const Mesh a = fan(100, 0), b = fan(100, 1);
  const auto frames = [&](std::size_t limit, std::size_t& least, std::size_t& most) {
    OctreeBasedCD detection(limited(1, limit));
    const GeometryId first = addMesh(detection, a);
    std::vector<GeometryId> others;
    Positions away = b.positions;
    for (Vector3d& p : away) p[2] += 100;
    for (int i = 0; i < 8; ++i) {
      others.push_back(detection.addTriangleMesh(away, b.triangles));
      detection.addCollisionPair(first, others.back(), {Method::Intersection});
    }
    for (std::size_t i = 0; i < others.size(); ++i) {
      if (i > 0) detection.setPositions(others[i - 1], away);
      detection.setPositions(others[i], b.positions);
      detection.detectCollision();
      EXPECT_EQ(detection.collisionData(first, others[i]).intersectingTriangles().size(), 10000u);
      most = detection.statistics().peakMemory.total;
      if (i == 0) least = most;
    }
  };
  std::size_t least = 0, most = 0, none = 0;
  frames(0, least, most);
  ASSERT_GT(most, 2 * least);
  frames(least + least / 2, none, none);
}

/// A copy of a result, and a field, belong to the user. A snapshot counts until it is let go.
TEST(MemoryUse, CountsSnapshotsAndNotWhatTheUserOwns) {
  const WholeSceneInput input(12);
  WholeScene scene(input, limited(1, 0));
  scene.move(0);
  scene.detection.detectCollision();
  const std::size_t before = scene.detection.memoryUse().total;
  const CollisionData copy = scene.detection.collisionData(scene.organ, scene.floor);
  const CollisionProblem problem = scene.detection.problem();
  EXPECT_EQ(scene.detection.memoryUse().total, before);
  EXPECT_EQ(problem.settings.memoryLimit, 0u);
  scene.detection.publish();
  auto held = scene.detection.latestSnapshot();
  const std::size_t one = scene.detection.memoryUse().snapshots;
  EXPECT_GT(one, 10000u);
  scene.move(1);
  scene.detection.publish();
  const std::size_t two = scene.detection.memoryUse().snapshots;
  EXPECT_GT(two, one + one / 4);
  scene.detection.releaseMemory();
  EXPECT_GT(scene.detection.memoryUse().snapshots, one + one / 4);
  held.reset();
  scene.detection.releaseMemory();
  EXPECT_LT(scene.detection.memoryUse().snapshots, two);
}

}  // namespace
}  // namespace palpate::testing
