#include "NarrowPhase/Meeting.h"

#include "NarrowPhase/Intersection.h"

#include <algorithm>
#include <array>
#include <bit>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The sides of a plane on which some points lie.
struct Sides {
  bool front = false, behind = false;
  void add(int side) {
    front |= side > 0;
    behind |= side < 0;
  }
  bool both() const { return front && behind; }
};

constexpr int next(int i) { return (i + 1) % 3; }

/// One triangle of an intersecting pair, the other one, and the features of this one on that one.
class Piercer {
 public:
  Piercer(const MeshPair& pair, bool atStart, const ElementPair& ids,
          const TriangleIntersection& found, bool second, SignCounts& counts)
      : m_topology((second ? pair.b : pair.a).topology),
        m_otherTopology((second ? pair.a : pair.b).topology),
        m_at(positionsOf(second ? pair.b : pair.a, atStart)),
        m_corners(m_topology.elements[second ? ids.b : ids.a]),
        m_otherCorners(m_otherTopology.elements[second ? ids.a : ids.b]),
        m_triangle(second ? ids.b : ids.a),
        m_cornersOn(second ? found.cornersOfBOnA : found.cornersOfAOnB),
        m_edgesThrough(second ? found.edgesOfBThroughA : found.edgesOfAThroughB),
        m_counts(counts) {
    const Positions& other = positionsOf(second ? pair.a : pair.b, atStart);
    for (int i = 0; i < 3; ++i) m_other[i] = other[m_otherCorners[i]];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        if (found.touchingEdges &
            (second ? TriangleIntersection::edgesBit(j, i) : TriangleIntersection::edgesBit(i, j)))
          m_touched[i] |= static_cast<std::uint8_t>(1u << j);
    for (int i = 0; i < 3; ++i) m_sides[i] = sideOf(m_corners[i]);
  }

  bool passesThrough() const { return m_edgesThrough != 0; }
  bool isOnBothSides() const {
    Sides sides;
    for (const int side : m_sides) sides.add(side);
    return sides.both();
  }
  bool isInPlane() const { return m_sides[0] == 0 && m_sides[1] == 0 && m_sides[2] == 0; }
  bool isClosed() const { return m_topology.hasFaces() && m_topology.hasOnlyClosedStars(); }

  /// Rules (2) and (3). bothClosed: for both surfaces.
  bool piercesByStar(bool bothClosed) const {
    const auto pierces = [&](const Sides& sides) {
      return sides.both() || (bothClosed && sides.behind);
    };
    for (int i = 0; i < 3; ++i) {
      if (isInInterior(i)) {
        Sides sides;
        for (const std::uint32_t t : m_topology.vertexTriangles[m_corners[i]]) addTo(sides, t);
        if (pierces(sides)) return true;
      }
      if (!passesInterior(i)) continue;
      Sides sides;
      for (const std::uint32_t t :
           m_topology.edgeTriangles[m_topology.triangleEdges[m_triangle][i]])
        addTo(sides, t);
      if (pierces(sides)) return true;
    }
    return false;
  }

  /// Number of different points among the corners on the other triangle.
  int cornersOn() const { return std::popcount(m_cornersOn); }
  bool isOn(int corner) const { return m_cornersOn >> corner & 1; }
  Vector3d corner(int i) const { return m_at[m_corners[i]]; }
  /// The other triangle's edges that edge i touches between its own corners.
  unsigned touchedBetweenCorners(int i) const {
    return isOn(i) || isOn(next(i)) ? 0u : m_touched[i];
  }
  const Corners& other() const { return m_other; }

 private:
  static const Positions& positionsOf(const TriangleMesh& mesh, bool atStart) {
    return atStart ? mesh.before : mesh.now;
  }
  int sideOf(std::uint32_t vertex) const {
    if (&m_topology == &m_otherTopology &&
        std::find(m_otherCorners.begin(), m_otherCorners.end(), vertex) != m_otherCorners.end())
      return 0;
    return orient3d(m_other[0], m_other[1], m_other[2], m_at[vertex], m_counts);
  }
  void addTo(Sides& sides, std::uint32_t triangle) const {
    for (const std::uint32_t v : m_topology.elements[triangle]) sides.add(sideOf(v));
  }
  /// Whether a corner lies on the other triangle and on none of its edges.
  bool isInInterior(int corner) const {
    return isOn(corner) && m_touched[corner] == 0 && m_touched[next(next(corner))] == 0;
  }
  /// Whether an edge lies in the other triangle's plane and meets its interior.
  bool passesInterior(int edge) const {
    if (m_sides[edge] != 0 || m_sides[next(edge)] != 0) return false;
    if (m_topology.triangleEdges[m_triangle][edge] == kNoEdge) return false;
    if (isInInterior(edge) || isInInterior(next(edge))) return true;
    const Vector3d p = corner(edge), q = corner(next(edge));
    std::array<bool, 3> isOnLine;
    for (int j = 0; j < 3; ++j) isOnLine[j] = areCollinear(p, q, m_other[j]);
    for (int j = 0; j < 3; ++j)
      if (isOnLine[j] && isOnLine[next(j)]) return false;  // along an edge of the other triangle
    // It meets two edges of the other triangle away from their common corner.
    for (int j = 0; j < 3; ++j)
      if (m_touched[edge] >> j & 1 && m_touched[edge] >> next(j) & 1 && !isOnLine[next(j)])
        return true;
    return false;
  }
  bool areCollinear(const Vector3d& a, const Vector3d& b, const Vector3d& c) const {
    for (int axis = 0; axis < 3; ++axis)
      if (orient2d(axis, a, b, c, m_counts) != 0) return false;
    return true;
  }

