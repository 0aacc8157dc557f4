#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Unit/Math/ImpactOracle.h"

#include <palpate/OctreeBasedCD.h>
#include <palpate/ThreadTopology.h>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;
using Cause = ThreadEvent::Cause;

/// Gauss's linking integral of two closed polygons, a sum of solid angles (Klenin and Langowski,
/// Biopolymers 54, 2000).
double linkingIntegral(const Positions& a, const Positions& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t k = 0; k < b.size(); ++k) {
      const Vector3d p = a[i], q = a[(i + 1) % a.size()], r = b[k], s = b[(k + 1) % b.size()];
      const auto normal = [](const Vector3d& u, const Vector3d& v) {
        const Vector3d n = u.cross(v);
        return Vector3d(n.norm() > 0 ? n.normalized() : n);
      };
      const Vector3d n[] = {normal(r - p, s - p), normal(s - p, s - q), normal(s - q, r - q),
                            normal(r - q, r - p)};
      double angle = 0;
      for (int m = 0; m < 4; ++m)
        angle += std::asin(std::clamp(n[m].dot(n[(m + 1) % 4]), -1.0, 1.0));
      sum += std::copysign(angle, (s - r).cross(q - p).dot(r - p));
    }
  return sum / (4 * std::numbers::pi);
}

std::vector<Segment> segmentsOf(std::uint32_t count, bool isClosed) {
  std::vector<Segment> segments;
  for (std::uint32_t v = 0; v + 1 < count; ++v) segments.push_back({v, v + 1});
  if (isClosed) segments.push_back({count - 1, 0});
  return segments;
}

std::vector<std::uint32_t> placesOf(std::uint32_t first, std::uint32_t count) {
  std::vector<std::uint32_t> vertices(count);
  std::iota(vertices.begin(), vertices.end(), first);
  return vertices;
}

/// A thread and a loop, lines of one detection.
struct Watched {
  OctreeBasedCD collisions;
  Positions thread, loop;
  GeometryId threadId, loopId;
  ThreadTopology topology{collisions};
  std::size_t index;
  bool isClosed;

  Watched(Positions threadAt, Positions loopAt, bool closed)
      : thread(std::move(threadAt)), loop(std::move(loopAt)), isClosed(closed) {
    const auto count = [](const Positions& p) { return static_cast<std::uint32_t>(p.size()); };
    threadId = collisions.addLineMesh(thread, segmentsOf(count(thread), closed), 0.0);
    loopId = collisions.addLineMesh(loop, segmentsOf(count(loop), true), 0.0);
    std::vector<std::uint32_t> path = placesOf(0, count(thread));
    if (closed) path.push_back(0);
    index = topology.add({threadId, path}, {loopId, placesOf(0, count(loop))});
    collisions.advance();
  }
  int count() const { return topology.count(index); }
  /// Moves to these positions and looks at the step. Returns its events.
  std::vector<ThreadEvent> step(const Positions& nextThread, const Positions& nextLoop) {
    topology.clear();
    collisions.setPositions(threadId, nextThread);
    collisions.setPositions(loopId, nextLoop);
    topology.update();
    collisions.advance();
    thread = nextThread, loop = nextLoop;
    return {topology.events().begin(), topology.events().end()};
  }
};

using Row = std::tuple<bool, std::array<std::uint32_t, 2>, std::array<std::uint32_t, 2>, int>;

/// The passages in a step, by rational arithmetic alone.
std::vector<Row> passageTruth(const Watched& all, const Positions& thread, const Positions& loop) {
  std::vector<Row> rows;
  const auto query = [&](bool edges, const auto& ofThread, const auto& ofLoop, auto&& add) {
    impact::Positions p;
    std::size_t i = 0;
    for (const std::uint32_t v : ofThread) p[i] = all.thread[v], p[4 + i++] = thread[v];
    for (const std::uint32_t v : ofLoop) p[i] = all.loop[v], p[4 + i++] = loop[v];
    for (const auto& passage : impact::Query(edges, p).passages()) add(passage.forward ? 1 : -1);
  };
  const auto size = static_cast<std::uint32_t>(thread.size()),
             sides = static_cast<std::uint32_t>(loop.size());
  for (std::uint32_t v = 0; v + (all.isClosed ? 0 : 1) < size; ++v)
    for (std::uint32_t s = 0; s < sides; ++s) {
      const std::array edge{v, (v + 1) % size}, side{s, (s + 1) % sides};
      query(true, edge, side, [&](int change) { rows.emplace_back(false, edge, side, change); });
    }
  constexpr std::array kNone{kNoElement, kNoElement};
  for (const std::uint32_t v : {0u, size - 1})
    for (std::uint32_t s = 1; !all.isClosed && s + 1 < sides; ++s)
      query(false, std::array{v}, std::array{0u, s, s + 1}, [&](int change) {
        rows.emplace_back(true, std::array{v, v}, kNone, v == 0 ? -change : change);
      });
  std::sort(rows.begin(), rows.end());
  return rows;
}

