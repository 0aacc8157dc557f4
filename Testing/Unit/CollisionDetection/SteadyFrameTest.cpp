#include <palpate/PenetrationTracker.h>
#include <palpate/StepGuard.h>

#include "Common/SupportedMethods.h"
#include "Scenes.h"

#include <gmp.h>

#include <atomic>

extern "C" void* __libc_malloc(std::size_t);
extern "C" void* __libc_realloc(void*, std::size_t);

namespace {
std::atomic<std::size_t> allocations{0};
}

/// Counts every allocation of the process, from any caller.
extern "C" void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
extern "C" void* realloc(void* memory, std::size_t size) {
  ++allocations;
  return __libc_realloc(memory, size);
}

namespace palpate {
namespace {

/// While it exists, integers of any size do not count: they are the exact fallback.
class IntegersApart {
 public:
  IntegersApart() {
    mp_get_memory_functions(&m_allocate, &m_reallocate, &m_free);
    mp_set_memory_functions(
        [](std::size_t size) { return __libc_malloc(size); },
        [](void* memory, std::size_t, std::size_t size) { return __libc_realloc(memory, size); },
        [](void* memory, std::size_t) { std::free(memory); });
  }
  ~IntegersApart() { mp_set_memory_functions(m_allocate, m_reallocate, m_free); }

