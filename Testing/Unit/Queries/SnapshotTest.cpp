#include "Common/ExpectRefused.h"
#include "Queries/SnapshotPool.h"
#include "Unit/Queries/EveryQuery.h"

#include <palpate/DistanceField.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cfenv>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace palpate::testing {
namespace {

using QueryAnswersOfScene = std::vector<QueryAnswers>;

/// Readers ask each snapshot that they get, and let it go before they take the next. Their answers
/// are those of its frame. Nothing else orders the threads, so that ThreadSanitizer sees a race.
TEST(Snapshot, IsIsolatedFromTheSimulation) {
  constexpr int kSteps = 60, kReaders = 2;
  QueryScene scene;
  std::vector<QueryAnswersOfScene> expected(1);  // by number
  std::vector<std::vector<std::pair<std::uint64_t, QueryAnswersOfScene>>> answers(kReaders);
  std::atomic<int> progress = 0, ends = 0;
  std::vector<std::thread> readers;
  for (auto& own : answers)
    readers.emplace_back([&] {
      while (!ends.load(std::memory_order_relaxed)) {
        auto snapshot = scene.collisions.latestSnapshot();
        if (!snapshot || (!own.empty() && own.back().first == snapshot->number())) {
          snapshot.reset();
          std::this_thread::sleep_for(std::chrono::microseconds(200));
          continue;
        }
        own.emplace_back(snapshot->number(), ask(scene, snapshot->queries()));
        progress.fetch_add(1, std::memory_order_relaxed);
      }
    });
  for (int i = 0; i < kSteps || progress.load(std::memory_order_relaxed) < 2 * kReaders; ++i) {
    scene.step(i);
    expected.push_back(ask(scene, scene.collisions.queries()));
    scene.collisions.publish();
    scene.collisions.advance();
  }
  ends.store(1, std::memory_order_relaxed);
  for (std::thread& reader : readers) reader.join();
  for (const auto& own : answers)
    for (const auto& [number, found] : own)
      EXPECT_TRUE(isSame(found, expected.at(number))) << number;
}

/// Threads that need the same preparation of one copy, through two snapshots.
TEST(Snapshot, PreparesOnceForManyThreads) {
  QueryScene scene;
  scene.step(1);
  const QueryAnswersOfScene expected = ask(scene, scene.collisions.queries());
  scene.collisions.publish();
  const auto first = scene.collisions.latestSnapshot();
  scene.collisions.publish();
  const auto second = scene.collisions.latestSnapshot();
  std::vector<QueryAnswersOfScene> answers(4);
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < answers.size(); ++t)
    threads.emplace_back([&, t] { answers[t] = ask(scene, (t % 2 ? first : second)->queries()); });
  for (std::thread& thread : threads) thread.join();
  for (const QueryAnswersOfScene& each : answers) EXPECT_TRUE(isSame(each, expected));
}

/// Geometries with positions and octrees, without an OctreeBasedCD.
class TestSource : public SpatialQueries::Source {
 public:
  void add(const Mesh& mesh) {
    auto added = std::make_unique<Body>(GeometryId(m_nextId++));
    added->mesh.topology = MeshTopology(mesh.positions.size(), mesh.triangles);
    added->revisions.elements.topology = added->revisions.counter.next();
    m_geometries.push_back(std::move(added));
    move(m_geometries.size() - 1, mesh.positions);
  }
  void move(std::size_t i, const Positions& positions) {
    Body& geometry = *m_geometries[i];
    geometry.mesh.now.setBody(
        std::make_shared<const CountedVector<Vector3d>>(positions.begin(), positions.end()),
        m_revisions.next());
    geometry.mesh.before = geometry.mesh.now;
    geometry.tree.sampleFrame(geometry.mesh, geometry.revisions.elements.topology);
    geometry.tree.update(geometry.mesh, geometry.revisions.elements.topology, 1.0, m_settings,
                         m_thread);
  }
  void remove(std::size_t i) { m_geometries.erase(m_geometries.begin() + i); }

