#include "Math/TriangleIntersection.h"

#include <palpate/Intersection.h>

namespace palpate {

namespace {

using Signs = std::array<int, 3>;

constexpr int next(int i) { return i == 2 ? 0 : i + 1; }

bool strictlyOneSide(const Signs& s) { return s[0] != 0 && s[0] == s[1] && s[0] == s[2]; }
bool anyZero(const Signs& s) { return s[0] == 0 || s[1] == 0 || s[2] == 0; }
bool allZero(const Signs& s) { return s[0] == 0 && s[1] == 0 && s[2] == 0; }
bool mixed(const Signs& s) {
  return (s[0] > 0 || s[1] > 0 || s[2] > 0) && (s[0] < 0 || s[1] < 0 || s[2] < 0);
}

struct Box {
  Eigen::Array3d lower, upper;
  Box(const Eigen::Vector3d& p, const Eigen::Vector3d& q)
      : lower(p.array().min(q.array())), upper(p.array().max(q.array())) {}
  explicit Box(const Corners& c) : Box(c[0], c[1]) {
    lower = lower.min(c[2].array());
    upper = upper.max(c[2].array());
  }
  bool meets(const Box& other) const {
    return (lower <= other.upper).all() && (other.lower <= upper).all();
  }
  bool contains(const Eigen::Vector3d& p) const {
    return (lower <= p.array()).all() && (p.array() <= upper).all();
  }
};

Signs sides(const Corners& triangle, const Corners& points, SignCounts& counts) {
  const OrientedPlane plane(triangle[0], triangle[1], triangle[2]);
  return {plane.side(points[0], counts), plane.side(points[1], counts),
          plane.side(points[2], counts)};
}

/// The corner that is alone on its side of a plane which the triangle crosses, no corner being on
/// the plane.
int lonelyCorner(const Signs& s) { return s[0] == s[1] ? 2 : s[0] == s[2] ? 1 : 0; }

/// Neither triangle has a corner on the other's plane and both cross it: the planes meet in a line,
/// on which each triangle covers an interval that ends at the two edges of its lonely corner. The
/// sign of the volume of an edge of a and one of b, both taken from the lonely corners, says which
/// end comes first, in a sense common to all four.
TriangleIntersection intersectCrossing(const Corners& a, const Corners& b, const Signs& sidesOfA,
                                       const Signs& sidesOfB, SignCounts& counts) {
  const int p = lonelyCorner(sidesOfA), q = lonelyCorner(sidesOfB);
  const std::array<int, 2> edgesA{p, next(next(p))}, edgesB{q, next(next(q))};
  const std::array<int, 2> endsA{next(p), edgesA[1]}, endsB{next(q), edgesB[1]};
  std::array<std::array<int, 2>, 2> order;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j)
      order[i][j] = orient3d(a[p], a[endsA[i]], b[q], b[endsB[j]], counts);
  }
  TriangleIntersection result;
  for (int i = 0; i < 2; ++i) {
    if (order[i][0] * order[i][1] < 0) result.edgesOfAThroughB |= 1 << edgesA[i];
    if (order[0][i] * order[1][i] < 0) result.edgesOfBThroughA |= 1 << edgesB[i];
    for (int j = 0; j < 2; ++j) {
      if (order[i][j] == 0) result.touchingEdges |= 1 << (3 * edgesA[i] + edgesB[j]);
    }
  }
  return result;
}

/// Decides which points that lie in one plane coincide, by their projections along the axes. What
/// meets in space meets in all three; and along at least one axis the plane is seen at full
/// dimension, so what meets in all three meets in space. Where such an axis is known, it alone is
/// enough.
class InPlane {
 public:
  explicit InPlane(SignCounts& counts) : m_counts(counts) {}

  /// From here on only what lies in this triangle's plane is asked for. False, and no change, if it
  /// has no area.
  bool useAxisOf(const Corners& triangle) {
    for (int axis = 0; axis < 3; ++axis) {
      if (orient2d(axis, triangle[0], triangle[1], triangle[2], m_counts) == 0) continue;
      m_first = axis;
      m_last = axis;
      return true;
    }
    return false;
  }

  /// A point within the box and seen by no two edges from different sides is in the triangle: with
  /// area, no point outside is; without area, a point on the triangle's line is left to the box.
  bool pointInTriangle(const Eigen::Vector3d& p, const Corners& t, const Box& boxOfT) const {
    if (!boxOfT.contains(p)) return false;
    for (int axis = m_first; axis <= m_last; ++axis) {
      if (mixed({orient2d(axis, t[0], t[1], p, m_counts), orient2d(axis, t[1], t[2], p, m_counts),
                 orient2d(axis, t[2], t[0], p, m_counts)}))
        return false;
    }
    return true;
  }

