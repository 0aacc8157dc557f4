#include "DistanceField/CoincidentTriangles.h"

#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace palpate::testing {

std::vector<Triangle> keptOf(const Mesh& mesh) {
  const Threads threads(1);
  Body body(GeometryId{0});
  makeBody(mesh.positions, mesh.triangles, threads, body);
  return withoutCopies(body);
}

/// A sphere, and copies of one of its triangles with vertices of their own.
Mesh withCopies(std::uint32_t count) {
  Mesh mesh = sphere(20, 30, {0, 0, 0}, 1.0);
  const Triangle copied = mesh.triangles[mesh.triangles.size() / 2];
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const std::uint32_t vertex : copied) mesh.positions.push_back(mesh.positions[vertex]);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

TEST(CoincidentTriangles, OnlyTheFirstOfCopiesStays) {
  const Mesh single = withCopies(0);
  EXPECT_TRUE(keptOf(single).empty());
  for (const std::uint32_t copies : {100u, 10000u})
    EXPECT_EQ(keptOf(withCopies(copies)), single.triangles);
}

TEST(CoincidentTriangles, FewCopiesStay) { EXPECT_TRUE(keptOf(withCopies(8)).empty()); }

TEST(CoincidentTriangles, EachOrderOfTheCornersStays) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  std::vector<Triangle> orders;
  Triangle corners{0, 1, 2};
  do orders.push_back(corners);
  while (std::next_permutation(corners.begin(), corners.end()));
  for (int i = 0; i < 1000; ++i)
    mesh.triangles.insert(mesh.triangles.end(), orders.begin(), orders.end());
  EXPECT_EQ(keptOf(mesh), orders);
}

TEST(CoincidentTriangles, TheFieldIsWithinItsBound) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles.assign(10000, {0, 1, 2});
  const DistanceField field =
      DistanceField::build({mesh.positions, mesh.triangles}, {.errorBound = 0.01, .band = 0.1});
  OctreeBasedCD collisions;
  const GeometryId id =
      collisions.addTriangleMesh(mesh.positions, std::vector<Triangle>{{0, 1, 2}});
  const SpatialQueries queries = collisions.queries();
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = randomPoint(random, -0.1, 1.0);
    const double exact = queries.closestPoint(id, p)->distance, value = std::abs(field.value(p));
    if (exact <= 0.1) {
      ASSERT_NEAR(value, exact, 0.01);
    } else {
      ASSERT_GE(value, 0.1 - 0.01);
    }
  }
}

}  // namespace palpate::testing
