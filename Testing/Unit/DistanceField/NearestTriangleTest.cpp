#include "DistanceField/NearestTriangle.h"

#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Core/SimdPath.h"
#include "Common/FieldMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace palpate::testing {

/// Triangles of any shape: with narrow angles, tiny, and without area.
TriangleBatch randomTriangles(Random& random) {
  TriangleBatch batch;
  for (std::size_t i = 0; i < TriangleBatch::kSize; ++i) {
    const double length = std::pow(10.0, uniform(random, -8, 0)),
                 width = std::pow(10.0, uniform(random, -12, 0));
    const Eigen::Vector3d a = randomPoint(random, -1, 1),
                          b = a + length * randomPoint(random, -1, 1),
                          along = uniform(random, -1, 2) * (b - a);
    batch.set(i, a, b, a + along + width * length * randomPoint(random, -1, 1));
  }
  return batch;
}

TEST(DistanceBounds, EncloseTheDistanceOnEveryPath) {
  Random random(1);
  for (const std::string& path : simdPaths()) {
    useSimdPath(path);
    for (int i = 0; i < casesOf(5000); ++i) {
      const TriangleBatch batch = randomTriangles(random);
      Eigen::Vector3d p = randomPoint(random, -2, 2);
      if (i % 3 == 0) p = 0.5 * (batch.corner(0, 0) + batch.corner(0, 1));
      if (i % 7 == 0) p = batch.corner(1, 2);
      const DistanceBounds bounds(p, batch, TriangleBatch::kSize);
      const VertexTriangleDistances exact(p, batch, TriangleBatch::kSize);
      for (std::size_t k = 0; k < TriangleBatch::kSize; ++k) {
        const double distance = exact[k].distance;
        ASSERT_LE(bounds.lower[k], distance) << path;
        ASSERT_LE(distance, bounds.distance[k] + bounds.error[k]) << path;
      }
    }
  }
  useSimdPath("");
}

TEST(NearestTriangle, IsWithinItsTolerance) {
  Random random(2);
  for (const auto& [name, mesh] : fieldMeshes(random)) {
    SCOPED_TRACE(name);
    OctreeBasedCD collisions;
    const GeometryId id = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
    Body geometry(id);
    geometry.mesh.now = Positions(mesh.positions);
    geometry.mesh.before = geometry.mesh.now;
    geometry.mesh.topology.vertexCount = mesh.positions.size();
    geometry.mesh.topology.triangles.assign(mesh.triangles.begin(), mesh.triangles.end());
    geometry.revisions.elements.topology = geometry.revisions.counter.next();
    const Threads threads(1);
    const double spread =
        geometry.tree.sampleFrame(geometry.mesh, geometry.revisions.elements.topology);
    geometry.tree.update(geometry.mesh, geometry.revisions.elements.topology, frameScale(spread),
                         {}, threads);
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& p : mesh.positions) box.extend(p);
    const double size = box.diagonal().norm();
    const NearestTriangle nearest(geometry, 1e-9 * size);
    for (int i = 0; i < casesOf(1000); ++i) {
      Eigen::Vector3d p = box.center() + randomPoint(random, -1, 1) * size;
      if (i % 4 == 0) p = mesh.positions[random() % mesh.positions.size()];
      std::array<std::uint32_t, 8> likely;
      for (std::uint32_t& place : likely)
        place = static_cast<std::uint32_t>(random() % mesh.triangles.size());
      const NearestTriangle::Near near = nearest.at(p, std::span(likely).first(random() % 9));
      const double exact = collisions.queries().closestPoint(id, p)->distance;
      ASSERT_NEAR(near.distance, exact, 1e-9 * size);
      ASSERT_LT(near.place, mesh.triangles.size());
    }
  }
}

}  // namespace palpate::testing
