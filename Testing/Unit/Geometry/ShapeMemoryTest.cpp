#include <palpate/OctreeBasedCD.h>

#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/ShapeTruth.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <vector>

// What happens to shapes when memory runs out.

namespace {

thread_local long allocationsLeft = -1;  ///< before one fails; negative: none does
thread_local std::size_t allocations = 0;

}  // namespace

void* operator new(std::size_t size) {
  ++allocations;
  if (allocationsLeft == 0) throw std::bad_alloc();
  if (allocationsLeft > 0) --allocationsLeft;
  if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace palpate::testing {
namespace {

/// Whichever allocation fails while a shape is added, no geometry is left behind, and the next one
/// that is added has the answer that it has alone.
TEST(ShapeMemory, ShapesAreThereWholeOrNotAtAll) {
  Random random(1);
  ConvexHull hull, plate;
  for (int i = 0; i < 60; ++i) {
    hull.points.push_back(randomPoint(random, -1, 1));
    plate.points.push_back({uniform(random, -1, 1), uniform(random, -1, 1), 0});
  }
  for (const AnalyticalGeometry& shape :
       std::vector<AnalyticalGeometry>{hull, plate, Box{{0, 0, 0}, {1, 1, 1}}, Sphere{{0, 0, 0}, 1},
                                       Plane{}, Cylinder{{0, 0, 0}, {0, 0, 1}, 1}}) {
    const auto answerOf = [&](OctreeBasedCD& collisions) {
      const GeometryId tool = collisions.addAnalyticalGeometry(shape),
                       points = collisions.addPointSet(std::vector<Eigen::Vector3d>{{2, 0.5, 0.4}});
      collisions.addCollisionPair(tool, points, {Method::Proximity, 10});
      collisions.detectCollision();
      return collisions.collisionData(tool, points).hash();
    };
    OctreeBasedCD alone(settingsOf(Engine::Octree)), collisions(settingsOf(Engine::Octree));
    const auto expected = answerOf(alone);
    std::size_t failures = 0;
    for (long n = 0;; ++n) {
      bool failed = false;
      allocationsLeft = n;
      try {
        const GeometryId id = collisions.addAnalyticalGeometry(shape);
        allocationsLeft = -1;
        EXPECT_EQ(id, GeometryId{0});  // nothing that failed took an id
        collisions.removeGeometry(id);
      } catch (const std::bad_alloc&) {
        failed = true;
      }
      allocationsLeft = -1;
      if (!failed) break;
      ++failures;
      EXPECT_THROW(collisions.removeGeometry(GeometryId{0}), Error) << n;
      collisions.detectCollision();
    }
    EXPECT_GT(failures, 3u);
    EXPECT_EQ(answerOf(collisions), expected);
  }
}

/// Frames of every two shapes, and of cylinders with triangles and lines, by Method::Continuous.
TEST(ShapeMemory, SteadyStepsAllocateNothing) {
  Random random(2);
  const Mesh tissue = soup(random, 40, 0.3);
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
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
      for (const GeometryId tool : tools)
        collisions.setTransform(tool, randomTurn(same), randomPoint(same, 0, 1));
      collisions.detectCollision();
      if (pass == 2) contacts += collisions.statistics().contacts;
    }
  }
  EXPECT_EQ(allocations - before, 0u);
  EXPECT_GT(contacts, 100u);
}

}  // namespace
}  // namespace palpate::testing
