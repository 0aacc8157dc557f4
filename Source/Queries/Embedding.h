#pragma once

#include <palpate/TetrahedralMesh.h>

#include "Queries/VertexSearch.h"

#include <optional>
#include <vector>

namespace palpate {

/// Brings the octree over a solid's tetrahedra to the positions now; that over its surface must be.
void updateTetrahedra(SearchableGeometry& solid, const OctreeSettings&, const Threads&);

/// Searches for points in one solid; the octree of its tetrahedra must be of the positions now.
class SolidQuery {
 public:
  SolidQuery(const SearchableGeometry& solid, Engine engine, PointQueryStack& stack)
      : m_solid(solid),
        m_bruteForce(engine == Engine::BruteForce),
        m_stack(stack),
        m_frame(solid) {}

  /// The lowest tetrahedron that p is in.
  std::optional<TetrahedronPoint> lowest(const Eigen::Vector3d& p);

 private:
  const SearchableGeometry& m_solid;
  bool m_bruteForce;
  PointQueryStack& m_stack;
  PointFrame m_frame;
};

/// Which vertices of one geometry are in tetrahedra of another, and where in them. `out`: ascending
/// vertices.
void findEmbedded(const SearchableGeometry& vertices, const SearchableGeometry& solid, Engine,
                  const Threads&, VertexSearch<EmbeddedVertex>&, std::vector<EmbeddedVertex>& out);

}  // namespace palpate