  const MeshTopology &m_topology, &m_otherTopology;
  const Positions& m_at;
  const Triangle &m_corners, &m_otherCorners;
  const std::uint32_t m_triangle;
  const unsigned m_cornersOn, m_edgesThrough;
  SignCounts& m_counts;
  Corners m_other;
  std::array<std::uint8_t, 3> m_touched{};  ///< per edge, bit j: it touches edge j of the other
  std::array<int, 3> m_sides;               ///< of the other's plane
};

/// Whether two triangles that cross each other's planes have more than one point in common. Each
/// point is a corner on the other triangle, or one at which two edges meet between their corners.
bool haveTwoPointsInCommon(const Piercer& a, const Piercer& b, bool self) {
  int count = a.cornersOn() + b.cornersOn();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      if (a.isOn(i) && b.isOn(j) && a.corner(i) == b.corner(j)) --count;
      count += (a.touchedBetweenCorners(i) >> j & 1) && (b.touchedBetweenCorners(j) >> i & 1);
      // Of one mesh: a common vertex is a point in common, and not among the corners above.
      count += self && !a.isOn(i) && a.corner(i) == b.corner(j);
    }
  return count > 1;
}

/// Rule (4), for triangles in one plane.
bool overlapWithOneDirection(const Corners& a, const Corners& b, SignCounts& counts) {
  for (int axis = 0; axis < 3; ++axis) {
    const int turnA = orient2d(axis, a[0], a[1], a[2], counts),
              turnB = orient2d(axis, b[0], b[1], b[2], counts);
    if (turnA == 0 || turnB == 0) continue;
    const auto separates = [&](const Corners& t, int turn, const Corners& points) {
      for (int i = 0; i < 3; ++i)
        if (std::all_of(points.begin(), points.end(), [&](const Vector3d& p) {
              return turn * orient2d(axis, t[i], t[next(i)], p, counts) <= 0;
            }))
          return true;
      return false;
    };
    return turnA == turnB && !separates(a, turnA, b) && !separates(b, turnB, a);
  }
  return false;
}

bool pierce(const MeshPair& pair, bool atStart, const ElementPair& ids,
            const TriangleIntersection& found, SignCounts& counts) {
  if (!found.touch()) return true;
  const Piercer a(pair, atStart, ids, found, false, counts),
      b(pair, atStart, ids, found, true, counts);
  if (a.passesThrough() || b.passesThrough()) return true;
  if (a.isOnBothSides() && b.isOnBothSides() && haveTwoPointsInCommon(a, b, pair.self()))
    return true;
  const bool closed = a.isClosed() && b.isClosed();
  if (a.isInPlane() && b.isInPlane() && closed &&
      overlapWithOneDirection(b.other(), a.other(), counts))
    return true;
  return a.piercesByStar(closed) || b.piercesByStar(closed);
}

Meeting classify(const MeshPair& pair, bool atStart, const ElementPair& ids,
                 TriangleIntersection known, SignCounts& counts) {
  if (!known.intersect()) known = intersectionOf(pair, atStart, ids, counts);
  if (!known.intersect()) return Meeting::Apart;
  return pierce(pair, atStart, ids, known, counts) ? Meeting::Piercing : Meeting::Touching;
}

}  // namespace

Meeting meetingOf(const MeshPair& pair, bool atStart, const ElementPair& candidate,
                  ContactBuffers& counts) {
  SignCounts signs;
  const Meeting meeting = classify(pair, atStart, candidate, {}, signs);
  counts.exactDecisions += signs.undecided;
  return meeting;
}

SurfaceMeeting meetingOf(const MeshPair& pair, bool atStart,
                         std::span<const ElementPair> candidates, ContactBuffers& counts) {
  keepPossible(pair, atStart, candidates, counts.possible);
  counts.validityPairs += candidates.size();
  SignCounts signs;
  SurfaceMeeting all;
  for (const PossibleIntersection& possible : counts.possible) {
    const Meeting found = classify(pair, atStart, possible.triangles, possible.intersection, signs);
    all.meeting = std::max(all.meeting, found);
    if (found != Meeting::Piercing) continue;
    all.piercing = possible.triangles;
    break;
  }
  counts.exactDecisions += signs.undecided;
  return all;
}

}  // namespace palpate
