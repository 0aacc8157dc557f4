#include "Contact/DistinctVertices.h"

#include "Contact/Filters.h"
#include "Math/ClosestPoint.h"
#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

using Eigen::Vector3d;

bool DistinctVertices::reports(std::uint32_t vertex, std::uint32_t triangle,
                               const MeshFeature& feature) const {
  if (feature.kind == MeshFeature::Kind::Face) return true;
  const bool isVertex = feature.kind == MeshFeature::Kind::Vertex;
  if (isVertex && m_self && feature.id < vertex) return false;
  if (isVertex && !m_self && m_swapped && m_pair.b.topology.hasFaces()) return false;
  const auto incidentTriangles = holdersOf(m_topology, feature);
  const Vector3d p = m_vertices[vertex];
  return std::none_of(incidentTriangles.begin(), incidentTriangles.end(), [&](std::uint32_t other) {
    if (other == triangle || (m_self && containsVertex(m_topology.elements[other], vertex)) ||
        rejectsVertex(m_pair, vertex, other, m_swapped))
      return false;
    const bool isNearer = isVertex ? isNearerThanVertex(p, feature.id, other)
                                   : isNearerThanEdge(p, feature.id, other);
    return (isNearer || (other < triangle && closestFeatureOf(p, other) == feature)) &&
           isNearEnough(vertex, other);
  });
}

/// Whether a vertex and a triangle are within the thickness. The triangle is at least as near as
/// one that is within the thickness, so only differing radii can make this false.
bool DistinctVertices::isNearEnough(std::uint32_t vertex, std::uint32_t triangle) const {
  if (m_mesh.radii.empty()) return true;
  const Triangle& corners = m_topology.elements[triangle];
  const VertexTriangleDistance measured =
      finiteVertexTriangleDistance(m_vertices[vertex], m_positions[corners[0]],
                                   m_positions[corners[1]], m_positions[corners[2]]);
  return measured.distance - m_pair.radii(vertex, corners, measured.weights, m_swapped) <=
         m_thickness;
}

MeshFeature DistinctVertices::closestFeatureOf(const Vector3d& p, std::uint32_t triangle) const {
  const auto& [a, b, c] = m_topology.elements[triangle];
  return featureOf(m_topology, triangle,
                   closestTriangleFeature(p, m_positions[a], m_positions[b], m_positions[c]));
}

/// Whether a triangle at a vertex comes nearer to p than the vertex.
bool DistinctVertices::isNearerThanVertex(const Vector3d& p, std::uint32_t vertex,
                                          std::uint32_t triangle) const {
  const Triangle& corners = m_topology.elements[triangle];
  return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t other) {
    return other != vertex && comesNearer(p, m_positions[vertex], m_positions[other]);
  });
}

/// Whether a triangle at an edge comes nearer to p than the edge. The edge's point nearest to p
/// is inside the edge.
bool DistinctVertices::isNearerThanEdge(const Vector3d& p, std::uint32_t edge,
                                        std::uint32_t triangle) const {
  const auto& sides = m_topology.triangleEdges[triangle];
  const auto side = std::find(sides.begin(), sides.end(), edge) - sides.begin();
  PALPATE_ASSERT(side < 3);
  const Triangle& corners = m_topology.elements[triangle];
  return liesInwards(p, m_positions[corners[side]], m_positions[corners[(side + 1) % 3]],
                     m_positions[corners[(side + 2) % 3]]);
}

}  // namespace palpate
