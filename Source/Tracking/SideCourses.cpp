#include "Tracking/SideCourses.h"

#include "Tracking/SideFeatures.h"
#include "Core/Assert.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace palpate {

namespace {

/// Whether other is edge or has a common vertex with it; sets isTurned then.
bool isNear(const Segment& edge, const Segment& other, bool& isTurned) {
  isTurned = false;
  if (edge == other) return true;
  for (int end = 0; end < 2; ++end)
    for (int k = 0; k < 2; ++k)
      if (edge[end] == other[k]) return isTurned = end == k, true;
  return false;
}

/// Whether both passages are of one vertex.
bool isOfVertex(const Crossing& l, const Crossing& r) {
  const bool ofB = r.kind == ContactKind::TriangleVertex;
  return l.kind == r.kind && l.ids[ofB] == r.ids[ofB];
}

bool shareCorner(const Triangle& s, const Triangle& t) {
  return std::any_of(s.begin(), s.end(), [&](std::uint32_t v) { return containsVertex(t, v); });
}

}  // namespace

void SideCourses::clear() noexcept {
  m_here.clear();
  m_returned.clear();
  m_courses.clear();
  m_visited.clear();
}

void SideCourses::start(const MeshPair& pair, std::span<const PassedSide> sides,
                        std::size_t passages) {
  clear();
  for (PassedSide side : sides)
    if (locate(pair, side))
      m_here.push_back(side);
    else if (!isEdges(side.passage) && isThere(pair, side))
      m_returned.push_back(side.passage);
  sortUnique(m_here);
  // A vertex that is in front of one wall of a body again has left the body by another one.
  for (const Crossing& passage : m_returned) {
    const auto other = std::find_if(m_here.begin(), m_here.end(), [&](const PassedSide& side) {
      return isOfVertex(side.passage, passage) && side.passage.forward != passage.forward;
    });
    if (other != m_here.end()) m_here.erase(other);
  }
  m_ofSecond = pair.self() ? ContactKind::VertexTriangle : ContactKind::TriangleVertex;
  m_heads.assign(std::bit_ceil(m_here.size() + passages + 1) + 1, kNoElement);
  for (const PassedSide& side : m_here) add(pair, side, 0.0);
}

/// The list with the courses of a vertex, or of all edges.
std::size_t SideCourses::listOf(const Crossing& features) const {
  PALPATE_ASSERT(!m_heads.empty() && features.kind <= ContactKind::EdgeEdge);
  if (isEdges(features)) return m_heads.size() - 1;
  const bool ofB = features.kind == ContactKind::TriangleVertex;
  return (std::size_t{2} * features.ids[ofB] + ofB) & (m_heads.size() - 2);
}

const PassedSide* SideCourses::sideAtStart(ContactKind kind, std::uint32_t vertex) const {
  const PassedSide* side = nullptr;
  anyCourse({kind, {vertex, vertex}}, [&](std::uint32_t i) {
    if (i < m_here.size()) side = &m_here[i];
    return side != nullptr;
  });
  return side;
}

/// Whether features are among those along which a side of the same vertex, or of edges, slides, or
/// next to them. isSame: receives whether the passage has the direction in which the side passed.
bool SideCourses::contains(const MeshPair& pair, const Course& course, const PassedSide& features,
                           bool* isSame) const {
  const Crossing& passage = features.passage;
  const std::size_t end = course.first + course.count;
  PALPATE_ASSERT(course.count > 0 && end <= m_visited.size());
  for (std::size_t i = course.first; i < end; ++i) {
    const auto& [visited, corners] = m_visited[i];
    bool isTurnedA = false, isTurnedB = false;
    if (isEdges(passage) ? !isNear(edgeA(visited), edgeA(passage), isTurnedA) ||
                               !isNear(edgeB(visited), edgeB(passage), isTurnedB)
                         : !shareCorner(corners, features.corners))
      continue;
    if (isSame)
      *isSame = isEdges(passage)
                    ? passage.forward == forwardOf(pair, true, visited, edgeA(passage),
                                                   edgeB(passage), isTurnedA != isTurnedB)
                    : visited.forward == passage.forward;
    return true;
  }
  return false;
}

void SideCourses::add(const MeshPair& pair, const PassedSide& side, double time) {
  Course course{side, time, true, m_visited.size(), 0, kNoElement};
  double farthest = isEdges(side.passage) ? 0.0 : farthestSlide(pair, side);
  do m_visited.push_back(course.side);
  while (isEdges(side.passage) ? slideEdges(pair, true, course.side)
                               : slideVertex(pair, course.side, farthest));
  course.count = m_visited.size() - course.first;
  course.next =
      std::exchange(m_heads[listOf(side.passage)], static_cast<std::uint32_t>(m_courses.size()));
  m_courses.push_back(course);
}

