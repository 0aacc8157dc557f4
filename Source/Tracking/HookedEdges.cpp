#include "Tracking/HookedEdges.h"

#include "Tracking/SideFeatures.h"
#include "Exact/Predicates.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// From where an edge pierces a triangle, it leads on past one of the triangle's edges, which it
/// has passed. direction: 1 towards the edge's second end, or -1.
void addHooked(const MeshPair& pair, const VertexSide& of, const Segment& edge,
               const HookedEdges::Pierced& pierced, double direction, Buffer<PassedSide>& found) {
  const MeshTopology& topology = of.triangles.topology;
  const Triangle& t = topology.elements[pierced.triangle];
  const Positions& at = of.triangles.now;
  const Vector3d &p = of.vertices.now[edge[0]], &q = of.vertices.now[edge[1]];
  const Vector3d along = direction * (q - p), place = p + pierced.place * (q - p),
                 normal = (at[t[1]] - at[t[0]]).cross(at[t[2]] - at[t[0]]);
  SignCounts counts;
  double least = std::numeric_limits<double>::infinity();
  std::size_t nearest = 3;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d &first = at[t[k]], &second = at[t[(k + 1) % 3]];
    const Vector3d inward = normal.cross(second - first);
    const double distance = inward.dot(place - first), speed = -inward.dot(along);
    if (!(speed > 0.0) || !(distance < least * speed)) continue;
    if (orient3d(p, q, first, second, counts) == 0) continue;
    least = distance / speed;
    nearest = k;
  }
  if (nearest == 3) return;
  Segment ofA = edge, ofB = topology.edges[topology.triangleEdges[pierced.triangle][nearest]];
  if (of.swapped || (pair.self() && ofB < ofA)) std::swap(ofA, ofB);
  if (!mayTouch(pair, ofA, ofB)) return;
  const Positions &x = pair.a.now, &y = pair.b.now;
  const bool passed = orient3d(x[ofA[0]], x[ofA[1]], y[ofB[0]], y[ofB[1]], counts) > 0;
  found.push_back({{ContactKind::EdgeEdge, {ofA[0], ofA[1], ofB[0], ofB[1]}, 0.0, passed}, {}});
}

}  // namespace

void HookedEdges::add(const MeshPair& pair, const SideCourses& courses, std::uint32_t course) {
  const Crossing& passage = courses.all()[course].side.passage;
  if (isEdges(passage)) {
    if (pair.b.topology.hasFaces())
      m_candidates.push_back({ContactKind::VertexTriangle, edgeA(passage), course});
    if (pair.a.topology.hasFaces())
      m_candidates.push_back({courses.ofSecond(), edgeB(passage), course});
    return;
  }
  const VertexSide of(pair, passage.kind);
  const MeshTopology& topology = of.vertices.topology;
  const std::uint32_t vertex = of.vertexOf(passage);
  for (const std::uint32_t element : topology.vertexTriangles[vertex])
    for (const std::uint32_t id : topology.triangleEdges[element]) {
      // Each edge once: by the first of its elements.
      if (id == kNoEdge || topology.edgeTriangles[id][0] != element) continue;
      const Segment& edge = topology.edges[id];
      if (edge[0] == vertex || edge[1] == vertex)
        m_candidates.push_back({passage.kind, edge, course});
    }
}

void HookedEdges::find(const MeshPair& pair, const SideCourses& courses,
                       Buffer<PassedSide>& found) {
  std::sort(m_candidates.begin(), m_candidates.end());
  for (std::size_t i = 0; i < m_candidates.size(); ++i)
    if (i == 0 || m_candidates[i].kind != m_candidates[i - 1].kind ||
        m_candidates[i].edge != m_candidates[i - 1].edge)
      find(pair, courses, m_candidates[i], found);
}

/// Searches the surface around the places of the course, as far as the edge is long.
void HookedEdges::find(const MeshPair& pair, const SideCourses& courses, const Candidate& candidate,
                       Buffer<PassedSide>& found) {
  const auto& [kind, edge, index] = candidate;
  const SideCourses::Course& course = courses.all()[index];
  for (const std::uint32_t end : edge)
    if (courses.anyCourse({kind, {end, end}},
                          [&](std::uint32_t i) { return courses.all()[i].hasPassed; }))
      return;
  const VertexSide of(pair, kind);
  const MeshTopology& topology = of.triangles.topology;
  const Positions& at = of.triangles.now;
  const Vector3d &p = of.vertices.now[edge[0]], &q = of.vertices.now[edge[1]];
  const Vector3d along = q - p, lower = p.cwiseMin(q), upper = p.cwiseMax(q);
  const double reach = along.norm();
  const auto isInReach = [&](const Triangle& t) {
    const Vector3d &a = at[t[0]], &b = at[t[1]], &c = at[t[2]];
    return ((a.cwiseMin(b).cwiseMin(c) - upper).array() <= reach).all() &&
           ((lower - a.cwiseMax(b).cwiseMax(c)).array() <= reach).all();
  };
  m_searched.resize(std::max(m_searched.size(), topology.elements.size()), 0);
  ++m_search;
  m_region.clear();
  const auto visit = [&](std::uint32_t triangle) {
    if (std::exchange(m_searched[triangle], m_search) == m_search) return;
    if (isInReach(topology.elements[triangle])) m_region.push_back(triangle);
  };
  for (const PassedSide& side : courses.visited(course)) {
    const Crossing& passage = side.passage;
    if (!isEdges(passage)) {
      visit(of.triangleOf(passage));
      continue;
    }
    for (const std::uint32_t vertex :
         of.swapped || (pair.self() && edge == edgeB(passage)) ? edgeA(passage) : edgeB(passage))
      for (const std::uint32_t triangle : topology.vertexTriangles[vertex]) visit(triangle);
  }
  SignCounts counts;
  m_pierced.clear();
  for (std::size_t next = 0; next < m_region.size(); ++next) {
    const std::uint32_t triangle = m_region[next];
    const Triangle& t = topology.elements[triangle];
    for (const std::uint32_t corner : t)
      for (const std::uint32_t neighbour : topology.vertexTriangles[corner]) visit(neighbour);
    if (pair.self() && (containsVertex(t, edge[0]) || containsVertex(t, edge[1]))) continue;
    const Vector3d &a = at[t[0]], &b = at[t[1]], &c = at[t[2]];
    const int side = orient3d(a, b, c, q, counts);
    if (side == 0 || orient3d(a, b, c, p, counts) != -side) continue;
    if (side * orient3d(p, q, a, b, counts) < 0 || side * orient3d(p, q, b, c, counts) < 0 ||
        side * orient3d(p, q, c, a, counts) < 0)
      continue;
    const Vector3d normal = (b - a).cross(c - a);
    m_pierced.push_back({normal.dot(a - p) / normal.dot(along), triangle, side});
  }
  std::sort(m_pierced.begin(), m_pierced.end());
  if (m_pierced.empty() || m_pierced.front().side == m_pierced.back().side) return;
  // Between the first place and the last one, the edge is on the side to which it passed.
  for (const Pierced& pierced : m_pierced)
    addHooked(pair, of, edge, pierced, pierced.side == m_pierced.front().side ? 1.0 : -1.0, found);
}

}  // namespace palpate