 private:
  void* (*m_allocate)(std::size_t);
  void* (*m_reallocate)(void*, std::size_t, std::size_t);
  void (*m_free)(void*, std::size_t);
};

/// Runs frames, and as many again, which allocate nothing but exact integers.
template <class Frame>
void expectSteady(int frames, Frame&& frame) {
  const IntegersApart apart;
  for (int i = 0; i < frames; ++i) frame(i);
  const std::size_t before = allocations;
  for (int i = frames; i < 2 * frames; ++i) frame(i);
  EXPECT_EQ(allocations - before, 0u);
}

TEST(SteadyFrame, AllocatesNothingWithAuto) {
  std::set<MethodReason> reasons;
  const IntegersApart apart;
  for (const scenes::Scene& scene : scenes::hardScenes()) {
    if (scene.name == "far away") continue;  // slow pressing elsewhere
    for (const auto& [tolerance, thickness] :
         {std::pair{4.0, 0.0}, std::pair{0.5, 0.2}, std::pair{4.0, 0.2}}) {
      SCOPED_TRACE(scene.name + ", thickness " + std::to_string(thickness) + ", tolerance " +
                   std::to_string(tolerance));
      // It has edges many times those of its small triangles. Each frame takes half a second and is
      // exact.
      if (scene.name == "uneven triangles" && tolerance * thickness > 0.5) continue;
      OctreeBasedCD detection({.threads = 1});
      std::vector<GeometryId> ids;
      for (const auto& mesh : scene.meshes) ids.push_back(testing::addMesh(detection, mesh));
      for (const auto& [a, b] : scene.pairs)
        detection.addCollisionPair(ids[a], ids[b],
                                   {.thickness = thickness * scene.thickness,
                                    .automatic = {.motionTolerance = tolerance * scene.thickness}});
      std::vector<Eigen::Vector3d> positions;
      std::size_t made = 0;
      for (int frame = 0; frame < 3 * scene.frames; ++frame) {
        const std::size_t before = allocations;
        for (std::size_t m = 0; m < ids.size(); ++m) {
          scene.positions(frame, m, positions);
          detection.setPositions(ids[m], positions);
        }
        detection.detectCollision();
        detection.advance();
        const std::size_t ofFrame = allocations - before;
        // The start of a pass belongs to the pass before. Exact decisions are counted apart.
        if (frame < 2 * scene.frames || detection.statistics().exactDecisions > 0) continue;
        made += ofFrame;
        for (const CollisionPair& pair : detection.pairs())
          reasons.insert(detection.collisionData(pair.a, pair.b).validity().reason);
      }
      EXPECT_EQ(made, 0u);
    }
  }
  EXPECT_EQ(reasons, (std::set{MethodReason::Slow, MethodReason::Fast, MethodReason::Mixed,
                               MethodReason::Cheapest}));
}

/// Of pairs that filters separate, too.
TEST(SteadyFrame, AllocatesNothingForTrackedPairsThatFiltersSeparate) {
  OctreeBasedCD detection({.threads = 1});
  const std::vector<Eigen::Vector3d> points{{0, 0, 0}, {1, 0, 0}};
  const GeometryId a = detection.addPointSet(points), b = detection.addPointSet(points);
  detection.addCollisionPair(a, b, {.thickness = 0.1, .trackContacts = true});
  detection.setCollisionFilter(b, {.groups = 2, .mask = 2});
  std::vector<Eigen::Vector3d> now = points;
  expectSteady(6, [&](int frame) {
    now[0].x() = 0.01 * frame;
    detection.setPositions(a, now);
    detection.detectCollision();
    detection.advance();
  });
  const std::size_t before = allocations;
  EXPECT_EQ(std::vector<Eigen::Vector3d>(now), now);  // copies it, which is counted
  EXPECT_GT(allocations, before);
}

/// Every two bodies that a row of the table of support answers, in one object. Steps of two sizes
/// take turns.
TEST(SteadyFrame, AllocatesNothingForAnyRowOfTheTable) {
  for (std::size_t number = 0; number < std::size(kSupport); ++number)
    for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild}) {
      const SupportedPairs& row = kSupport[number];
      SCOPED_TRACE(std::string(toString(row.method)) + std::to_string(number));
      std::array<std::vector<testing::StepBody>, 2> steps;
      for (const std::size_t i : {0, 1}) {
        testing::Random random(91);
        const double motion = i == 0 ? 0.02 : 0.05;
        steps[i] = testing::bodiesOfEveryType(random, motion);
        for (auto& body : testing::bodiesWithField(Eigen::Vector3d::Constant(motion)))
          steps[i].push_back(std::move(body));
      }
      OctreeBasedCD detection(testing::settingsOf(Engine::Octree, 1, update));
      std::vector<GeometryId> ids;
      for (const testing::StepBody& body : steps[0]) ids.push_back(body.add(detection));
      std::size_t pairs = 0;
      for (std::size_t a = 0; a < ids.size(); ++a)
        for (std::size_t b = a; b < ids.size(); ++b)
          for (const auto& [s, t] : {std::pair(a, b), std::pair(b, a)}) {
            if (!testing::answers(row, steps[0][s], steps[0][t])) continue;
            // Only a placed body is rigid.
            if (row.kind == PairKind::Proxy && steps[0][t].name != "placed triangles") continue;
            PairSettings settings = testing::caseOf(row, pairs);
            settings.freeMotionReach = row.method == Method::Proximity ? 0.1 : 0.0;
            settings.trackContacts = !settings.continuous.earliestTimeOnly;
            detection.addCollisionPair(ids[s], ids[t], settings);
            ++pairs;
            break;
          }
      std::size_t contacts = 0;
      expectSteady(6, [&](int frame) {
        for (std::size_t i = 0; i < ids.size(); ++i) steps[frame % 2][i].move(detection, ids[i]);
        detection.detectCollision();
        detection.advance();
        contacts += detection.statistics().contacts;
      });
      EXPECT_GT(pairs, 0u);
      EXPECT_GT(contacts, pairs);
    }
}