bool SideCourses::takeByEdges(const MeshPair& pair, const PassedSide& side) {
  bool isKnown = false, isSame = false;
  anyCourse(side.passage, [&](std::uint32_t i) {
    if (contains(pair, m_courses[i], side, &isSame)) {
      m_courses[i].hasPassed = isSame;
      isKnown = true;
    }
    return false;
  });
  return isKnown;
}

/// Changes one course of the vertex: the one that it goes back here, or goes on again. A vertex
/// that passes here in the direction in which it had passed has come back elsewhere.
bool SideCourses::takeByVertex(const MeshPair& pair, const PassedSide& side) {
  bool isKnown = false, isSame = false;
  const auto isHere = [&](std::uint32_t i) {
    return contains(pair, m_courses[i], side, &isSame) && (isKnown = true);
  };
  const auto isOpposite = [&](std::uint32_t i) {
    return m_courses[i].side.passage.forward != side.passage.forward;
  };
  const auto takeFirst = [&](bool hasPassed, auto&& isTaken) {
    return anyCourse(side.passage, [&](std::uint32_t i) {
      if (m_courses[i].hasPassed == hasPassed || !isTaken(i)) return false;
      m_courses[i].hasPassed = hasPassed;
      return true;
    });
  };
  if (takeFirst(false, [&](std::uint32_t i) { return isHere(i) && !isSame; }) ||
      takeFirst(true, [&](std::uint32_t i) { return isHere(i) && isSame; }))
    return true;
  if (!isKnown) return false;
  return takeFirst(false, isOpposite) || anyCourse(side.passage, [&](std::uint32_t i) {
           return m_courses[i].hasPassed && isHere(i);
         });
}

void SideCourses::take(const MeshPair& pair, const Crossing& passage) {
  PALPATE_ASSERT(passage.kind <= ContactKind::EdgeEdge);
  PassedSide side{passage, {}};
  side.passage.time = 0.0;
  if (!isEdges(passage)) {
    const VertexSide of(pair, passage.kind);
    side.corners = of.triangles.topology.elements[of.triangleOf(passage)];
  }
  if (isEdges(passage) ? takeByEdges(pair, side) : takeByVertex(pair, side)) return;
  if (isEdges(passage) && hasPassedEnd(passage)) return;
  add(pair, side, passage.time);
}

/// Whether an end of an edge passes through the surface of the other one. The edge then pierces the
/// surface, and its passages through edges only move the place.
bool SideCourses::hasPassedEnd(const Crossing& passage) const {
  const auto passes = [&](ContactKind kind, std::uint32_t vertex) {
    return anyCourse({kind, {vertex, vertex}}, [](std::uint32_t) { return true; });
  };
  const auto& [p, q, r, s] = passage.ids;
  return passes(ContactKind::VertexTriangle, p) || passes(ContactKind::VertexTriangle, q) ||
         passes(m_ofSecond, r) || passes(m_ofSecond, s);
}

bool SideCourses::isOfPassedBody(const MeshPair& pair, const Course& course) const {
  const Crossing& passage = course.side.passage;
  if (isEdges(passage) || pair.self()) return false;
  const ContactKind ofBody = passage.kind == ContactKind::VertexTriangle
                                 ? ContactKind::TriangleVertex
                                 : ContactKind::VertexTriangle;
  const auto havePassed = [&](const Course& through) {
    const Triangle& corners = m_visited[through.first].corners;
    return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t v) {
      return anyCourse({ofBody, {v, v}}, [](std::uint32_t) { return true; });
    });
  };
  return anyCourse(passage, [&](std::uint32_t i) {
    const Course& other = m_courses[i];
    return other.hasPassed && other.side.passage.forward != passage.forward &&
           (havePassed(course) || havePassed(other));
  });
}

bool SideCourses::replaces(const MeshPair& pair, const PassedSide& features, double time) const {
  return anyCourse(features.passage, [&](std::uint32_t i) {
    const Course& course = m_courses[i];
    const bool isLater = course.hasPassed && time > course.time &&
                         m_visited[course.first].passage.ids != features.passage.ids;
    return (i < m_here.size() || isLater) && contains(pair, course, features);
  });
}

void SideCourses::releaseMemory() {
  releaseSpare(m_here);
  m_returned = {};
  m_courses = {};
  m_visited = {};
  m_heads = {};
}

}  // namespace palpate
