#pragma once

#include "Contact/MeshFeature.h"
#include "Math/TriangleIntersection.h"
#include "Exact/Predicates.h"

#include <cstddef>

namespace palpate {

/// The triangles around an edge or a vertex of a surface. Near the feature they are half-planes
/// that end in the edge, or sectors that end in the vertex. Says where a straight line leads that
/// ends in the feature: strictly into the body, along the surface, or away from it. Exact: all
/// decisions are signs of volumes and areas of the given points. Features at the same place that
/// triangles without area join are one feature.
///
/// Cost     linear in the number of triangles.
class FeatureStar {
 public:
  /// p, q: a segment that crosses the surface in the feature, and lies along no edge there. The
  /// mesh and the counts must outlive the object.
  FeatureStar(const TriangleMesh&, bool atStart, const MeshFeature&, const Eigen::Vector3d& p,
              const Eigen::Vector3d& q, SignCounts&);

  /// Whether triangles without area join the feature to this one.
  bool joins(const MeshFeature& other) const {
    return std::find(m_joined.begin(), m_joined.end(), other) != m_joined.end();
  }

  /// Whether the triangles separate an inside from an outside: each of their edges that holds the
  /// feature is in exactly two of them, in opposite directions.
  bool isClosed() const;
  /// Whether the line to p begins along one of the triangles.
  bool holds(const Eigen::Vector3d& p) const;
  /// Whether the line to p begins strictly inside. The triangles must be closed.
  bool hasInside(const Eigen::Vector3d& p) const;

 private:
  /// A triangle's corners in its own order, beginning with the vertex or with the edge.
  Corners from(const MeshFeature&, std::uint32_t triangle) const;
  bool isClosed(const MeshFeature&) const;
  bool hasArea(std::uint32_t triangle) const;
  /// Finds what triangles without area join.
  void join(const Eigen::Vector3d& p, const Eigen::Vector3d& q);
  void addSectors(const MeshFeature&, std::uint32_t triangle);

  /// Half-planes or sectors, as from() has them.
  std::size_t size() const {
    return m_joined.empty() ? holdersOf(m_topology, m_feature).size() : m_sectors.size();
  }
  Corners sector(std::size_t i) const {
    return m_joined.empty() ? from(m_feature, holdersOf(m_topology, m_feature)[i]) : m_sectors[i];
  }
  bool isInWedge(const Eigen::Vector3d& p) const;
  bool isInCone(const Eigen::Vector3d& p) const;

  Eigen::Vector3d at(std::uint32_t vertex) const {
    return (m_atStart ? m_mesh.before : m_mesh.now)[vertex];
  }

  const TriangleMesh& m_mesh;
  const MeshTopology& m_topology;
  const bool m_atStart;
  MeshFeature m_feature;  ///< a vertex, if one is joined
  SignCounts& m_counts;
  std::vector<MeshFeature> m_joined;  ///< none without triangles without area
  std::vector<Corners> m_sectors;     ///< of m_joined
};

}  // namespace palpate
