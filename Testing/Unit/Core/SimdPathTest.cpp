#include "Core/SimdPath.h"

#include <palpate/Executor.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

namespace palpate {
namespace {

TEST(SimdPath, EveryPathGivesTheSameCandidates) {
  testing::Random random(1);
  const testing::Mesh a = testing::soup(random, 3000, 0.02), b = testing::sheet(40, 0.5, 0.3);
  std::vector<ElementPair> first, self;
  for (const std::string& path : simdPaths()) {
    useSimdPath(path);
    EXPECT_EQ(simdPath(), path);
    OctreeBasedCD detection;
    const GeometryId idA = detection.addTriangleMesh(a.positions, a.triangles),
                     idB = detection.addTriangleMesh(b.positions, b.triangles);
    PairSettings settings;
    settings.thickness = 0.01;
    detection.addCollisionPair(idA, idB, settings);
    detection.addCollisionPair(idA, idA, settings);
    const auto pairs = detection.candidatePairs(idA, idB), own = detection.candidatePairs(idA, idA);
    EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
    if (first.empty()) {
      first = pairs;
      self = own;
      EXPECT_GT(first.size(), 100u);
    }
    EXPECT_EQ(pairs, first);
    EXPECT_EQ(own, self);
  }
  useSimdPath("");
}

}  // namespace
}  // namespace palpate
