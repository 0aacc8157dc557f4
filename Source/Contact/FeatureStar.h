#pragma once

#include "Contact/MeshFeature.h"
#include "Math/TriangleIntersection.h"
#include "Exact/Predicates.h"

#include <cstdint>

namespace palpate {

/// The triangles around an edge or a vertex of a surface. Near the feature they are half-planes
/// that end in the edge, or sectors that end in the vertex. Says where a straight line leads that
/// ends in the feature: strictly into the body, along the surface, or away from it. Exact: all
/// decisions are signs of volumes and areas of the given points.
///
/// Cost     linear in the number of triangles.
class FeatureStar {
 public:
  /// The arguments must outlive the object.
  FeatureStar(const TriangleMesh&, bool atStart, const MeshFeature&, SignCounts&);

  /// Whether the triangles separate an inside from an outside: each of their edges that holds the
  /// feature is in exactly two of them, in opposite directions.
  bool isClosed() const;
  /// Whether the line to p begins along one of the triangles.
  bool holds(const Eigen::Vector3d& p) const;
  /// Whether the line to p begins strictly inside. The triangles must be closed.
  bool hasInside(const Eigen::Vector3d& p) const;

 private:
  /// A triangle's corners in its own order, beginning with the vertex or with the edge.
  Corners from(std::uint32_t triangle) const;
  bool isInWedge(const Eigen::Vector3d& p) const;
  bool isInCone(const Eigen::Vector3d& p) const;

  Eigen::Vector3d at(std::uint32_t vertex) const {
    return (m_atStart ? m_mesh.before : m_mesh.now)[vertex];
  }

  const TriangleMesh& m_mesh;
  const MeshTopology& m_topology;
  const bool m_atStart;
  const MeshFeature m_feature;
  SignCounts& m_counts;
};

}  // namespace palpate
