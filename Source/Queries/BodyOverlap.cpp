#include "Queries/BodyOverlap.h"

#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <array>
#include <functional>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Sides of a triangle, as bits.
constexpr unsigned kFront = 1, kBehind = 2, kKnown = 4;
/// Of a vertex, and of the vertex that stands for a part.
constexpr std::uint8_t kOnOther = 1, kDecided = 2;

unsigned opposite(unsigned sides) {
  return (sides & kFront ? kBehind : 0) | (sides & kBehind ? kFront : 0);
}
/// The side to which a sign of orient3d() belongs.
unsigned sideOfSign(int sign) { return sign > 0 ? kFront : sign < 0 ? kBehind : 0; }

/// The axis along which a triangle is seen largest.
int widestAxis(const Corners& p) {
  const Vector3d normal = windingNormal(p[0], p[1], p[2]);
  Eigen::Index axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  return static_cast<int>(axis);
}

/// Whether two triangles in one plane have an area in common: no line along an edge separates them.
bool shareArea(const Corners& a, const Corners& b, SignCounts& counts) {
  const int axis = widestAxis(a);
  const auto separates = [&](const Corners& p, const Corners& q) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d &from = p[i], &to = p[(i + 1) % 3];
      const int own = orient2d(axis, from, to, p[(i + 2) % 3], counts);
      if (std::none_of(q.begin(), q.end(), [&](const Vector3d& x) {
            return own * orient2d(axis, from, to, x, counts) > 0;
          }))
        return true;
    }
    return false;
  };
  return !separates(a, b) && !separates(b, a);
}

/// Whether two points in one plane with a line are on one side of it.
bool isSameSide(const Vector3d& start, const Vector3d& end, const Vector3d& p, const Vector3d& q,
                SignCounts& counts) {
  const int axis = widestAxis({start, end, p});
  return orient2d(axis, start, end, p, counts) * orient2d(axis, start, end, q, counts) > 0;
}

/// The middle of what two segments of one line have in common.
Vector3d middleOfCommon(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                        const Vector3d& q1) {
  Eigen::Index axis = 0;
  (p1 - p0).cwiseAbs().maxCoeff(&axis);
  std::array<Vector3d, 4> ends{p0, p1, q0, q1};
  std::sort(ends.begin(), ends.end(),
            [&](const Vector3d& l, const Vector3d& r) { return l[axis] < r[axis]; });
  return 0.5 * ends[1] + 0.5 * ends[2];
}

/// Where a triangle meets the plane of another one that it touches: in a segment with two ends,
/// each of them a corner or a point of an edge, or else in a corner.
struct PlaneSegment {
  PlaneSegment(const Corners& p, const Corners& plane, SignCounts& counts) {
    const OrientedPlane through(plane[0], plane[1], plane[2]);
    for (std::size_t i = 0; i < 3; ++i) {
      signs[i] = through.side(p[i], counts);
      any |= sideOfSign(signs[i]);
      zeros += signs[i] == 0;
    }
  }
  bool isCoplanar() const { return zeros == 3; }
  bool isEdge() const { return zeros == 2; }
  /// Whether it is more than a corner.
  bool isSegment() const { return isEdge() || any == (kFront | kBehind); }
  std::size_t edge() const {  ///< of isEdge()
    return signs[0] != 0 ? 1 : signs[1] != 0 ? 2 : 0;
  }
  std::size_t opposite() const { return (edge() + 2) % 3; }

  /// Whether the other triangle's segment holds both ends, or one that is inside that triangle. on:
  /// the corners on the other triangle, as bits; edges[i]: its edges that touch edge i.
  bool reaches(unsigned on, const std::array<unsigned, 3>& edges) const {
    int ends = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      if (signs[i] == 0 && on >> i & 1) {
        if ((edges[i] | edges[(i + 2) % 3]) == 0) return true;
        ++ends;
      }
      if (signs[i] * signs[(i + 1) % 3] < 0 && edges[i] != 0) ++ends;
    }
    return ends > 1;
  }

  std::array<int, 3> signs;
  unsigned any = 0;
  int zeros = 0;
};

}  // namespace

