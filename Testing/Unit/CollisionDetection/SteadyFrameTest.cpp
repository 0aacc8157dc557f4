#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/StepGuard.h>

#include "Common/ShapeTruth.h"
#include "Common/Solids.h"
#include "Scenes.h"

#include <gmp.h>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <set>

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

struct LastPass {
  std::size_t allocations = 0;
  std::set<MethodReason> reasons;  ///< the frames that count
};

LastPass lastPass(const scenes::Scene& scene, const Settings& settings,
                  const PairSettings& pairSettings) {
  LastPass result;
  OctreeBasedCD detection(settings);
  std::vector<GeometryId> ids;
  for (const auto& mesh : scene.meshes)
    ids.push_back(detection.addTriangleMesh(mesh.positions, mesh.triangles));
  for (const auto& [a, b] : scene.pairs) detection.addCollisionPair(ids[a], ids[b], pairSettings);
  std::vector<Eigen::Vector3d> positions;
  for (int frame = 0; frame < 3 * scene.frames; ++frame) {
    const std::size_t before = allocations;
    for (std::size_t m = 0; m < ids.size(); ++m) {
      scene.positions(frame, m, positions);
      detection.setPositions(ids[m], positions);
    }
    detection.detectCollision();
    detection.advance();
    const std::size_t made = allocations - before;
    // The start of a pass belongs to the pass before. Exact decisions are counted apart.
    if (frame < 2 * scene.frames || detection.statistics().exactDecisions > 0) continue;
    result.allocations += made;
    for (const CollisionPair& pair : detection.pairs())
      result.reasons.insert(detection.collisionData(pair.a, pair.b).validity().reason);
  }
  return result;
}

TEST(SteadyFrame, AllocatesNothing) {
  Settings settings;
  settings.threads = 1;
  PairSettings proximity;
  proximity.thickness = scenes::organs().thickness;
  for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild}) {
    settings.octree.update = update;
    const LastPass pass = lastPass(scenes::organs(), settings, proximity);
    EXPECT_EQ(pass.allocations, 0u);
  }
}

TEST(SteadyFrame, AllocatesNothingWithAuto) {
  std::set<MethodReason> reasons;
  const IntegersApart apart;
  for (const scenes::Scene& scene : scenes::hardScenes()) {
    if (scene.name == "far away") continue;  // slow pressing elsewhere
    for (const auto& [tolerance, thickness] :
         {std::pair{4.0, 0.0}, std::pair{0.5, 0.2}, std::pair{4.0, 0.2}}) {
      // It has edges many times those of its small triangles. Each frame takes half a second and is
      // exact.
      if (scene.name == "uneven triangles" && tolerance * thickness > 0.5) continue;
      const LastPass pass =
          lastPass(scene, {.threads = 1},
                   {.thickness = thickness * scene.thickness,
                    .automatic = {.motionTolerance = tolerance * scene.thickness}});
      EXPECT_EQ(pass.allocations, 0u)
          << scene.name << ", thickness " << thickness << ", tolerance " << tolerance;
      reasons.insert(pass.reasons.begin(), pass.reasons.end());
    }
  }
  EXPECT_EQ(reasons, (std::set{MethodReason::Slow, MethodReason::Fast, MethodReason::Mixed,
                               MethodReason::Cheapest}));
}