  mutable std::function<void()> onCount;  ///< called once, by geometryCount()

  std::uint64_t state() const override { return 1; }
  Body& at(GeometryId) const override { return *m_geometries.front(); }
  std::size_t geometryCount() const override {
    if (onCount) std::exchange(onCount, nullptr)();
    return m_geometries.size();
  }
  Body& geometry(std::size_t i) const override { return *m_geometries[i]; }
  std::uint64_t step() const override { return 1; }
  Engine engine() const override { return Engine::Octree; }
  const OctreeSettings& octreeSettings() const override { return m_settings; }
  const Threads& threads() const override { return m_thread; }

 private:
  std::vector<std::unique_ptr<Body>> m_geometries;
  Revision::Counter m_revisions;
  std::uint32_t m_nextId = 0;
  OctreeSettings m_settings;
  Threads m_thread{1};
};

/// A still geometry has one copy, whatever is held. Memory returns with the last reader.
TEST(Snapshot, SharesCopiesAndReusesMemory) {
  const Mesh ball = sphere(6, 8, {0, 0, 0}, 1);
  Positions moved = ball.positions;
  TestSource source;
  source.add(ball);
  source.add(ball);
  const auto pool = std::make_shared<SnapshotPool>();
  std::vector<std::shared_ptr<const Snapshot>> held;
  const auto take = [&](double at) {
    moved[0].z() = at;
    source.move(0, moved);
    return pool->take(source, at);
  };
  for (int i = 0; i < 5; ++i) held.push_back(take(2 + i));
  EXPECT_EQ(pool->copyCount(), 5u + 1u);
  EXPECT_EQ(pool->slotCount(), 5u);
  auto same = pool->take(source, 0);
  EXPECT_EQ(pool->copyCount(), 5u + 1u);
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(held[i]->queries().closestPoint(GeometryId{0}, {0, 0, 99})->distance, 97 - i);
  held.clear();
  for (int i = 0; i < 20; ++i) held = {take(i), take(i + 0.5)};
  EXPECT_EQ(pool->copyCount(), 5u + 1u);
  EXPECT_EQ(pool->slotCount(), 6u);
  source.remove(1);
  held = {take(1)};
  EXPECT_EQ(pool->copyCount(), 5u + 1u);  // `same` has the removed geometry
  EXPECT_TRUE(same->has(GeometryId{1}));
  same.reset();
  held = {take(2)};
  EXPECT_EQ(pool->copyCount(), 5u);
}

/// The last reader of a snapshot lets go while the next snapshot is made.
TEST(Snapshot, TakesNoSlotThatBecomesFreeMeanwhile) {
  const Mesh ball = sphere(6, 8, {0, 0, 0}, 1);
  TestSource source;
  source.add(ball);
  const auto pool = std::make_shared<SnapshotPool>();
  auto old = pool->take(source, 0);
  Positions moved = ball.positions;
  moved[0].z() = 2;
  source.move(0, moved);
  source.onCount = [&] { old.reset(); };
  const auto next = pool->take(source, 1);
  ASSERT_EQ(old, nullptr);
  EXPECT_EQ(next->positions(GeometryId{0})[0].z(), 2);
  EXPECT_EQ(pool->slotCount(), 2u);
  EXPECT_EQ(pool->take(source, 2)->positions(GeometryId{0})[0].z(), 2);
  EXPECT_EQ(pool->slotCount(), 2u);
}

