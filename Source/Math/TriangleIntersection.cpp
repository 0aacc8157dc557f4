#include "Math/TriangleIntersection.h"

#include <palpate/FeaturePairs.h>

#include "Core/FloatingPoint.h"

namespace palpate {

namespace {

using Signs = std::array<int, 3>;

constexpr int next(int i) { return i == 2 ? 0 : i + 1; }

bool hasBit(unsigned bits, int i) { return bits >> i & 1; }

bool strictlyOneSide(const Signs& s) { return s[0] != 0 && s[0] == s[1] && s[0] == s[2]; }
bool anyZero(const Signs& s) { return s[0] == 0 || s[1] == 0 || s[2] == 0; }
bool allZero(const Signs& s) { return s[0] == 0 && s[1] == 0 && s[2] == 0; }
bool haveBothSigns(const Signs& s) {
  return (s[0] > 0 || s[1] > 0 || s[2] > 0) && (s[0] < 0 || s[1] < 0 || s[2] < 0);
}

struct DoubleBox {
  Eigen::Array3d lower, upper;
  DoubleBox(const Eigen::Vector3d& p, const Eigen::Vector3d& q)
      : lower(p.array().min(q.array())), upper(p.array().max(q.array())) {}
  explicit DoubleBox(const Corners& c) : DoubleBox(c[0], c[1]) {
    lower = lower.min(c[2].array());
    upper = upper.max(c[2].array());
  }
  bool overlaps(const DoubleBox& other) const {
    return (lower <= other.upper).all() && (other.lower <= upper).all();
  }
  bool contains(const Eigen::Vector3d& p) const {
    return (lower <= p.array()).all() && (p.array() <= upper).all();
  }
};

/// A triangle and, for each of its corners, its side of the other triangle's plane.
struct ClassifiedTriangle {
  const Corners& corners;
  const DoubleBox& box;
  unsigned excluded;  ///< bit i: corner i is a corner of the other, too
  Signs sides{};

  void classify(const Corners& other, SignCounts& counts) {
    const OrientedPlane plane(other[0], other[1], other[2]);
    for (int i = 0; i < 3; ++i)
      if (!hasBit(excluded, i)) sides[i] = plane.side(corners[i], counts);
  }
  /// Whether all corners that are not shared are strictly on one side. The other triangle then has
  /// area, and at most the shared corners lie on its plane.
  bool isOnOneSide() const {
    int sum = 0, count = 0;
    for (int i = 0; i < 3; ++i) {
      if (hasBit(excluded, i)) continue;
      sum += sides[i];
      ++count;
    }
    return sum != 0 && std::abs(sum) == count;
  }
  bool isEdgeOnOneSide(int i) const { return sides[i] * sides[next(i)] > 0; }
  bool edgeCrosses(int i) const { return sides[i] * sides[next(i)] < 0; }
};

/// The corner that is alone on its side of a plane. The triangle must cross the plane, and no
/// corner may lie on it.
int isolatedCorner(const Signs& s) { return s[0] == s[1] ? 2 : s[0] == s[2] ? 1 : 0; }

/// For triangles that both cross the other's plane and have no corner on it. The planes meet in a
/// line. On this line each triangle covers an interval that ends at the two edges of its isolated
/// corner. The sign of the volume of an edge of a and an edge of b, both starting at the isolated
/// corners, decides which end comes first. The sense is common to all four volumes.
TriangleIntersection intersectCrossing(const ClassifiedTriangle& a, const ClassifiedTriangle& b,
                                       SignCounts& counts) {
  const int p = isolatedCorner(a.sides), q = isolatedCorner(b.sides);
  const std::array<int, 2> edgesA{p, next(next(p))}, edgesB{q, next(next(q))};
  const std::array<int, 2> endsA{next(p), edgesA[1]}, endsB{next(q), edgesB[1]};
  std::array<std::array<int, 2>, 2> order;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j)
      order[i][j] =
          orient3d(a.corners[p], a.corners[endsA[i]], b.corners[q], b.corners[endsB[j]], counts);
  }
  TriangleIntersection result;
  for (int i = 0; i < 2; ++i) {
    if (order[i][0] * order[i][1] < 0) result.edgesOfAThroughB |= 1 << edgesA[i];
    if (order[0][i] * order[1][i] < 0) result.edgesOfBThroughA |= 1 << edgesB[i];
    for (int j = 0; j < 2; ++j) {
      if (order[i][j] == 0)
        result.touchingEdges |= TriangleIntersection::edgesBit(edgesA[i], edgesB[j]);
    }
  }
  return result;
}

// Coincidence of points in one plane is decided by projections along the axes. Features that meet
// in space meet in all three projections. Along at least one axis the plane's projection has full
// dimension, so features that meet in all three projections meet in space. If such an axis is
// known, it alone is enough.

struct ProjectionAxes {
  int first = 0, last = 2;
  bool isSingle() const { return first == last; }
};

/// An axis along which the triangle's projection has area; all axes if there is none.
ProjectionAxes projectionAxes(const Corners& t, SignCounts& counts) {
  for (int axis = 0; axis < 3; ++axis)
    if (orient2d(axis, t[0], t[1], t[2], counts) != 0) return {axis, axis};
  return {};
}

/// The sides of a triangle's edges on which another triangle's corners lie, in the projection along
/// an axis.
class SidesOfEdges {
 public:
  SidesOfEdges(const Corners& triangle, const Corners& points, SignCounts& counts)
      : m_triangle(triangle), m_points(points), m_counts(counts) {
    m_known.fill(kUnknown);
  }
  int operator()(int axis, int edge, int point) {
    std::int8_t& side = m_known[9 * axis + 3 * edge + point];
    if (side == kUnknown) {
      side = static_cast<std::int8_t>(
          orient2d(axis, m_triangle[edge], m_triangle[next(edge)], m_points[point], m_counts));
    }
    return side;
  }
  bool separate(int axis, int edge, int p, int q) {
    return (*this)(axis, edge, p) * (*this)(axis, edge, q) > 0;
  }

