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
  std::vector<ElementPair> expected;
  for (const std::string& path : simdPaths()) {
    useSimdPath(path);
    EXPECT_EQ(simdPath(), path);
    OctreeBasedCD detection;
    const GeometryId idA = detection.addTriangleMesh(a.positions, a.triangles),
                     idB = detection.addTriangleMesh(b.positions, b.triangles);
    detection.addCollisionPair(idA, idB, {.thickness = 0.01});
    const auto pairs = detection.candidatePairs(idA, idB);
    if (expected.empty()) expected = pairs;
    EXPECT_GT(pairs.size(), 100u);
    EXPECT_EQ(pairs, expected);
  }
  useSimdPath("");
}

}  // namespace
}  // namespace palpate