std::vector<Row> rowsOf(const std::vector<ThreadEvent>& events) {
  std::vector<Row> rows;
  for (const ThreadEvent& e : events) {
    EXPECT_TRUE(e.cause == Cause::Passed || e.cause == Cause::EndPassed) << toString(e.cause);
    rows.emplace_back(e.cause == Cause::EndPassed, e.thread, e.loop, e.change);
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

int sumOf(const std::vector<ThreadEvent>& events) {
  int sum = 0;
  for (const ThreadEvent& e : events) sum += e.change;
  return sum;
}

Positions polygon(Random& random, std::size_t size) {
  Positions positions;
  for (std::size_t i = 0; i < size; ++i) positions.push_back(randomPoint(random, -1, 1));
  return positions;
}

Positions shaken(Random& random, Positions positions, double by) {
  for (Vector3d& p : positions)
    if (random() % 4 != 0) p += randomPoint(random, -by, by);
  return positions;
}

TEST(ThreadTopology, CountsOfClosedThreadsAreLinkingNumbersAfterEachOfManySteps) {
  Random random(1);
  constexpr int kRepeats = 20, kSteps = 5000 / kShareOfCases;
  std::size_t changes = 0;
  int largest = 0;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    Watched all(polygon(random, 7), polygon(random, 6), true);
    for (int i = 0; i < kSteps; ++i) {
      const int before = all.count();
      // They are drawn back, so that they do not drift apart.
      const auto next = [&](Positions p) {
        for (Vector3d& q : p) q *= 0.99;
        return shaken(random, p, 0.2);
      };
      const auto events = all.step(next(all.thread), next(all.loop));
      ASSERT_EQ(before + sumOf(events), all.count());
      const double integral = linkingIntegral(all.thread, all.loop);
      ASSERT_NEAR(all.count(), integral, 1e-6) << repeat << ' ' << i;
      changes += all.count() != before;
      largest = std::max(largest, std::abs(all.count()));
    }
  }
  EXPECT_GT(changes, 1000u / kShareOfCases);
  EXPECT_GT(largest, 1);
}

TEST(ThreadTopology, EventsAreThePassagesOfRationalArithmetic) {
  Random random(2);
  std::size_t passages = 0, ends = 0;
  for (int repeat = 0; repeat < 90; ++repeat) {
    Watched all(polygon(random, 5), polygon(random, 5), repeat % 3 == 0);
    for (int i = 0; i < 10; ++i) {
      const Positions thread = shaken(random, all.thread, 0.3),
                      loop = shaken(random, all.loop, 0.3);
      const std::vector<Row> truth = passageTruth(all, thread, loop);
      const auto events = all.step(thread, loop);
      ASSERT_EQ(rowsOf(events), truth) << repeat << ' ' << i;
      ASSERT_TRUE(std::is_sorted(events.begin(), events.end(),
                                 [](const auto& l, const auto& r) { return l.time < r.time; }));
      passages += truth.size();
      ends += static_cast<std::size_t>(
          std::count_if(truth.begin(), truth.end(), [](const Row& r) { return std::get<0>(r); }));
    }
  }
  EXPECT_GT(passages, 300u);
  EXPECT_GT(ends, 30u);
}

/// Small integers: vertices lie in surfaces and on edges, and pass exactly through them.
TEST(ThreadTopology, IsConsistentWhereFeaturesOnlyTouch) {
  Random random(3);
  const auto snapped = [](Positions positions) {
    for (Vector3d& p : positions) p = (p * 2).array().round().matrix();
    return positions;
  };
  std::size_t changes = 0;
  for (int repeat = 0; repeat < 60; ++repeat) {
    const bool isClosed = repeat % 2 == 0;
    Watched all(snapped(polygon(random, 6)), snapped(polygon(random, 5)), isClosed);
    for (int i = 0; i < 20; ++i) {
      const int before = all.count();
      const auto events = all.step(snapped(polygon(random, 6)), snapped(polygon(random, 5)));
      ASSERT_EQ(before + sumOf(events), all.count());
      changes += all.count() != before;
      // The same positions count the same, however they were reached.
      Watched fresh(all.thread, all.loop, isClosed);
      ASSERT_EQ(fresh.count(), all.count());
    }
  }
  EXPECT_GT(changes, 100u);
}

/// A thread along z through a square hole.
Positions threadAt(double x, double z) {
  Positions positions;
  for (int i = 0; i < 4; ++i) positions.emplace_back(x, 0.1, z + i);
  return positions;
}
const Positions kHole{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};

TEST(ThreadTopology, AStitchIsSewnSlipsOutAndTearsOut) {
  Watched all(threadAt(0, -4), kHole, false);
  EXPECT_EQ(all.count(), 0);
  auto events = all.step(threadAt(0, -2), kHole);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(all.count(), 1);
  EXPECT_EQ(events[0].cause, Cause::EndPassed);
  EXPECT_EQ(events[0].change, 1);
  EXPECT_EQ(events[0].step, 1u);
  EXPECT_EQ(events[0].thread, (std::array{3u, 3u}));
  EXPECT_NEAR(events[0].time, 0.5, 1e-9);
  EXPECT_TRUE(all.step(threadAt(0.5, -1.5), kHole).empty());

  events = all.step(threadAt(2, -1.5), kHole);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(all.count(), 0);
  EXPECT_EQ(events[0].cause, Cause::Passed);
  EXPECT_EQ(events[0].change, -1);
  EXPECT_EQ(events[0].step, 3u);
  EXPECT_EQ(events[0].thread, (std::array{1u, 2u}));
  EXPECT_EQ(events[0].loop, (std::array{1u, 2u}));

  all.step(threadAt(0, -1.5), kHole);
  EXPECT_EQ(all.count(), 1);
  events = all.step(threadAt(0, 0.5), kHole);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].cause, Cause::EndPassed);
  EXPECT_EQ(events[0].change, -1);
  EXPECT_EQ(events[0].thread, (std::array{0u, 0u}));
  EXPECT_EQ(all.count(), 0);
}

