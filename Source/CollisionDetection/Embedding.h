#pragma once

#include <palpate/TetrahedralMesh.h>

#include "CollisionDetection/VertexSearch.h"

#include <optional>
#include <span>

namespace palpate {

/// Brings the octree over a solid's tetrahedra to the positions now; that over its surface must be.
void updateTetrahedra(Geometry& solid, const OctreeSettings&, const Threads&);

/// One solid, asked about points; its tetrahedra's octree must be of the positions now.
class SolidQuery {
 public:
  SolidQuery(const Geometry& solid, Engine engine, PointQueryStack& stack)
      : m_solid(solid),
        m_bruteForce(engine == Engine::BruteForce),
        m_stack(stack),
        m_frame(solid) {}

  /// The lowest tetrahedron that p is in.
  std::optional<TetrahedronPoint> lowest(const Eigen::Vector3d& p);

 private:
  const Geometry& m_solid;
  bool m_bruteForce;
  PointQueryStack& m_stack;
  PointFrame m_frame;
};

/// Which vertices of one geometry are in tetrahedra of another, and where in them.
class Embedding {
 public:
  std::span<const EmbeddedVertex> find(const Geometry& vertices, const Geometry& solid, Engine,
                                       const Threads&);
  std::optional<TetrahedronPoint> find(const Eigen::Vector3d& point, const Geometry& solid, Engine);

 private:
  PointQueryStack m_stack;
  VertexSearch<EmbeddedVertex> m_search;
};

}  // namespace palpate