OverlapTest::OverlapTest(const BodyPair& pair, OverlapScratch& scratch)
    : m_pair(pair), m_scratch(scratch) {
  for (const bool ofA : {true, false})
    sideOf(ofA).sides.assign(pair.geometry(ofA).mesh.topology.elements.size(), 0);
}

unsigned OverlapTest::sidesOf(bool ofA, std::uint32_t element) {
  std::uint8_t& sides = sideOf(ofA).sides[element];
  if (sides != 0) return sides & (kFront | kBehind);
  sides = kKnown;
  const auto [p, q, r] =
      ofA ? m_pair.cornersOfA(element, Vector3d::Zero()) : m_pair.cornersOfB(element);
  if (!hasArea(p, q, r)) return 0;
  const Vector3d middle = p / 3.0 + q / 3.0 + r / 3.0,
                 aside = kBesideTriangle * m_pair.magnitude() * windingNormal(p, q, r);
  if (m_pair.windingNumberOf(ofA, middle + aside) != 0) sides |= kFront;
  if (m_pair.windingNumberOf(ofA, middle - aside) != 0) sides |= kBehind;
  return sides & (kFront | kBehind);
}

/// Whether the direction from an edge's line to p is in the body between two triangles at the edge.
/// p is off the line. Not if it is along one of the triangles. at: a point of the edge, of which
/// triangles without area may hide the triangles behind them.
bool OverlapTest::isBetween(bool ofA, std::uint32_t edge, const Vector3d& start,
                            const Vector3d& end, const Vector3d& at, const Vector3d& p) {
  const MeshTopology& topology = m_pair.geometry(ofA).mesh.topology;
  Eigen::Index axis = 0;
  (end - start).cwiseAbs().maxCoeff(&axis);
  const auto turn = [&](const Vector3d& from, const Vector3d& to) {
    return orient3d(start, end, from, to, m_counts);
  };
  // The triangle that comes first from p on, counter-clockwise.
  Vector3d nearest = Vector3d::Zero();
  int nearestPlace = 3;
  bool isInside = false, isAlong = false;
  const auto take = [&](std::uint32_t t, const Corners& corners, std::size_t i) {
    const unsigned sides = sidesOf(ofA, t);
    if (sides == 0) return;
    const Vector3d& corner = corners[(i + 2) % 3];
    const int way = turn(p, corner);
    isAlong |= way == 0 && isSameSide(start, end, p, corner, m_counts);
    const int place = way > 0 ? 0 : way == 0 ? 1 : 2;  // in front of p's opposite, on it, behind
    if (place > nearestPlace || (place == nearestPlace && turn(nearest, corner) >= 0)) return;
    nearest = corner;
    nearestPlace = place;
    const bool isForward =
        (corners[(i + 1) % 3][axis] > corners[i][axis]) == (end[axis] > start[axis]);
    isInside = (sides & (isForward ? kBehind : kFront)) != 0;
  };
  CountedVector<std::uint32_t>& edges = m_scratch.edges;
  edges.assign(1, edge);
  for (std::size_t n = 0; n < edges.size(); ++n)
    for (const std::uint32_t t : topology.edgeTriangles[edges[n]]) {
      const Corners corners = ofA ? m_pair.cornersOfA(t, m_shift) : m_pair.cornersOfB(t);
      const bool isFlat = !hasArea(corners[0], corners[1], corners[2]);
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t next = topology.triangleEdges[t][i];
        if (!isFlat) {
          if (next == edges[n]) take(t, corners, i);
        } else if (next != kNoEdge &&
                   (at[axis] > corners[i][axis]) != (at[axis] > corners[(i + 1) % 3][axis]) &&
                   std::find(edges.begin(), edges.end(), next) == edges.end()) {
          edges.push_back(next);
        }
      }
    }
  return isInside && !isAlong;
}