TEST(SteadyFrame, AllocatesNothingWithLinesAndPoints) {
  constexpr std::uint32_t kSegments = 400;
  const scenes::SceneMesh sheet = scenes::sheet(40);
  std::vector<Segment> segments;
  for (std::uint32_t i = 0; i < kSegments; ++i) segments.push_back({i, i + 1});
  std::vector<Eigen::Vector3d> thread(kSegments + 1);
  const auto wind = [&](int frame) {
    for (std::uint32_t i = 0; i <= kSegments; ++i) {
      const double s = 0.0157 * i, phase = 0.1 * frame;
      thread[i] = {std::sin(3 * s + phase), std::sin(5 * s), 0.1 * std::sin(7 * s + phase)};
    }
  };
  wind(0);
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId tissue = detection.addTriangleMesh(sheet.positions, sheet.triangles),
                   suture = detection.addLineMesh(thread, segments, 0.01),
                   smoke = detection.addPointSet(thread, 0.02);
  const PairSettings near{.method = Method::Proximity, .thickness = 0.02, .freeMotionReach = 0.1};
  PairSettings self = near;
  self.restDistance = 0.1;
  detection.addCollisionPair(suture, suture, self);
  detection.addCollisionPair(suture, tissue, near);
  detection.addCollisionPair(smoke, tissue, near);
  std::size_t before = 0, contacts = 0;
  for (int frame = 0; frame < 20; ++frame) {
    if (frame == 10) before = allocations;
    wind(frame % 10);
    detection.setPositions(suture, thread);
    detection.setPositions(smoke, thread);
    detection.detectCollision();
    detection.advance();
    contacts += detection.statistics().contacts;
  }
  EXPECT_EQ(allocations - before, 0u);
  EXPECT_GT(contacts, 1000u);
}

TEST(SteadyFrame, AllocatesNothingWithShapes) {
  const scenes::SceneMesh sheet = scenes::sheet(40);
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId tissue = detection.addTriangleMesh(sheet.positions, sheet.triangles);
  std::vector<GeometryId> tools;
  for (const AnalyticalGeometry& tool : std::vector<AnalyticalGeometry>{
           Capsule{{-0.513, 0.0137, 0.3}, {0.487, 0.1093, 0.3317}, 0.4},
           Box{{0, 0, 0}, {0.2, 0.3, 0.1}}, Cylinder{{0, 0, -0.1}, {0, 0.3, 0}, 0.2}, Plane{},
           ConvexHull{{{-0.2, 0, -0.1}, {0.3, 0, -0.1}, {0, 0.3, 0}, {0, 0.1, 0.3}}}}) {
    tools.push_back(detection.addAnalyticalGeometry(tool));
    detection.addCollisionPair(tissue, tools.back(), {Method::Proximity, 0.01});
    for (std::size_t i = 0; i + 1 < tools.size(); ++i)
      detection.addCollisionPair(tools[i], tools.back(), {Method::Proximity, 0.5});
  }
  const Eigen::Matrix3d turns[] = {
      Eigen::Matrix3d::Identity(),
      Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix()};
  std::size_t before = 0, contacts = 0;
  for (int frame = 0; frame < 20; ++frame) {
    if (frame == 10) before = allocations;
    for (const GeometryId tool : tools)
      detection.setTransform(
          tool, {turns[static_cast<std::size_t>(tool) % 2], {0.02 * (frame % 10), 0, 0.05}});
    detection.detectCollision();
    detection.advance();
    contacts += detection.statistics().contacts;
  }
  EXPECT_EQ(allocations - before, 0u);
  EXPECT_GT(contacts, 1000u);
}

TEST(SteadyFrame, AllocatesNothingWithDistanceFields) {
  const testing::Mesh body = testing::sphere(20, 30, {0, 0, 0}, 0.5);
  scenes::SceneMesh sheet = scenes::sheet(40);
  const auto field = std::make_shared<const DistanceField>(DistanceField::build(
      {body.positions, body.triangles}, {.errorBound = 0.01, .band = 0.1, .threads = 1}));
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId tissue = detection.addTriangleMesh(sheet.positions, sheet.triangles),
                   bone = detection.addDistanceField(field);
  detection.addCollisionPair(tissue, bone, {Method::DistanceField, 0.02});
  std::size_t before = 0, contacts = 0;
  for (int frame = 0; frame < 20; ++frame) {
    if (frame == 10) before = allocations;
    for (Eigen::Vector3d& p : sheet.positions) p.z() += frame % 10 == 0 ? -0.09 : 0.01;
    detection.setPositions(tissue, sheet.positions);
    detection.setTransform(bone, {Eigen::Matrix3d::Identity(), {0.02 * (frame % 10), 0, 0.05}});
    detection.detectCollision();
    detection.advance();
    contacts += detection.statistics().contacts;
  }
  EXPECT_EQ(allocations - before, 0u);
  EXPECT_GT(contacts, 1000u);
}

