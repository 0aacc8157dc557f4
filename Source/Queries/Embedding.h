#pragma once

#include <palpate/Meshes.h>

#include "Queries/VertexSearch.h"

#include <optional>
#include <vector>

namespace palpate {

/// Updates the octree over a solid's tetrahedra to the positions now. The octree over its surface
/// must be up to date.
void updateTetrahedra(const Body& solid, const OctreeSettings&, const Threads&);

/// Finds the tetrahedron of a solid that contains a point. The octree over the tetrahedra must be
/// up to date.
class SolidQuery {
 public:
  SolidQuery(const Body& solid, Engine engine, PointQueryStack& stack)
      : m_solid(solid),
        m_bruteForce(engine == Engine::BruteForce),
        m_stack(stack),
        m_frame(solid) {}

  /// The tetrahedron with the lowest id that contains p.
  std::optional<TetrahedronPoint> lowest(const Eigen::Vector3d& p);

 private:
  const Body& m_solid;
  bool m_bruteForce;
  PointQueryStack& m_stack;
  PointFrame m_frame;
};

/// Finds the vertices of one geometry that are in tetrahedra of another, with their weights there.
/// `out`: ascending vertices.
void findEmbedded(const Body& vertices, const Body& solid, Engine, const Threads&,
                  VertexSearch<EmbeddedVertex>&, std::vector<EmbeddedVertex>& out);

}  // namespace palpate
