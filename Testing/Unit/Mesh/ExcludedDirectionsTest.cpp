#include "Mesh/ExcludedDirections.h"

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace palpate::test {
namespace {

using Eigen::Vector3d;

/// Walls as low as 1e-14 of their length, each of two triangles with a common diagonal: whether a
/// direction leads from the diagonal into a triangle is at the limit of rounding.
TEST(ExcludedDirections, DoNotDependOnTheOrderOfAnEdgesVertices) {
  testing::Random random(5);
  std::size_t dependent = 0;
  for (int run = 0; run < 2000; ++run) {
    const double height = std::pow(10.0, testing::uniform(random, -15, 0)), turn = random() % 7;
    const Vector3d along(0.3 * std::cos(turn), 0.3 * std::sin(turn), 0), up(0, 0, height),
        at = testing::randomPoint(random, -1, 1);
    const std::vector<Vector3d> positions{at, at + along, at + along + up, at + up};
    const TriangleMesh wall{MeshTopology(4, std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}), positions,
                            positions};
    const double tilt = std::pow(10.0, testing::uniform(random, -16, -8));
    const Vector3d direction =
        (along.cross(Vector3d::UnitZ()).normalized() + tilt * testing::randomPoint(random, -1, 1))
            .normalized();
    EXPECT_EQ(excludesDirection(wall, {0, 2}, direction, 1.0),
              excludesDirection(wall, {2, 0}, direction, 1.0))
        << "run " << run;
    for (const std::uint32_t corner : {1u, 3u})
      dependent += leadsInto(direction, positions[0], positions[2], positions[corner]) !=
                   leadsInto(direction, positions[2], positions[0], positions[corner]);
  }
  EXPECT_GE(dependent, 50u) << "the walls are not at the limit of rounding";
}

}  // namespace
}  // namespace palpate::test
