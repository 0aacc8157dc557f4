#include "Contact/FeatureStar.h"

#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Core/Assert.h"

#include <optional>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

bool isVertex(const MeshFeature& feature) { return feature.kind == MeshFeature::Kind::Vertex; }

/// Where pq crosses uv, which does not lie along it: 0 at u, 1 at v, 2 between; or not at all.
std::optional<int> placeOfCrossing(const Vector3d& u, const Vector3d& v, const Vector3d& p,
                                   const Vector3d& q, SignCounts& counts) {
  for (int axis = 0; axis < 3; ++axis) {
    const int ofU = orient2d(axis, p, q, u, counts), ofV = orient2d(axis, p, q, v, counts);
    if (ofU == 0 && ofV == 0) continue;  // the common plane is seen as a line, or u is v
    if (ofU == 0) return 0;
    if (ofV == 0) return 1;
    return ofU == ofV ? std::optional<int>() : 2;
  }
  return 0;
}

/// Whether ab and de, on one line, have opposite directions.
bool areOpposite(const Corners& abc, const Corners& def) {
  const Vector3d &a = abc[0], &b = abc[1], &d = def[0], &e = def[1];
  for (int axis = 0; axis < 3; ++axis)
    if (a[axis] != b[axis]) return (a[axis] < b[axis]) != (d[axis] < e[axis]);
  return false;
}

}  // namespace

FeatureStar::FeatureStar(const TriangleMesh& mesh, bool atStart, const MeshFeature& feature,
                         const Vector3d& p, const Vector3d& q, SignCounts& counts)
    : m_mesh(mesh),
      m_topology(mesh.topology),
      m_atStart(atStart),
      m_feature(feature),
      m_counts(counts) {
  PALPATE_ASSERT(feature.kind != MeshFeature::Kind::Face);
  const auto around = holdersOf(m_topology, feature);
  if (!std::all_of(around.begin(), around.end(), [&](std::uint32_t t) { return hasArea(t); }))
    join(p, q);
}

bool FeatureStar::hasArea(std::uint32_t triangle) const {
  const auto& [a, b, c] = m_topology.elements[triangle];
  return palpate::hasArea(at(a), at(b), at(c));
}

void FeatureStar::join(const Vector3d& p, const Vector3d& q) {
  JoinedFeatures joined(
      m_topology, m_feature, [&](std::uint32_t triangle) { return !hasArea(triangle); },
      [&](std::uint32_t u, std::uint32_t v) {
        return placeOfCrossing(at(u), at(v), p, q, m_counts);
      });
  if (const MeshFeature* const vertex = joined.vertex()) m_feature = *vertex;
  for (const auto& [triangle, touched] : joined.faces) addSectors(touched, triangle);
  m_joined = std::move(joined.features);
}

void FeatureStar::addSectors(const MeshFeature& feature, std::uint32_t triangle) {
  const Corners corners = from(feature, triangle);
  if (isVertex(feature) || !isVertex(m_feature)) {
    m_sectors.push_back(corners);
    return;
  }
  // A half-plane around a vertex is two sectors.
  const Vector3d apex = at(m_feature.id);
  m_sectors.push_back({apex, corners[1], corners[2]});
  m_sectors.push_back({apex, corners[2], corners[0]});
}

Corners FeatureStar::from(const MeshFeature& feature, std::uint32_t triangle) const {
  const Triangle& ids = m_topology.elements[triangle];
  int first = 0;
  for (int i = 0; i < 3; ++i)
    if (isVertex(feature) ? ids[i] == feature.id
                          : m_topology.triangleEdges[triangle][i] == feature.id)
      first = i;
  return {at(ids[first]), at(ids[(first + 1) % 3]), at(ids[(first + 2) % 3])};
}

bool FeatureStar::isClosed(const MeshFeature& feature) const {
  if (isVertex(feature)) return m_topology.hasClosedStar[feature.id];
  const auto around = holdersOf(m_topology, feature);
  if (around.size() != 2) return false;
  const Corners first = from(feature, around[0]), second = from(feature, around[1]);
  return first[0] == second[1] && first[1] == second[0];
}

bool FeatureStar::isClosed() const {
  if (m_joined.empty()) return isClosed(m_feature);
  return std::all_of(m_joined.begin(), m_joined.end(),
                     [&](const MeshFeature& feature) { return isClosed(feature); }) &&
         (isVertex(m_feature) ||
          (m_sectors.size() == 2 && areOpposite(m_sectors[0], m_sectors[1])));
}

bool FeatureStar::holds(const Vector3d& p) const {
  const auto isHeld = [&](const Corners& corners) {
    const auto& [a, b, c] = corners;
    if (orient3d(a, b, c, p, m_counts) != 0) return false;
    for (int axis = 0; axis < 3; ++axis) {
      const int turn = orient2d(axis, a, b, c, m_counts);
      if (turn == 0) continue;
      return turn * orient2d(axis, a, b, p, m_counts) >= 0 &&
             (!isVertex(m_feature) || turn * orient2d(axis, a, p, c, m_counts) >= 0);
    }
    return false;
  };
  for (std::size_t i = 0; i < size(); ++i)
    if (isHeld(sector(i))) return true;
  return false;
}

bool FeatureStar::hasInside(const Vector3d& p) const {
  PALPATE_ASSERT(isClosed());
  if (holds(p)) return false;
  return isVertex(m_feature) ? isInCone(p) : isInWedge(p);
}

bool FeatureStar::isInWedge(const Vector3d& p) const {
  const auto [a, b, c] = sector(0);
  const auto [d, e, f] = sector(1);
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
  std::size_t last = 0;
  for (; last < size(); ++last)
    if (const Corners corners = sector(last); side(corners[1], corners[2], p) != 0) break;
  if (last == size()) return false;  // all in planes through the line
  const Corners end = sector(last);
  const auto sideOfArc = [&](const Vector3d& q) {
    const int sign = side(p, end[1], q);
    return (sign != 0 ? sign : side(p, end[2], q)) >= 0 ? 1 : -1;
  };
  int depth = side(end[1], end[2], p) < 0 ? 1 : 0;
  for (std::size_t i = 0; i < size(); ++i) {
    const auto [vertex, a, b] = sector(i);
    if (i == last || sideOfArc(a) == sideOfArc(b)) continue;
    const int ofP = side(a, b, p);
    int ofEnd = side(a, b, end[1]);
    if (ofEnd == 0) ofEnd = side(a, b, end[2]);
    // With a on the negative side of the arc, p and the end lie so if the arc meets the sector.
    if (ofP == -sideOfArc(a) && ofEnd == sideOfArc(a)) depth -= ofP;
  }
  return depth > 0;
}

}  // namespace palpate