 private:
  static constexpr std::int8_t kUnknown = 2;
  const Corners &m_triangle, &m_points;
  std::array<std::int8_t, 27> m_known;
  SignCounts& m_counts;
};

/// Bit i: corner i of a is on the triangle. A point on the triangle's plane and in its box is on
/// the triangle if, in projection, it is not on different sides of the edges. With area, no point
/// outside satisfies this. Without area, only points on the triangle's line do, and the box
/// excludes the rest of the line.
std::uint8_t cornersOn(const ClassifiedTriangle& a, const ClassifiedTriangle& triangle,
                       const ProjectionAxes& axes, SidesOfEdges& sidesOf) {
  std::uint8_t found = 0;
  for (int i = 0; i < 3; ++i) {
    bool on = a.sides[i] == 0 && !hasBit(a.excluded, i) && triangle.box.contains(a.corners[i]);
    for (int axis = axes.first; on && axis <= axes.last; ++axis)
      on = !haveBothSigns({sidesOf(axis, 0, i), sidesOf(axis, 1, i), sidesOf(axis, 2, i)});
    found |= on << i;
  }
  return found;
}

std::uint8_t edgesThrough(const ClassifiedTriangle& a, const Corners& triangle,
                          SignCounts& counts) {
  std::uint8_t found = 0;
  for (int i = 0; i < 3; ++i) {
    if (!a.edgeCrosses(i)) continue;
    Signs around;
    for (int j = 0; j < 3; ++j)
      around[j] =
          orient3d(a.corners[i], a.corners[next(i)], triangle[j], triangle[next(j)], counts);
    if (strictlyOneSide(around)) found |= 1 << i;
  }
  return found;
}

/// For triangles with corners on the other's plane, without area, or both: every feature is tested
/// by itself. Segments in one plane whose boxes overlap meet if neither is strictly to one side of
/// the other. This includes segments without length.
TriangleIntersection intersectTouching(const ClassifiedTriangle& a, const ClassifiedTriangle& b,
                                       unsigned excludedEdges, SignCounts& counts) {
  const ProjectionAxes ofA = projectionAxes(a.corners, counts),
                       ofB = projectionAxes(b.corners, counts);
  const bool inPlaneOfA = allZero(b.sides) && ofA.isSingle();
  const bool coplanar = inPlaneOfA || (allZero(a.sides) && ofB.isSingle());
  const ProjectionAxes axes = inPlaneOfA ? ofA : coplanar ? ofB : ProjectionAxes();
  SidesOfEdges sidesOfA(a.corners, b.corners, counts), sidesOfB(b.corners, a.corners, counts);
  TriangleIntersection result;
  result.cornersOfAOnB = cornersOn(a, b, ofB, sidesOfB);
  result.cornersOfBOnA = cornersOn(b, a, ofA, sidesOfA);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d &p0 = a.corners[i], &p1 = a.corners[next(i)];
    const DoubleBox boxP(p0, p1);
    if (a.isEdgeOnOneSide(i) || !boxP.overlaps(b.box)) continue;
    for (int j = 0; j < 3; ++j) {
      const Eigen::Vector3d &q0 = b.corners[j], &q1 = b.corners[next(j)];
      const unsigned bit = TriangleIntersection::edgesBit(i, j);
      if (excludedEdges & bit || b.isEdgeOnOneSide(j) || !boxP.overlaps(DoubleBox(q0, q1)))
        continue;
      bool touch = coplanar || orient3d(p0, p1, q0, q1, counts) == 0;
      for (int axis = axes.first; touch && axis <= axes.last; ++axis)
        touch = !sidesOfA.separate(axis, i, j, next(j)) && !sidesOfB.separate(axis, j, i, next(i));
      if (touch) result.touchingEdges |= bit;
    }
  }
  if (!coplanar) {
    result.edgesOfAThroughB = edgesThrough(a, b.corners, counts);
    result.edgesOfBThroughA = edgesThrough(b, a.corners, counts);
  }
  return result;
}

}  // namespace

TriangleIntersection intersectTriangles(const Corners& cornersOfA, const Corners& cornersOfB,
                                        SignCounts& counts, const ExcludedFeatures& excluded) {
  const DoubleBox boxA(cornersOfA), boxB(cornersOfB);
  if (!boxA.overlaps(boxB)) return {};
  ClassifiedTriangle a{cornersOfA, boxA, excluded.cornersOfA},
      b{cornersOfB, boxB, excluded.cornersOfB};
  a.classify(cornersOfB, counts);
  if (a.isOnOneSide()) return {};
  b.classify(cornersOfA, counts);
  if (b.isOnOneSide()) return {};
  if (anyZero(a.sides) || anyZero(b.sides)) return intersectTouching(a, b, excluded.edges, counts);
  return intersectCrossing(a, b, counts);
}

bool trianglesIntersect(const Eigen::Vector3d& a0, const Eigen::Vector3d& a1,
                        const Eigen::Vector3d& a2, const Eigen::Vector3d& b0,
                        const Eigen::Vector3d& b1, const Eigen::Vector3d& b2) {
  const StandardFloatingPoint standard;
  SignCounts counts;
  return standard.evaluated(intersectTriangles({a0, a1, a2}, {b0, b1, b2}, counts).intersect());
}

}  // namespace palpate