/// Particles and a body that pass through a sheet and come back; advance() detects every third
/// step.
TEST(SteadyFrame, AllocatesNothingWithSidesAndSmoothNormals) {
  using namespace testing;
  OctreeBasedCD detection({.threads = 1});
  const Mesh floor = sheet(10, 0.0, 0.0), ball = sphere(6, 8, {0.31, 0.62, 0}, 0.15);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 30; ++i) points.push_back({0.2 + 0.02 * i, 0.71 - 0.013 * i, 0});
  const GeometryId tissue = addMesh(detection, floor), body = addMesh(detection, ball),
                   tips = detection.addPointSet(points);
  const PairSettings pair{.method = Method::Continuous,
                          .thickness = 0.05,
                          .trackContacts = true,
                          .smoothNormals = true,
                          .rememberSides = true};
  detection.addCollisionPair(tips, tissue, pair);
  detection.addCollisionPair(body, tissue, pair);
  std::vector<Eigen::Vector3d> now;
  const auto lift = [&](GeometryId id, const std::vector<Eigen::Vector3d>& rest, double z) {
    now = rest;
    for (Eigen::Vector3d& p : now) p += z * Eigen::Vector3d(0.113, 0.071, 1);
    detection.setPositions(id, now);
  };
  std::size_t sides = 0;
  expectSteady(18, [&](int frame) {
    const double z = frame % 6 < 3 ? 0.1 : -0.1;
    lift(tips, points, z);
    lift(body, ball.positions, z);
    detection.detectCollision();
    sides += detection.collisionData(tips, tissue).rememberedSides().size() +
             detection.collisionData(body, tissue).rememberedSides().size();
    if (frame % 3 == 0) lift(tips, points, z + 0.01);
    detection.advance();
  });
  EXPECT_GT(sides, 500u);
}

/// Snapshots that a reader holds for two steps, and queries of them.
TEST(SteadyFrame, AllocatesNothingWithSnapshots) {
  using namespace testing;
  const Mesh ball = sphere(12, 16, {0, 0, 0}, 1), toolMesh = sphere(5, 6, {0, 0, 0}, 0.2);
  OctreeBasedCD collisions(Settings{.threads = 1});
  const GeometryId organ = testing::addMesh(collisions, ball),
                   still = testing::addMesh(collisions, ball),
                   rigid = testing::addMesh(collisions, ball),
                   shape = collisions.addAnalyticalGeometry(
                       ConvexHull{{{-0.2, 0, -0.1}, {0.3, 0, -0.1}, {0, 0.3, 0}, {0, 0.1, 0.3}}});
  RigidMesh tool(toolMesh.positions, toolMesh.triangles);
  const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
  std::vector<Eigen::Vector3d> positions = ball.positions;
  std::vector<std::shared_ptr<const Snapshot>> held(3);
  std::vector<ShapeContact> shapeContacts;
  CollisionData meshContacts;
  std::size_t contacts = 0;
  expectSteady(30, [&](int frame) {
    for (std::size_t v = 0; v < positions.size(); ++v)
      positions[v] = (1 + 0.01 * (frame % 10)) * ball.positions[v];
    collisions.setPositions(organ, positions);
    collisions.setTransform(rigid, {unit, {0.01 * (frame % 10), 0, 3}});
    collisions.setTransform(shape, {unit, {0.01 * (frame % 10), 0, 2}});
    collisions.publish(frame);
    collisions.advance();
    held[frame % 3] = collisions.latestSnapshot();
    const SpatialQueries& queries = held[frame % 3]->queries();
    contacts += queries.contains(organ, {0, 0, 0});
    contacts += queries.contains(organ, {0, 0, 0}, {.rule = InsideRule::WindingNumber});
    contacts += queries.firstHit({{0, 0, -9}, {0.1, 0, 1}}).has_value();
    queries.contacts(organ, Sphere{{0, 0, 0}, 0.2}, {unit, {0, 0, 1}}, 0.1, shapeContacts);
    queries.contacts(organ, tool, {unit, {0, 0, 1}}, 0.1, meshContacts);
    contacts += shapeContacts.size() + meshContacts.validity().atEnd;
    EXPECT_TRUE(queries.closestPoint(still, {2, 0, 0}));
  });
  EXPECT_GT(contacts, 1000u);
}