/// Whether these triangles prove an overlap. Notes what they have in common if they only touch.
bool OverlapTest::pierce(const Both& both) {
  const unsigned sidesA = sidesOf(true, both.elementA), sidesB = sidesOf(false, both.elementB);
  if (sidesA && sidesB && (both.found.edgesOfAThroughB | both.found.edgesOfBThroughA)) return true;
  const auto markCorners = [&](bool ofA, unsigned corners) {
    const Triangle& names =
        m_pair.geometry(ofA).mesh.topology.elements[ofA ? both.elementA : both.elementB];
    for (std::size_t i = 0; i < 3; ++i)
      if (corners >> i & 1) sideOf(ofA).vertices[names[i]] = kOnOther;
  };
  markCorners(true, both.found.cornersOfAOnB);
  markCorners(false, both.found.cornersOfBOnA);
  const PlaneSegment a(both.a, both.b, m_counts);
  if (a.isCoplanar()) {
    if (!hasArea(both.b[0], both.b[1], both.b[2]) || !shareArea(both.a, both.b, m_counts))
      return false;
    m_scratch.a.triangles[both.elementA] = m_scratch.b.triangles[both.elementB] = 1;
    const bool alike = windingNormal(both.a[0], both.a[1], both.a[2])
                           .dot(windingNormal(both.b[0], both.b[1], both.b[2])) > 0;
    return (sidesA & (alike ? sidesB : opposite(sidesB))) != 0;
  }
  if (!sidesA || !sidesB || !a.isSegment()) return false;
  const PlaneSegment b(both.b, both.a, m_counts);
  if (!b.isSegment()) return false;
  std::array<unsigned, 3> edgesOfA{}, edgesOfB{};  // those of the other triangle that touch each
  for (unsigned i = 0; i < 3; ++i)
    for (unsigned j = 0; j < 3; ++j)
      if (both.found.touchingEdges &
          TriangleIntersection::edgesBit(static_cast<int>(i), static_cast<int>(j))) {
        edgesOfA[i] |= 1u << j;
        edgesOfB[j] |= 1u << i;
      }
  if (!a.reaches(both.found.cornersOfAOnB, edgesOfA) &&
      !b.reaches(both.found.cornersOfBOnA, edgesOfB))
    return false;  // the segments have one point in common
  if (a.isEdge() && b.isEdge()) {
    const std::size_t edgeOfA = a.edge(), edgeOfB = b.edge();
    const Vector3d &startA = both.a[edgeOfA], &endA = both.a[(edgeOfA + 1) % 3],
                   &startB = both.b[edgeOfB], &endB = both.b[(edgeOfB + 1) % 3];
    const Vector3d at = middleOfCommon(startA, endA, startB, endB);
    const auto id = [&](bool ofA) {
      return m_pair.geometry(ofA).mesh.topology.triangleEdges[ofA ? both.elementA : both.elementB]
                                                             [ofA ? edgeOfA : edgeOfB];
    };
    return isBetween(false, id(false), startB, endB, at, both.a[a.opposite()]) ||
           isBetween(true, id(true), startA, endA, at, both.b[b.opposite()]);
  }
  if (a.isEdge()) return (sidesB & sideOfSign(a.signs[a.opposite()])) != 0;
  if (b.isEdge()) return (sidesA & sideOfSign(b.signs[b.opposite()])) != 0;
  return true;
}

OverlapTest::Result OverlapTest::find(const Vector3d& shift, CountedVector<Both>* intersecting) {
  m_shift = shift;
  for (const bool ofA : {true, false}) {
    sideOf(ofA).vertices.assign(m_pair.vertices(ofA).positions.size(), 0);
    sideOf(ofA).triangles.assign(sideOf(ofA).sides.size(), 0);
  }
  if (intersecting) intersecting->clear();
  bool any = false;
  const auto test = [&](const Both& both) {
    if (intersecting) intersecting->push_back(both);
    any = any || pierce(both);
    return intersecting || !any;
  };
  m_pair.forEachIntersecting(shift, std::ref(test));  // a copy would allocate
  m_pair.countExactDecisions(std::exchange(m_counts.undecided, 0));
  if (intersecting)
    sortInTime(intersecting->begin(), intersecting->end(), [](const Both& l, const Both& r) {
      return std::pair(l.elementA, l.elementB) < std::pair(r.elementA, r.elementB);
    });
  if (any) return Result::Piercing;
  return isAnyPartInside(true) || isAnyPartInside(false) ? Result::Inside : Result::Apart;
}