/// Snapshots that a reader holds for two steps, and queries of them.
TEST(SteadyFrame, AllocatesNothingWithSnapshots) {
  using namespace testing;
  const IntegersApart integers;
  const Mesh ball = sphere(12, 16, {0, 0, 0}, 1), toolMesh = sphere(5, 6, {0, 0, 0}, 0.2);
  OctreeBasedCD collisions(Settings{.threads = 1});
  const GeometryId organ = collisions.addTriangleMesh(ball.positions, ball.triangles),
                   still = collisions.addTriangleMesh(ball.positions, ball.triangles),
                   rigid = collisions.addTriangleMesh(ball.positions, ball.triangles),
                   shape = collisions.addAnalyticalGeometry(
                       ConvexHull{{{-0.2, 0, -0.1}, {0.3, 0, -0.1}, {0, 0.3, 0}, {0, 0.1, 0.3}}});
  RigidMesh tool(toolMesh.positions, toolMesh.triangles);
  const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
  std::vector<Eigen::Vector3d> positions = ball.positions;
  std::vector<std::shared_ptr<const Snapshot>> held(3);
  std::vector<ShapeContact> shapeContacts;
  CollisionData meshContacts;
  std::size_t before = 0, contacts = 0;
  for (int frame = 0; frame < 60; ++frame) {
    if (frame == 30) before = allocations;
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
  }
  EXPECT_EQ(allocations - before, 0u);
  EXPECT_GT(contacts, 1000u);
}