/// Axes parallel to each other. Exact arithmetic keeps its integers, and counts its decisions.
TEST(SteadyFrame, CountsExactDecisionsBetweenShapes) {
  OctreeBasedCD detection(Settings{.threads = 1});
  std::vector<GeometryId> tools;
  for (const AnalyticalGeometry& tool : std::vector<AnalyticalGeometry>{
           Box{{0, 0, 0}, {0.3, 0.2, 0.1}}, Box{{0, 0, 0}, {0.25, 0.25, 0.25}},
           Cylinder{{0, 0, -0.3}, {0, 0, 0.3}, 0.2}, Capsule{{0, 0, -0.2}, {0, 0, 0.2}, 0.1}}) {
    tools.push_back(detection.addAnalyticalGeometry(tool));
    for (const GeometryId other : tools)
      if (other != tools.back())
        detection.addCollisionPair(other, tools.back(), {Method::Proximity, 10});
  }
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  std::size_t exact = 0;
  for (const bool parallel : {false, true})
    for (int frame = 0; frame < 20; ++frame) {
      for (std::size_t i = 0; i < tools.size(); ++i)
        detection.setTransform(tools[i], {parallel || i % 2 ? Eigen::Matrix3d::Identity() : turn,
                                          0.1 * static_cast<double>(i + 1) *
                                              Eigen::Vector3d(1, 0.5, 0.01 * (frame % 10))});
      const IntegersApart apart;
      const std::size_t before = allocations;
      detection.detectCollision();
      detection.advance();
      EXPECT_TRUE(frame < 10 || allocations == before) << allocations - before;
      exact += parallel ? detection.statistics().exactDecisions : 0;
    }
  EXPECT_GT(exact, 20u);
}

TEST(SteadyFrame, AllocatesNothingInQueriesOfTetrahedra) {
  testing::Random random(1);
  const testing::Solid solid = testing::cells(5, random);
  std::vector<Eigen::Vector3d> probes;
  for (int i = 0; i < 1000; ++i) probes.push_back(testing::randomPoint(random, -1, 6));
  for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild}) {
    Settings settings{.threads = 1};
    settings.octree.update = update;
    OctreeBasedCD detection(settings);
    const GeometryId body = detection.addTetrahedralMesh(solid.positions, solid.tetrahedra),
                     points = detection.addPointSet(probes);
    detection.addCollisionPair(points, body, {Method::Proximity, 0.1});
    std::size_t found = 0;
    std::set<DirectionChange> changes;
    std::vector<EmbeddedVertex> embedded;
    std::vector<InsideVertex> inside;
    PenetrationTracker tracker(points, body);
    std::vector<Eigen::Vector3d> now = solid.positions;
    expectSteady(20, [&](int frame) {
      for (std::size_t v = 0; v < now.size(); ++v)
        now[v].x() = solid.positions[v].x() + 0.5 * std::sin(solid.positions[v].y() + frame % 10);
      detection.setPositions(body, now);
      detection.detectCollision();
      detection.advance();
      const SpatialQueries queries = detection.queries();
      queries.findEmbeddedVertices(points, body, embedded);
      queries.findInsideVertices(points, body, inside, {.rule = InsideRule::WindingNumber});
      found += embedded.size() + inside.size();
      found += queries.findTetrahedron(body, probes[0]).has_value();
      for (const TrackedVertex& f : tracker.update(queries))
        if (frame < 20) changes.insert(f.change);
    });
    EXPECT_GT(found, 10000u);
    EXPECT_GE(changes.size(), 3u);
  }
}

TEST(SteadyFrame, AllocatesNothingInAGuard) {
  testing::Random random(9);
  const testing::Mesh body = testing::sphere(12, 16, {0.51, 0.47, 0.53}, 0.3),
                      floor = testing::sheet(12, 0.5, 0.3);
  OctreeBasedCD collisions({.threads = 1});
  const GeometryId a = testing::addMesh(collisions, body), b = testing::addMesh(collisions, floor);
  collisions.addCollisionPair(a, b);
  collisions.addCollisionPair(b, b);
  StepGuard guard(collisions);
  const std::vector<std::uint32_t> fixed{0, 5};
  guard.setFixedVertices(b, fixed);
  std::vector<Eigen::Vector3d> far = body.positions, now, still;
  for (Eigen::Vector3d& p : far) p += testing::randomPoint(random, -0.3, 0.3);
  std::size_t held = 0;
  expectSteady(10, [&](int) {
    now = far;
    still = floor.positions;
    collisions.setPositions(a, body.positions, now);
    collisions.setPositions(b, floor.positions, still);
    held = guard.hold();
  });
  EXPECT_GT(held, 10u);
  EXPECT_GT(guard.rounds(), 1u);
}

}  // namespace
}  // namespace palpate
