#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/ThreadTruth.h"

#include <palpate/OctreeBasedCD.h>
#include <palpate/ThreadTopology.h>

#include <numeric>

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;
using Cause = ThreadEvent::Cause;

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

enum class WatchKind { Open, Closed, Parts };

/// A thread and a loop, or two parts of threads, lines of one detection.
struct Watched {
  OctreeBasedCD collisions;
  Positions thread, loop;
  GeometryId threadId, loopId;
  ThreadTopology topology{collisions};
  std::size_t index;
  WatchKind kind;
  std::vector<std::uint32_t> path, sides;

  Watched(Positions threadAt, Positions loopAt, WatchKind k)
      : thread(std::move(threadAt)), loop(std::move(loopAt)), kind(k) {
    const auto count = [](const Positions& p) { return static_cast<std::uint32_t>(p.size()); };
    path = placesOf(0, count(thread)), sides = placesOf(0, count(loop));
    threadId =
        collisions.addLineMesh(thread, segmentsOf(count(thread), k == WatchKind::Closed), 0.0);
    loopId = collisions.addLineMesh(loop, segmentsOf(count(loop), k != WatchKind::Parts), 0.0);
    if (k == WatchKind::Closed) path.push_back(0);
    index = k == WatchKind::Parts ? topology.addParts({threadId, path}, {loopId, sides})
                                  : topology.add({threadId, path}, {loopId, sides});
    collisions.advance();
  }
  std::vector<PassageRow> truth(const Positions& nextThread, const Positions& nextLoop) const {
    return passageTruth({path, thread, nextThread}, {sides, loop, nextLoop},
                        kind == WatchKind::Parts);
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
    Watched all{polygon(random, 7), polygon(random, 6), WatchKind::Closed};
    for (int i = 0; i < kSteps; ++i) {
      const int before = all.count();
      // They are drawn back, so that they do not drift apart.
      const auto next = [&](Positions p) {
        for (Vector3d& q : p) q *= 0.99;
        return shaken(random, p, 0.2);
      };
      const Positions thread = next(all.thread), loop = next(all.loop);
      const auto events = all.step(thread, loop);
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
  for (int repeat = 0; repeat < casesOf(150); ++repeat) {
    Watched all{polygon(random, 5), polygon(random, 5), static_cast<WatchKind>(repeat % 3)};
    for (int i = 0; i < 10; ++i) {
      const Positions thread = shaken(random, all.thread, 0.3),
                      loop = shaken(random, all.loop, 0.3);
      const std::vector<PassageRow> truth = all.truth(thread, loop);
      const auto events = all.step(thread, loop);
      ASSERT_EQ(passageRows(events, 0), truth) << repeat << ' ' << i;
      ASSERT_TRUE(std::is_sorted(events.begin(), events.end(),
                                 [](const auto& l, const auto& r) { return l.time < r.time; }));
      passages += truth.size();
      ends += static_cast<std::size_t>(std::count_if(
          truth.begin(), truth.end(), [](const PassageRow& r) { return std::get<0>(r); }));
    }
  }
  EXPECT_GE(passages, leastOf(300));
  EXPECT_GE(ends, leastOf(30));
}

/// Small integers: vertices lie in surfaces and on edges, and pass exactly through them. Equal
/// positions count the same, however they were reached; parts count what rational arithmetic finds.
TEST(ThreadTopology, IsConsistentWhereFeaturesOnlyTouch) {
  Random random(3);
  const auto snapped = [&](std::size_t size) {
    Positions positions = polygon(random, size);
    for (Vector3d& p : positions) p = (p * 2).array().round().matrix();
    return positions;
  };
  std::size_t changes = 0, passages = 0;
  for (int repeat = 0; repeat < casesOf(80); ++repeat) {
    const WatchKind kind = static_cast<WatchKind>(repeat % 3);
    Positions thread = snapped(6), loop = snapped(5);
    Watched all{thread, loop, kind};
    for (int i = 0; i < 20; ++i) {
      const int before = all.count();
      thread = snapped(6), loop = snapped(5);
      const auto truth =
          kind == WatchKind::Parts ? all.truth(thread, loop) : std::vector<PassageRow>();
      const auto events = all.step(thread, loop);
      ASSERT_EQ(before + sumOf(events), all.count());
      if (kind == WatchKind::Parts) {
        ASSERT_EQ(passageRows(events, 0), truth) << repeat << ' ' << i;
        passages += truth.size();
      } else {
        ASSERT_EQ(Watched(thread, loop, kind).count(), all.count());
        changes += all.count() != before;
      }
    }
  }
  EXPECT_GE(changes, leastOf(100));
  EXPECT_GE(passages, leastOf(300));
}

/// A thread along z through a square hole.
Positions threadAt(double x, double z) {
  Positions positions;
  for (int i = 0; i < 4; ++i) positions.emplace_back(x, 0.1, z + i);
  return positions;
}
const Positions kHole{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};

TEST(ThreadTopology, AStitchIsSewnSlipsOutAndTearsOut) {
  Watched all(threadAt(0, -4), kHole, WatchKind::Open);
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

TEST(ThreadTopology, TwoPartsCountOnlyWhatPassesThroughThem) {
  const auto along = [](double x, double y) {
    return Positions{{x, y, -1}, {x, y, 0.1}, {x, y, 1}};
  };
  const Positions across{{-1, 0, 0}, {0.1, 0, 0}, {1, 0, 0}};
  Watched all(along(0, 0.5), across, WatchKind::Parts);
  // Around the end of the other thread, nothing passes.
  for (const auto& [x, y] : {std::pair{2.0, 0.5}, {2.0, -0.5}, {0.0, -0.5}})
    EXPECT_TRUE(all.step(along(x, y), across).empty());
  auto events = all.step(along(0, 0.5), across);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(all.count(), 1);  // (p1 - p0) x (q1 - q0) points along y
  EXPECT_EQ(events[0].cause, Cause::Passed);
  EXPECT_EQ(events[0].change, 1);
  EXPECT_EQ(events[0].step, 4u);
  EXPECT_EQ(events[0].thread, (std::array{0u, 1u}));
  EXPECT_EQ(events[0].loop, (std::array{0u, 1u}));
  EXPECT_NEAR(events[0].time, 0.5, 1e-9);

  // A further update in the same step, with the same positions or with others.
  all.topology.clear();
  for (const double y : {-0.5, -0.5, 0.25}) {
    all.collisions.setPositions(all.threadId, along(0, y));
    all.topology.update();
    EXPECT_EQ(all.count(), y > 0);
    EXPECT_EQ(all.topology.events().size(), y > 0 ? 0u : 1u);
  }
  all.collisions.advance();

  // Positions that are set at both ends of a step, and a step without update(), are named.
  for (const bool isMissed : {false, true}) {
    all.topology.clear();
    all.collisions.setPositions(all.threadId, along(0, -0.5 - isMissed));
    if (isMissed)
      all.collisions.advance();
    else
      all.collisions.setPositions(all.threadId, along(0, -0.5), along(0, -0.5));
    all.topology.update();
    ASSERT_EQ(all.topology.events().size(), 1u) << isMissed;
    EXPECT_EQ(all.topology.events()[0].cause, Cause::Set);
    EXPECT_EQ(all.topology.events()[0].change, 0);
    EXPECT_EQ(all.count(), 1);
    all.collisions.advance();
  }
}

/// The thread's end goes through a loop that the same thread forms.
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

TEST(ThreadTopology, StepsThatNobodyLookedAtAreNamed) {
  Watched all(threadAt(0, -4), kHole, WatchKind::Open);
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

TEST(ThreadTopology, TheFirstStepStartsWhereItsPositionsWereSetLast) {
  for (const bool areParts : {false, true}) {
    OctreeBasedCD collisions;
    const Positions late = threadAt(0, -2);
    const GeometryId thread = collisions.addLineMesh(threadAt(0, -4), segmentsOf(4, false), 0.0),
                     loop = collisions.addLineMesh(kHole, segmentsOf(4, true), 0.0);
    ThreadTopology topology(collisions);
    const std::size_t index =
        areParts ? topology.addParts({thread, placesOf(0, 4)}, {loop, placesOf(0, 4)})
                 : topology.add({thread, placesOf(0, 4)}, {loop, placesOf(0, 4)});
    collisions.setPositions(thread, late);  // both ends of the step: the thread is new
    topology.update();
    EXPECT_TRUE(topology.events().empty()) << areParts;
    EXPECT_EQ(topology.count(index), areParts ? 0 : 1);
    collisions.advance();
    collisions.setPositions(thread, late, late);
    topology.update();
    EXPECT_TRUE(topology.events().empty()) << areParts;
  }
}

TEST(ThreadTopology, CutAndDisabledThreadsAndLoopsAreLost) {
  using Ids = std::vector<std::uint32_t>;
  struct Loss {
    const char* name;
    Cause cause;
    void (*lose)(Watched&);
  };
  const std::vector<Loss> losses{
      {"thread", Cause::Disabled,
       [](Watched& w) { w.collisions.setDisabledElements(w.threadId, Ids{1}); }},
      {"one edge of the loop", Cause::Disabled,
       [](Watched& w) { w.collisions.setDisabledElements(w.loopId, Ids{1}); }},
      {"two edges of the loop", Cause::Disabled,
       [](Watched& w) {
         w.collisions.setDisabledElements(w.loopId, Ids{1, 2});
       }},
      {"removed", Cause::Cut, [](Watched& w) { w.collisions.removeGeometry(w.loopId); }}};
  for (const auto& [name, cause, lose] : losses) {
    SCOPED_TRACE(name);
    Watched all(threadAt(0, -2), kHole, WatchKind::Open);
    EXPECT_EQ(all.count(), 1);
    lose(all);
    for (int update = 0; update < 3; ++update) {
      all.topology.update();
      ASSERT_EQ(all.topology.events().size(), 1u);
      if (update == 1) all.collisions.advance();
    }
    EXPECT_EQ(all.topology.events()[0].cause, cause);
    EXPECT_EQ(all.topology.events()[0].change, -1);
    EXPECT_TRUE(all.topology.isLost(all.index));
    EXPECT_EQ(all.count(), 0);
  }
  // A disabled element that is enabled in the same step loses nothing.
  Watched all(threadAt(0, -2), kHole, WatchKind::Open);
  for (const Ids& disabled : {Ids{1}, Ids{}}) {
    all.collisions.setDisabledElements(all.threadId, disabled);
    all.topology.update();
  }
  EXPECT_TRUE(all.topology.events().empty());
  EXPECT_EQ(all.count(), 1);
  // The rim of a mesh is lost with a triangle of it.
  const GeometryId sheet =
      all.collisions.addTriangleMesh(kHole, std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}});
  const std::size_t rim = all.topology.add({all.threadId, all.path}, {sheet, placesOf(0, 4)});
  EXPECT_EQ(all.topology.count(rim), 1);
  all.collisions.replaceTriangles(sheet, Ids{1}, {}, {});
  all.topology.update();
  ASSERT_EQ(all.topology.events().size(), 1u);
  EXPECT_EQ(all.topology.events()[0].cause, Cause::Cut);
}

TEST(ThreadTopology, FollowsPlacedLoops) {
  Watched all(threadAt(0, -2), kHole, WatchKind::Open);
  all.collisions.setTransform(all.loopId, {.translation = {0, 0, 5}});
  all.topology.update();
  EXPECT_EQ(all.count(), 0);
  ASSERT_EQ(all.topology.events().size(), 1u);
  EXPECT_EQ(all.topology.events()[0].cause, Cause::EndPassed);
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
  expectRefused(Code::IndexOutOfRange, "vertex 1 is in both threads", [&] {
    topology.addParts({thread, {0, 1}}, {thread, {1, 2}});
  });
  expectRefused(Code::InvalidSettings, "no edge from vertex 0 to 2", [&] {
    topology.addParts(goodThread, {hole, {0, 2}});
  });
  collisions.setDisabledElements(hole, std::vector<std::uint32_t>{1, 2});
  refuse(Code::InvalidSettings, "the loop names vertex 2, which no enabled element has", goodThread,
         goodLoop);
  collisions.setDisabledElements(hole, {});
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