/// A knot: the thread's end goes through a loop that the same thread forms.
TEST(ThreadTopology, AThreadPassesThroughALoopOfItself) {
  OctreeBasedCD collisions;
  Positions positions{{-3, 0, 0}};
  for (int i = 0; i < 8; ++i) {
    const double angle = i * std::numbers::pi / 4.5;
    positions.emplace_back(std::cos(angle), std::sin(angle), 0.05 * i);
  }
  for (int i = 0; i < 4; ++i) positions.emplace_back(0.1, 0.05, -5.0 + i);
  const auto size = static_cast<std::uint32_t>(positions.size());
  const GeometryId id = collisions.addLineMesh(positions, segmentsOf(size, false), 0.01);
  ThreadTopology topology(collisions);
  const std::size_t knot = topology.add({id, placesOf(9, 4)}, {id, placesOf(1, 8)});
  EXPECT_EQ(topology.count(knot), 0);
  for (int i = 0; i < 3; ++i) {
    collisions.advance();
    for (std::uint32_t v = 9; v < size; ++v) positions[v].z() += 1;
    collisions.setPositions(id, positions);
    topology.update();
    EXPECT_EQ(topology.count(knot), i == 2 ? 1 : 0) << i;
  }
}

TEST(ThreadTopology, AnUpdateReplacesThatOfTheSameStep) {
  Watched all(threadAt(0, -4), kHole, false);
  all.collisions.setPositions(all.threadId, threadAt(0, -2));
  all.topology.update();
  EXPECT_EQ(all.count(), 1);
  const std::vector<ThreadEvent> first(all.topology.events().begin(), all.topology.events().end());
  all.topology.update();
  EXPECT_EQ(std::vector<ThreadEvent>(all.topology.events().begin(), all.topology.events().end()),
            first);
  all.collisions.setPositions(all.threadId, threadAt(0, -3.5));
  all.topology.update();
  EXPECT_EQ(all.count(), 0);
  EXPECT_TRUE(all.topology.events().empty());
  all.collisions.setPositions(all.threadId, threadAt(0, -2));
  all.topology.update();
  EXPECT_EQ(all.count(), 1);
  EXPECT_EQ(all.topology.events().size(), 1u);
}

TEST(ThreadTopology, StepsThatNobodyLookedAtAreNamed) {
  Watched all(threadAt(0, -4), kHole, false);
  all.collisions.setPositions(all.threadId, threadAt(0, -2));
  all.collisions.advance();
  all.topology.update();
  ASSERT_EQ(all.topology.events().size(), 1u);
  EXPECT_EQ(all.topology.events()[0].cause, Cause::Set);
  EXPECT_EQ(all.topology.events()[0].change, 1);
  all.collisions.advance();
  all.collisions.setPositions(all.threadId, threadAt(3, -2), threadAt(3, -2));
  all.topology.update();
  ASSERT_EQ(all.topology.events().size(), 2u);
  EXPECT_EQ(all.topology.events()[1].cause, Cause::Set);
  EXPECT_EQ(all.count(), 0);
}