TEST(Snapshot, PositionsStayFiniteAndInAnyRoundingMode) {
  OctreeBasedCD collisions;
  const std::vector<Vector3d> before{{-1e300, 0, 0}}, now{{1e300, 0.7, 0}};
  const GeometryId points = collisions.addPointSet(before);
  collisions.advance();
  collisions.setPositions(points, now);
  collisions.publish();
  const auto snapshot = collisions.latestSnapshot();
  EXPECT_EQ(snapshot->position(points, 0, 0.0), before[0]);
  EXPECT_EQ(snapshot->position(points, 0, 0.5), Vector3d(0, 0.35, 0));
  const Vector3d nearest = snapshot->position(points, 0, 0.3);
  std::fesetround(FE_UPWARD);
  const Vector3d upward = snapshot->position(points, 0, 0.3);
  std::fesetround(FE_TONEAREST);
  EXPECT_EQ(upward, nearest);
  expectRefused(ErrorCode::InvalidSettings, "time is inf",
                [&] { (void)snapshot->position(points, 0, kInfinity); });
}

TEST(Snapshot, HasTheMotionOfItsStep) {
  QueryScene scene;
  EXPECT_EQ(scene.collisions.latestSnapshot(), nullptr);
  scene.step(1);
  const Positions before(scene.collisions.positions(scene.ball).begin(),
                         scene.collisions.positions(scene.ball).end());
  scene.collisions.publish();
  const auto first = scene.collisions.latestSnapshot();
  scene.collisions.advance();
  scene.step(2);
  const Positions now(scene.collisions.positions(scene.ball).begin(),
                      scene.collisions.positions(scene.ball).end());
  scene.collisions.publish(0.25);
  const auto snapshot = scene.collisions.latestSnapshot();
  EXPECT_EQ(scene.collisions.latestSnapshot(), snapshot);
  EXPECT_TRUE(first->number() == 1 && first->time() == 0.0);
  EXPECT_TRUE(snapshot->number() == 2 && snapshot->time() == 0.25);
  scene.collisions.advance();
  scene.step(3);
  const auto equal = [](std::span<const Vector3d> a, const Positions& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  };
  for (const GeometryId still : {scene.open, scene.body})  // in the body's frame
    EXPECT_EQ(first->positions(still).data(), snapshot->positions(still).data());
  EXPECT_TRUE(equal(snapshot->positions(scene.ball), now));
  EXPECT_TRUE(equal(snapshot->positionsBefore(scene.ball), before));
  EXPECT_EQ(snapshot->position(scene.ball, 5), now[5]);
  EXPECT_EQ(snapshot->position(scene.ball, 5, 0.0), before[5]);
  EXPECT_EQ(snapshot->position(scene.ball, 5, 1.5), before[5] + 1.5 * (now[5] - before[5]));
  EXPECT_TRUE(snapshot->positions(scene.shape).empty());
  const RigidMotion shape = snapshot->motion(scene.shape);
  EXPECT_EQ(shape.now.translation, Vector3d(0.2, 0.3, 0.02));
  EXPECT_EQ(shape.before.translation, Vector3d(0.2, 0.3, 0.01));
  const RigidMotion pose = snapshot->motion(scene.body);
  EXPECT_LT((pose.now(scene.rest[3]) - snapshot->position(scene.body, 3)).norm(), 1e-15);
  expectRefused(ErrorCode::IndexOutOfRange, "vertex 9999",
                [&] { (void)snapshot->position(scene.ball, 9999); });
}

/// As OctreeBasedCD, it has positions, motion and tags of a geometry that no query supports.
TEST(Snapshot, HasDistanceFields) {
  const Mesh box = cube(0, 1);
  OctreeBasedCD collisions;
  const GeometryId field =
      collisions.addDistanceField(std::make_shared<const DistanceField>(DistanceField::build(
          {box.positions, box.triangles}, {.errorBound = 0.05, .band = 0.2, .threads = 1})));
  collisions.setTransform(field, {.translation = {1, 0, 0}});
  collisions.setTags(field, std::vector<std::uint32_t>{7});
  collisions.publish();
  const auto snapshot = collisions.latestSnapshot();
  EXPECT_TRUE(snapshot->has(field));
  EXPECT_TRUE(snapshot->positions(field).empty());
  EXPECT_TRUE(snapshot->positionsBefore(field).empty());
  EXPECT_EQ(snapshot->motion(field).now.translation, Vector3d(1, 0, 0));
  EXPECT_EQ(snapshot->tags(field)[0], 7u);
  expectRefused(ErrorCode::UnsupportedMethod, "is a distance field", [&] {
    snapshot->queries().closestPoint(field, {0, 0, 0});
  });
}