  /// Segments whose boxes overlap meet if neither is strictly to one side of the other; those of no
  /// length included.
  bool segmentsMeet(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1, const Eigen::Vector3d& q0,
                    const Eigen::Vector3d& q1) const {
    for (int axis = m_first; axis <= m_last; ++axis) {
      if (orient2d(axis, p0, p1, q0, m_counts) * orient2d(axis, p0, p1, q1, m_counts) > 0 ||
          orient2d(axis, q0, q1, p0, m_counts) * orient2d(axis, q0, q1, p1, m_counts) > 0)
        return false;
    }
    return true;
  }

 private:
  int m_first = 0, m_last = 2;
  SignCounts& m_counts;
};

std::uint8_t cornersOn(const Corners& corners, const Signs& sidesOfCorners, const Corners& triangle,
                       const Box& boxOfTriangle, SignCounts& counts) {
  if (!anyZero(sidesOfCorners)) return 0;
  InPlane inPlane(counts);
  inPlane.useAxisOf(triangle);
  std::uint8_t found = 0;
  for (int i = 0; i < 3; ++i) {
    if (sidesOfCorners[i] == 0 && inPlane.pointInTriangle(corners[i], triangle, boxOfTriangle))
      found |= 1 << i;
  }
  return found;
}

std::uint8_t edgesThrough(const Corners& corners, const Signs& sidesOfCorners,
                          const Corners& triangle, SignCounts& counts) {
  std::uint8_t found = 0;
  for (int i = 0; i < 3; ++i) {
    if (sidesOfCorners[i] * sidesOfCorners[next(i)] >= 0) continue;
    Signs around;
    for (int j = 0; j < 3; ++j)
      around[j] = orient3d(corners[i], corners[next(i)], triangle[j], triangle[next(j)], counts);
    if (strictlyOneSide(around)) found |= 1 << i;
  }
  return found;
}

/// Corners on the other's plane, a triangle without area, or both: every feature is tested by
/// itself.
TriangleIntersection intersectTouching(const Corners& a, const Corners& b, const Box& boxA,
                                       const Box& boxB, const Signs& sidesOfA,
                                       const Signs& sidesOfB, SignCounts& counts) {
  InPlane inPlane(counts);
  const bool coplanar =
      (allZero(sidesOfA) && inPlane.useAxisOf(b)) || (allZero(sidesOfB) && inPlane.useAxisOf(a));
  TriangleIntersection result;
  result.cornersOfAOnB = cornersOn(a, sidesOfA, b, boxB, counts);
  result.cornersOfBOnA = cornersOn(b, sidesOfB, a, boxA, counts);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d &p0 = a[i], &p1 = a[next(i)];
    const Box boxP(p0, p1);
    if (sidesOfA[i] * sidesOfA[next(i)] > 0 || !boxP.meets(boxB)) continue;
    for (int j = 0; j < 3; ++j) {
      const Eigen::Vector3d &q0 = b[j], &q1 = b[next(j)];
      if (sidesOfB[j] * sidesOfB[next(j)] > 0 || !boxP.meets(Box(q0, q1))) continue;
      if ((coplanar || orient3d(p0, p1, q0, q1, counts) == 0) &&
          inPlane.segmentsMeet(p0, p1, q0, q1))
        result.touchingEdges |= 1 << (3 * i + j);
    }
  }
  if (!coplanar) {
    result.edgesOfAThroughB = edgesThrough(a, sidesOfA, b, counts);
    result.edgesOfBThroughA = edgesThrough(b, sidesOfB, a, counts);
  }
  return result;
}

}  // namespace

TriangleIntersection intersectTriangles(const Corners& a, const Corners& b, SignCounts& counts) {
  const Box boxA(a), boxB(b);
  if (!boxA.meets(boxB)) return {};
  const Signs sidesOfA = sides(b, a, counts);
  if (strictlyOneSide(sidesOfA)) return {};
  const Signs sidesOfB = sides(a, b, counts);
  if (strictlyOneSide(sidesOfB)) return {};
  if (anyZero(sidesOfA) || anyZero(sidesOfB))
    return intersectTouching(a, b, boxA, boxB, sidesOfA, sidesOfB, counts);
  return intersectCrossing(a, b, sidesOfA, sidesOfB, counts);
}

bool trianglesIntersect(const Eigen::Vector3d& a0, const Eigen::Vector3d& a1,
                        const Eigen::Vector3d& a2, const Eigen::Vector3d& b0,
                        const Eigen::Vector3d& b1, const Eigen::Vector3d& b2) {
  SignCounts counts;
  return intersectTriangles({a0, a1, a2}, {b0, b1, b2}, counts).intersect();
}

}  // namespace palpate