/// Whether a part of one surface is inside the other body, where no triangles pierce: at a vertex
/// that is not on the other surface, or in the middle of a triangle of which only edges and corners
/// are.
bool OverlapTest::isAnyPartInside(bool ofA) {
  const BodyVertices& own = m_pair.vertices(ofA);
  const MeshTopology& topology = m_pair.geometry(ofA).mesh.topology;
  CountedVector<std::uint8_t>& vertices = sideOf(ofA).vertices;
  const auto isInside = [&](const Vector3d& p) {
    return ofA ? m_pair.isInB(p) : m_pair.isInMovedA(p, m_shift);
  };
  std::size_t open = own.parts.size();
  // Decides the part of a vertex once. Returns whether it is inside, with a volume.
  const auto decide = [&](std::uint32_t part, const Vector3d& p) {
    vertices[part] |= kDecided;
    --open;
    return isInside(p) && hasInside(part, ofA);
  };
  const auto tryVertex = [&](std::uint32_t v) {
    const std::uint32_t part = own.partOf[v];
    return !(vertices[v] & kOnOther) && !(vertices[part] & kDecided) &&
           decide(part, m_pair.position({ofA, v}, m_shift));
  };
  for (const std::uint32_t v : own.parts)
    if (tryVertex(v)) return true;
  for (std::uint32_t v = 0; v < vertices.size() && open > 0; ++v)
    if (own.triangleOf[v] != kNoElement && tryVertex(v)) return true;
  for (std::uint32_t t = 0; t < topology.elements.size() && open > 0; ++t) {
    if (topology.isRemoved(t)) continue;
    const std::uint32_t part = own.partOf[topology.elements[t][0]];
    if (sideOf(ofA).triangles[t] || vertices[part] & kDecided || !sidesOf(ofA, t)) continue;
    const Corners p = ofA ? m_pair.cornersOfA(t, m_shift) : m_pair.cornersOfB(t);
    if (decide(part, p[0] / 3.0 + p[1] / 3.0 + p[2] / 3.0)) return true;
  }
  return false;
}

/// Whether a body is on a side of any triangle of its part.
bool OverlapTest::hasInside(std::uint32_t part, bool ofA) {
  const BodyVertices& own = m_pair.vertices(ofA);
  const MeshTopology& topology = m_pair.geometry(ofA).mesh.topology;
  if (sidesOf(ofA, own.triangleOf[part])) return true;
  for (std::uint32_t t = 0; t < topology.elements.size(); ++t)
    if (!topology.isRemoved(t) && own.partOf[topology.elements[t][0]] == part && sidesOf(ofA, t))
      return true;
  return false;
}

bool isConvex(const BodyPair& pair, bool ofA) {
  const MeshTopology& topology = pair.geometry(ofA).mesh.topology;
  const auto& positions = pair.vertices(ofA).positions;
  const double most = kExitSlack * pair.magnitude();
  const Vector3d centre = pair.vertices(ofA).box.center();
  const int number = pair.windingNumberOf(ofA, centre);
  if (number != 1 && number != -1) return false;
  // Whether no point is in front of a triangle's outer side.
  const auto isBehind = [&](std::uint32_t triangle, const Vector3d& p) {
    const auto [a, b, c] = cornersOf(topology.elements[triangle], positions);
    return number * windingNormal(a, b, c).dot(p - a) <= most;
  };
  TimeCheck check(64);
  for (std::uint32_t e = 0; e < topology.edges.size(); ++e) {
    check();
    const auto both = topology.edgeTriangles[e];
    if (both.size() != 2 || !isBehind(both[0], centre) || !isBehind(both[1], centre)) return false;
    for (std::size_t side = 0; side < 2; ++side)
      for (const std::uint32_t v : topology.elements[both[1 - side]])
        if (!isBehind(both[side], positions[v])) return false;
  }
  return true;
}

}  // namespace palpate
