#include <palpate/OctreeBasedCD.h>

#include "Common/TestGeometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <vector>

namespace palpate::testing {
namespace {

using EdgePair = std::array<std::uint32_t, 4>;

/// Two spheres with edges near each other, and the smooth normals of these. reversed: the vertices
/// are numbered from the last one; the answer has their own numbers.
std::map<EdgePair, Vector3d> smoothEdgeNormals(bool reversed) {
  Mesh first = sphere(7, 8, {0, 0, 0}, 1.0), second = sphere(6, 9, {1.2, 1.1, 1.0}, 0.95);
  const auto last = [](const Mesh& mesh) {
    return static_cast<std::uint32_t>(mesh.positions.size()) - 1;
  };
  OctreeBasedCD collisions;
  for (Mesh* mesh : {&first, &second}) {
    if (reversed) {
      std::reverse(mesh->positions.begin(), mesh->positions.end());
      for (Triangle& triangle : mesh->triangles)
        for (std::uint32_t& vertex : triangle) vertex = last(*mesh) - vertex;
    }
    collisions.addTriangleMesh(mesh->positions, mesh->triangles);
  }
  const GeometryId a{0}, b{1};
  collisions.addCollisionPair(a, b,
                              {.method = Method::Proximity,
                               .thickness = 0.3,
                               .contacts = Contacts::All,
                               .smoothNormals = true});
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(a, b);
  std::map<EdgePair, Vector3d> normals;
  for (std::size_t i = 0; i < data.edgeEdge().size(); ++i) {
    auto [p, q] = data.edgeEdge()[i].edgeA;
    auto [r, s] = data.edgeEdge()[i].edgeB;
    if (reversed) {
      p = last(first) - p, q = last(first) - q;
      r = last(second) - r, s = last(second) - s;
    }
    normals[{std::min(p, q), std::max(p, q), std::min(r, s), std::max(r, s)}] =
        data.smoothEdgeEdge()[i];
  }
  return normals;
}

TEST(SmoothEdgeNormals, DoNotDependOnTheNumbersOfVertices) {
  const auto normals = smoothEdgeNormals(false), others = smoothEdgeNormals(true);
  ASSERT_EQ(normals.size(), others.size());
  EXPECT_GE(normals.size(), 10u);
  for (const auto& [edges, normal] : normals) {
    ASSERT_TRUE(others.contains(edges));
    EXPECT_LT((normal - others.at(edges)).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace palpate::testing
