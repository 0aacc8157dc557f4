#include "Queries/PointDistances.h"

#include <palpate/OctreeBasedCD.h>

#include "Common/FieldMeshes.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <gtest/gtest.h>

#include <array>
#include <span>

namespace palpate::testing {

TEST(PointDistances, ARoughlyNearestTriangleIsWithinItsTolerance) {
  Random random(2);
  for (const auto& [name, mesh] : fieldMeshes(random)) {
    SCOPED_TRACE(name);
    OctreeBasedCD collisions;
    const GeometryId id = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
    Body geometry(id);
    geometry.mesh.now = Positions(mesh.positions);
    geometry.mesh.before = geometry.mesh.now;
    geometry.mesh.topology.vertexCount = mesh.positions.size();
    geometry.mesh.topology.elements.assign(mesh.triangles.begin(), mesh.triangles.end());
    geometry.revisions.elements.topology = geometry.revisions.counter.next();
    const Threads threads(1);
    const double spread =
        geometry.tree.sampleFrame(geometry.mesh, geometry.revisions.elements.topology);
    geometry.tree.update(geometry.mesh, geometry.revisions.elements.topology, frameScale(spread),
                         {}, threads);
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& p : mesh.positions) box.extend(p);
    const double size = box.diagonal().norm();
    for (int i = 0; i < casesOf(1000); ++i) {
      Eigen::Vector3d p = box.center() + randomPoint(random, -1, 1) * size;
      if (i % 4 == 0) p = mesh.positions[random() % mesh.positions.size()];
      std::array<std::uint32_t, 8> likely;
      for (std::uint32_t& place : likely)
        place = static_cast<std::uint32_t>(random() % mesh.triangles.size());
      const auto near = PointDistances(geometry, p, false)
                            .roughlyNearest(1e-9 * size, std::span(likely).first(random() % 9));
      const double exact = collisions.queries().closestPoint(id, p)->distance;
      ASSERT_NEAR(near.distance, exact, 1e-9 * size);
      ASSERT_LT(near.place, mesh.triangles.size());
    }
  }
}

}  // namespace palpate::testing
