#include <palpate/OctreeBasedCD.h>

#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <vector>

// What happens to shapes when memory runs out.

namespace {

thread_local long allocationsLeft = -1;  ///< before one fails; negative: none does

}  // namespace

void* operator new(std::size_t size) {
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

}  // namespace
}  // namespace palpate::testing
