#include "Contact/FeatureStar.h"

#include "Mesh/Corners.h"
#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

using Eigen::Vector3d;

FeatureStar::FeatureStar(const TriangleMesh& mesh, bool atStart, const MeshFeature& feature,
                         SignCounts& counts)
    : m_mesh(mesh),
      m_topology(mesh.topology),
      m_atStart(atStart),
      m_feature(feature),
      m_counts(counts) {
  PALPATE_ASSERT(feature.kind != MeshFeature::Kind::Face);
}

Corners FeatureStar::from(std::uint32_t triangle) const {
  const Triangle& ids = m_topology.elements[triangle];
  int first = 0;
  for (int i = 0; i < 3; ++i)
    if (m_feature.kind == MeshFeature::Kind::Edge
            ? m_topology.triangleEdges[triangle][i] == m_feature.id
            : ids[i] == m_feature.id)
      first = i;
  return {at(ids[first]), at(ids[(first + 1) % 3]), at(ids[(first + 2) % 3])};
}

bool FeatureStar::isClosed() const {
  if (m_feature.kind == MeshFeature::Kind::Vertex) return m_topology.hasClosedStar[m_feature.id];
  const auto around = holdersOf(m_topology, m_feature);
  return around.size() == 2 && from(around[0])[0] == from(around[1])[1] &&
         from(around[0])[1] == from(around[1])[0];
}

bool FeatureStar::holds(const Vector3d& p) const {
  const bool isVertex = m_feature.kind == MeshFeature::Kind::Vertex;
  return std::any_of(holdersOf(m_topology, m_feature).begin(),
                     holdersOf(m_topology, m_feature).end(), [&](std::uint32_t triangle) {
                       const auto [a, b, c] = from(triangle);
                       if (orient3d(a, b, c, p, m_counts) != 0) return false;
                       for (int axis = 0; axis < 3; ++axis) {
                         const int turn = orient2d(axis, a, b, c, m_counts);
                         if (turn == 0) continue;
                         return turn * orient2d(axis, a, b, p, m_counts) >= 0 &&
                                (!isVertex || turn * orient2d(axis, a, p, c, m_counts) >= 0);
                       }
                       return false;
                     });
}

bool FeatureStar::hasInside(const Vector3d& p) const {
  PALPATE_ASSERT(isClosed());
  if (holds(p)) return false;
  return m_feature.kind == MeshFeature::Kind::Edge ? isInWedge(p) : isInCone(p);
}

bool FeatureStar::isInWedge(const Vector3d& p) const {
  const auto [a, b, c] = from(holdersOf(m_topology, m_feature)[0]);
  const auto [d, e, f] = from(holdersOf(m_topology, m_feature)[1]);
  const bool isBehindFirst = orient3d(a, b, c, p, m_counts) < 0;
  const bool isBehindSecond = orient3d(d, e, f, p, m_counts) < 0;
  const bool isConvex = orient3d(a, b, c, f, m_counts) < 0;
  return isConvex ? isBehindFirst && isBehindSecond : isBehindFirst || isBehindSecond;
}

/// The arc from p's direction to a triangle's interior, next to its first edge, is followed to its
/// end. There it comes from behind the triangle or from its front. On the way it crosses others.
/// The end is infinitesimally far from the edge, so that the arc meets no other edge in a point.
bool FeatureStar::isInCone(const Vector3d& p) const {
  const Vector3d apex = at(m_feature.id);
  const auto side = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    return orient3d(apex, a, b, c, m_counts);
  };
  const auto around = holdersOf(m_topology, m_feature);
  const auto last = std::find_if(around.begin(), around.end(), [&](std::uint32_t t) {
    const Corners corners = from(t);
    return side(corners[1], corners[2], p) != 0;
  });
  if (last == around.end()) return false;  // all in planes through the line
  const Corners end = from(*last);
  const auto sideOfArc = [&](const Vector3d& q) {
    const int sign = side(p, end[1], q);
    return (sign != 0 ? sign : side(p, end[2], q)) >= 0 ? 1 : -1;
  };
  int depth = side(end[1], end[2], p) < 0 ? 1 : 0;
  for (const std::uint32_t t : around) {
    const auto [vertex, a, b] = from(t);
    if (t == *last || sideOfArc(a) == sideOfArc(b)) continue;
    const int ofP = side(a, b, p);
    int ofEnd = side(a, b, end[1]);
    if (ofEnd == 0) ofEnd = side(a, b, end[2]);
    // With a on the negative side of the arc, p and the end lie so if the arc meets the sector.
    if (ofP == -sideOfArc(a) && ofEnd == sideOfArc(a)) depth -= ofP;
  }
  return depth > 0;
}

}  // namespace palpate