TEST(Snapshot, MayOutliveItsOwner) {
  std::optional<QueryScene> scene(std::in_place);
  scene->step(1);
  scene->collisions.publish();
  auto snapshot = scene->collisions.latestSnapshot();
  QueryScene other;
  const QueryAnswersOfScene expected = ask(other, snapshot->queries());
  OctreeBasedCD moved = std::move(scene->collisions);
  EXPECT_EQ(moved.latestSnapshot(), snapshot);
  moved.publish();
  EXPECT_EQ(moved.latestSnapshot()->number(), 2u);
  expectRefused(ErrorCode::InvalidCall, "moved from",
                [&] { (void)scene->collisions.latestSnapshot(); });
  expectRefused(ErrorCode::InvalidCall, "moved from", [&] { scene->collisions.publish(); });
  { const OctreeBasedCD last = std::move(moved); }
  scene.reset();
  EXPECT_TRUE(isSame(ask(other, snapshot->queries()), expected));
  const SpatialQueries copy = snapshot->queries();
  snapshot.reset();
  expectRefused(ErrorCode::InvalidCall, "Snapshot was destroyed", [&] {
    (void)copy.firstHit({{0, 0, 0}, {1, 0, 0}});
  });
}

TEST(Snapshot, KeepsRemovedGeometriesAndOldTopology) {
  QueryScene scene;
  scene.collisions.publish();
  const auto old = scene.collisions.latestSnapshot();
  const QueryAnswersOfScene expected = ask(scene, old->queries());
  scene.collisions.removeGeometry(scene.open);
  const Mesh coarse = sphere(5, 6, {0.5, 0.5, 0.5}, 0.4);
  scene.collisions.setTriangles(scene.ball, coarse.positions, coarse.triangles);
  const Mesh late = sheet(3, 0.1, 0);
  const GeometryId added = scene.collisions.addTriangleMesh(late.positions, late.triangles);
  for (int i = 0; i < 3; ++i) {
    scene.collisions.publish();
    const auto now = scene.collisions.latestSnapshot();
    EXPECT_FALSE(now->has(scene.open));
    EXPECT_TRUE(now->has(added));
    expectRefused(ErrorCode::UnknownGeometry, "geometry 3 is not in this snapshot", [&] {
      (void)now->queries().closestPoint(scene.open, {0, 0, 0});
    });
    EXPECT_EQ(now->positions(scene.ball).size(), coarse.positions.size());
    EXPECT_EQ(now->queries().closestPoint(scene.ball, {2, 0, 0})->element,
              scene.collisions.queries().closestPoint(scene.ball, {2, 0, 0})->element);
  }
  EXPECT_FALSE(old->has(added));
  EXPECT_TRUE(isSame(ask(scene, old->queries()), expected));
  expectRefused(ErrorCode::UnknownGeometry, "not in this snapshot",
                [&] { (void)old->positions(added); });
}

/// The mutex is not held while a snapshot is released or published: a predicate may ask for it.
TEST(Snapshot, IsAvailableWithinCallbacks) {
  QueryScene scene;
  scene.collisions.publish();
  int calls = 0;
  scene.collisions.addCollisionPair(scene.points, scene.ball, {Method::Proximity, 0.1});
  scene.collisions.setContactPredicate(scene.points, scene.ball, [&](const ContactFeatures&) {
    calls += scene.collisions.latestSnapshot()->number() == 1;
    return true;
  });
  scene.collisions.detectCollision();
  EXPECT_GT(calls, 0);
}

}  // namespace
}  // namespace palpate::testing
