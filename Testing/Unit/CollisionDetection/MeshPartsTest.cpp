#include <palpate/Meshes.h>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// Whether two triangles that cross are reported. `between` may connect them.
bool crossingIsReported(const Triangle& between) {
  const std::vector<Vector3d> positions{{0, 0, 0},     {1, 0, 0}, {0, 1, 0},  {0.2, 0.2, -1},
                                        {0.2, 0.2, 1}, {2, 2, 0}, {-1, -1, 0}};
  const std::vector<Triangle> triangles{{0, 1, 2}, {3, 4, 5}, {0, 2, 6}, between};
  const auto overlapping = findMeshDefects(TriangleMeshView{positions, triangles}).overlapping;
  return std::find(overlapping.begin(), overlapping.end(), ElementPair{0, 1}) != overlapping.end();
}

TEST(MeshParts, AreConnectedByTrianglesWithThreeVertices) {
  EXPECT_FALSE(crossingIsReported({1, 5, 4})) << "a part may cross itself";
  for (const Triangle& between : {Triangle{1, 5, 5}, Triangle{5, 1, 5}, Triangle{5, 5, 1}})
    EXPECT_TRUE(crossingIsReported(between)) << between[0] << between[1] << between[2];
}

}  // namespace
}  // namespace palpate::testing
