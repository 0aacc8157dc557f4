#pragma once

#include "Contact/MeshFeature.h"
#include "Contact/MeshPair.h"

#include <Eigen/Core>

#include <cstdint>

namespace palpate {

/// Contacts::Distinct for vertices of one mesh near triangles of the other one, or of the same one,
/// at the step's end. swapped: the vertices are of MeshPair::b.
class DistinctVertices {
 public:
  DistinctVertices(const MeshPair& pair, bool swapped)
      : m_pair(pair),
        m_swapped(swapped),
        m_self(pair.self()),
        m_vertices(pair.meshOf(swapped).now),
        m_mesh(pair.meshOf(!swapped)),
        m_positions(m_mesh.now),
        m_topology(m_mesh.topology),
        m_thickness(pair.thicknessAtEnd()) {}

  /// Whether this triangle reports the contact of a vertex. Of the other triangles that hold the
  /// feature, none may be nearer, and none with a lower id may have its closest point on the
  /// feature. Two vertices are reported once: by those of the first mesh if the second has faces,
  /// and in one mesh by the lower one. In one mesh, triangles around the vertex neither report nor
  /// suppress its contacts. feature: of the triangle, with the closest point.
  bool reports(std::uint32_t vertex, std::uint32_t triangle, const MeshFeature& feature) const;

 private:
  bool isNearEnough(std::uint32_t vertex, std::uint32_t triangle) const;
  MeshFeature closestFeatureOf(const Eigen::Vector3d& p, std::uint32_t triangle) const;
  bool isNearerThanVertex(const Eigen::Vector3d& p, std::uint32_t vertex,
                          std::uint32_t triangle) const;
  bool isNearerThanEdge(const Eigen::Vector3d& p, std::uint32_t edge, std::uint32_t triangle) const;

  const MeshPair& m_pair;
  const bool m_swapped, m_self;
  const Positions& m_vertices;
  const TriangleMesh& m_mesh;  ///< with the triangles
  const Positions& m_positions;
  const MeshTopology& m_topology;
  const double m_thickness;
};

}  // namespace palpate