TEST(ThreadTopology, CutAndDisabledThreadsAndLoopsAreLost) {
  const auto sewn = [] {
    auto all = std::make_unique<Watched>(threadAt(0, -2), kHole, false);
    EXPECT_EQ(all->count(), 1);
    return all;
  };
  const auto expectLost = [](Watched& all, Cause cause) {
    all.topology.update();
    ASSERT_EQ(all.topology.events().size(), 1u);
    EXPECT_EQ(all.topology.events()[0].cause, cause);
    EXPECT_EQ(all.topology.events()[0].change, -1);
    EXPECT_TRUE(all.topology.isLost(all.index));
    EXPECT_EQ(all.count(), 0);
    all.topology.update();
    EXPECT_EQ(all.topology.events().size(), 1u);
    all.collisions.advance();
    all.topology.update();
    EXPECT_EQ(all.topology.events().size(), 1u);
  };
  auto all = sewn();
  all->collisions.setDisabledElements(all->threadId, std::vector<std::uint32_t>{1});
  expectLost(*all, Cause::Disabled);
  all = sewn();
  all->collisions.setDisabledElements(all->loopId, std::vector<std::uint32_t>{1, 2});
  expectLost(*all, Cause::Disabled);
  all = sewn();
  all->collisions.removeGeometry(all->loopId);
  expectLost(*all, Cause::Cut);
  // A disabled element that is enabled in the same step loses nothing.
  all = sewn();
  all->collisions.setDisabledElements(all->threadId, std::vector<std::uint32_t>{1});
  all->topology.update();
  all->collisions.setDisabledElements(all->threadId, {});
  all->topology.update();
  EXPECT_TRUE(all->topology.events().empty());
  EXPECT_EQ(all->count(), 1);

  OctreeBasedCD collisions;
  const GeometryId sheet =
      collisions.addTriangleMesh(kHole, std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}});
  const GeometryId thread = collisions.addLineMesh(threadAt(0, -2), segmentsOf(4, false), 0.0);
  ThreadTopology topology(collisions);
  const std::size_t rim = topology.add({thread, placesOf(0, 4)}, {sheet, placesOf(0, 4)});
  EXPECT_EQ(topology.count(rim), 1);
  collisions.replaceTriangles(sheet, std::vector<std::uint32_t>{1}, {}, {});
  topology.update();
  ASSERT_EQ(topology.events().size(), 1u);
  EXPECT_EQ(topology.events()[0].cause, Cause::Cut);
}

TEST(ThreadTopology, RefusesPathsThatAreNone) {
  OctreeBasedCD collisions;
  const GeometryId thread = collisions.addLineMesh(threadAt(0, -2), segmentsOf(4, false), 0.0),
                   hole = collisions.addLineMesh(kHole, segmentsOf(4, true), 0.0),
                   ball = collisions.addAnalyticalGeometry(Sphere{});
  ThreadTopology topology(collisions);
  const VertexPath goodThread{thread, {0, 1, 2, 3}}, goodLoop{hole, {0, 1, 2, 3}};
  using Code = ErrorCode;
  const auto refuse = [&](Code code, const std::string& words, const VertexPath& path,
                          const VertexPath& loop) {
    expectRefused(code, words, [&] { topology.add(path, loop); });
  };
  refuse(Code::UnknownGeometry, "", {GeometryId{9}, {0, 1}}, goodLoop);
  refuse(Code::UnsupportedMethod, "the loop needs vertices", goodThread, {ball, {0, 1, 2}});
  refuse(Code::IndexOutOfRange, "vertex 4", {thread, {3, 4}}, goodLoop);
  refuse(Code::IndexOutOfRange, "the loop names vertex 1 twice", goodThread, {hole, {0, 1, 2, 1}});
  refuse(Code::IndexOutOfRange, "the thread names vertex 1 twice", {thread, {1, 0, 1}}, goodLoop);
  refuse(Code::InvalidSettings, "no edge from vertex 1 to 3", {thread, {0, 1, 3}}, goodLoop);
  refuse(Code::InvalidSettings, "has 1 vertices; it needs 2", {thread, {1}}, goodLoop);
  refuse(Code::InvalidSettings, "has 2 vertices; it needs 3", goodThread, {hole, {1, 2}});
  refuse(Code::IndexOutOfRange, "vertex 2 is in the thread and in the loop", {thread, {0, 1, 2}},
         {thread, {2, 3, 1}});
  expectRefused(Code::IndexOutOfRange, "index 0", [&] { topology.count(0); });
  EXPECT_EQ(topology.add(goodThread, goodLoop), 0u);
  ThreadTopology other = std::move(topology);
  EXPECT_EQ(other.count(0), 1);
  expectRefused(Code::InvalidCall, "moved from", [&] { topology.update(); });
  std::optional<OctreeBasedCD> gone(std::in_place);
  ThreadTopology orphan(*gone);
  gone.reset();
  expectRefused(Code::InvalidCall, "destroyed", [&] { orphan.update(); });
}

}  // namespace
}  // namespace palpate