/// Frames of every pair of shapes, and of cylinders with triangles and lines, by
/// Method::Continuous.
TEST(SteadyFrame, AllocatesNothingWithStepsOfShapes) {
  using namespace testing;
  const IntegersApart integers;
  Random random(2);
  const Mesh tissue = soup(random, 40, 0.3);
  OctreeBasedCD collisions(Settings{.threads = 1});
  const GeometryId mesh = collisions.addTriangleMesh(tissue.positions, tissue.triangles);
  std::vector<Segment> segments;
  for (std::uint32_t v = 1; v < 60; ++v) segments.push_back({v - 1, v});
  const GeometryId line = collisions.addLineMesh(tissue.positions, segments, 0.01);
  std::vector<GeometryId> tools;
  ConvexHull hull;
  for (int i = 0; i < 12; ++i) hull.points.push_back(randomPoint(random, -0.2, 0.2));
  for (const AnalyticalGeometry& shape : std::vector<AnalyticalGeometry>{
           Sphere{{0, 0, 0}, 0.2}, Capsule{{-0.2, 0, 0}, {0.2, 0, 0}, 0.1}, Plane{},
           Box{{0, 0, 0}, {0.1, 0.2, 0.3}}, Cylinder{{0, 0, -0.2}, {0, 0, 0.2}, 0.1}, hull}) {
    const GeometryId tool = collisions.addAnalyticalGeometry(shape);
    for (const GeometryId other : tools)
      collisions.addCollisionPair(other, tool, {Method::Continuous, 0.01});
    tools.push_back(tool);
    if (!std::holds_alternative<Cylinder>(shape)) continue;
    collisions.addCollisionPair(mesh, tool, {Method::Continuous, 0.01});
    collisions.addCollisionPair(line, tool, {Method::Continuous, 0.01});
  }
  std::size_t contacts = 0, before = 0;
  for (int pass = 0; pass < 3; ++pass) {
    Random same(3);
    if (pass == 2) before = allocations;
    for (int frame = 0; frame < 12; ++frame) {
      for (const GeometryId tool : tools) {
        const Eigen::Vector3d at = randomPoint(same, 0, 1);
        collisions.setTransform(tool, {randomTurn(same), at});
      }
      collisions.detectCollision();
      if (pass == 2) contacts += collisions.statistics().contacts;
    }
  }
  EXPECT_EQ(allocations - before, 0u);
  EXPECT_GT(contacts, 100u);
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

TEST(SteadyFrame, AllocatesNothingWithRigidBodies) {
  const scenes::SceneMesh sheet = scenes::sheet(40);
  for (const Method method : {Method::Proximity, Method::Auto}) {
    const IntegersApart apart;
    OctreeBasedCD detection(Settings{.threads = 1});
    const GeometryId tissue = detection.addTriangleMesh(sheet.positions, sheet.triangles),
                     plate = detection.addTriangleMesh(sheet.positions, sheet.triangles);
    detection.addCollisionPair(tissue, plate, {method, 0.02});
    std::size_t before = 0, contacts = 0;
    for (int frame = 0; frame < 30; ++frame) {
      if (frame == 20) before = allocations;
      const double angle = 0.01 * (frame % 10);
      Eigen::Matrix3d turned = Eigen::Matrix3d::Identity();
      turned(0, 0) = turned(1, 1) = std::cos(angle);
      turned(0, 1) = -(turned(1, 0) = std::sin(angle));
      detection.setTransform(plate, {turned, {0, 0, 0.015}});
      if (frame % 10 == 5) detection.setPositions(plate, sheet.positions);
      detection.detectCollision();
      detection.advance();
      contacts += detection.statistics().contacts;
    }
    EXPECT_EQ(allocations - before, 0u);
    EXPECT_GT(contacts, 1000u);
  }
}

TEST(SteadyFrame, AllocatesNothingWithTetrahedra) {
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
    std::size_t before = 0, found = 0;
    std::set<DirectionChange> changes;
    std::vector<EmbeddedVertex> embedded;
    std::vector<InsideVertex> inside;
    PenetrationTracker tracker(points, body);
    const IntegersApart apart;
    std::vector<Eigen::Vector3d> now = solid.positions;
    for (int frame = 0; frame < 40; ++frame) {
      if (frame == 20) before = allocations;
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
    }
    EXPECT_EQ(allocations - before, 0u);
    EXPECT_GT(found, 10000u);
    EXPECT_GE(changes.size(), 3u);
  }
}

TEST(SteadyFrame, AllocatesNothingInAGuard) {
  testing::Random random(9);
  const testing::Mesh body = testing::sphere(12, 16, {0.51, 0.47, 0.53}, 0.3),
                      floor = testing::sheet(12, 0.5, 0.3);
  OctreeBasedCD collisions({.threads = 1});
  const GeometryId a = collisions.addTriangleMesh(body.positions, body.triangles),
                   b = collisions.addTriangleMesh(floor.positions, floor.triangles);
  collisions.addCollisionPair(a, b);
  collisions.addCollisionPair(b, b);
  StepGuard guard(collisions);
  const std::vector<std::uint32_t> fixed{0, 5};
  guard.setFixedVertices(b, fixed);
  std::vector<Eigen::Vector3d> far = body.positions, now, still;
  for (Eigen::Vector3d& p : far) p += testing::randomPoint(random, -0.3, 0.3);
  std::size_t before = 0, held = 0;
  const IntegersApart apart;
  for (int step = 0; step < 20; ++step) {
    if (step == 10) before = allocations;
    now = far;
    still = floor.positions;
    collisions.setPositions(a, body.positions, now);
    collisions.setPositions(b, floor.positions, still);
    held = guard.hold();
  }
  EXPECT_EQ(allocations - before, 0u);
  EXPECT_GT(held, 10u);
  EXPECT_GT(guard.rounds(), 1u);
}

TEST(SteadyFrame, CountsAllocations) {
  const std::size_t before = allocations;
  std::vector<int> some(allocations % 7 + 1);
  EXPECT_GE(allocations - before, some.empty() ? 0u : 1u);
}

}  // namespace
}  // namespace palpate
