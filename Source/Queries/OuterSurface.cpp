#include "Queries/OuterSurface.h"

#include <palpate/Distance.h>

#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Math/TriangleIntersection.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <tuple>
#include <utility>
#include <vector>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Along the line in which two triangles intersect, all points of both, or one. The ends are
/// within rounding.
void addCommonPoints(const Corners& a, const Corners& b, const TriangleIntersection& found,
                     std::vector<Vector3d>& points) {
  const auto addCrossings = [&](const Corners& edges, unsigned bits, const Corners& triangle) {
    const Vector3d normal = windingNormal(triangle[0], triangle[1], triangle[2]);
    for (std::size_t i = 0; i < 3; ++i) {
      if (!(bits >> i & 1)) continue;
      const Vector3d &p = edges[i], &q = edges[(i + 1) % 3];
      const double atP = normal.dot(p - triangle[0]), atQ = normal.dot(q - triangle[0]),
                   t = atP / (atP - atQ);
      points.push_back(p + (t >= 0.0 && t <= 1.0 ? t : 0.5) * (q - p));
    }
  };
  addCrossings(a, found.edgesOfAThroughB, b);
  addCrossings(b, found.edgesOfBThroughA, a);
  for (std::size_t i = 0; i < 3; ++i) {
    if (found.cornersOfAOnB >> i & 1) points.push_back(a[i]);
    if (found.cornersOfBOnA >> i & 1) points.push_back(b[i]);
    for (std::size_t j = 0; j < 3; ++j)
      if (found.touchingEdges & TriangleIntersection::edgesBit(int(i), int(j))) {
        const EdgeEdgeDistance touch =
            finiteEdgeEdgeDistance(a[i], a[(i + 1) % 3], b[j], b[(j + 1) % 3]);
        points.push_back(a[i] + touch.weightA * (a[(i + 1) % 3] - a[i]));
      }
  }
}

Vector3d closestOnSegment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const VertexTriangleDistance found = finiteVertexTriangleDistance(p, a, b, b);
  return p - found.difference;
}

}  // namespace

/// Triangles near a point, and the points of them and of their intersections that are nearest.
struct OuterSurface::Candidates {
  struct Triangle {
    std::uint32_t element;
    Corners corners;
    Eigen::AlignedBox3d box;
    Vector3d normal;
  };
  struct Point {
    double distance;
    std::uint32_t element;
    Vector3d point;
  };
  std::vector<Triangle> triangles;
  std::vector<Point> points;  ///< by ascending distance

  Candidates(const SearchableGeometry& geometry, const std::vector<std::uint32_t>& elements,
             const Vector3d& p) {
    for (const std::uint32_t element : elements) {
      const auto& [i, j, k] = geometry.mesh.topology.triangles[element];
      const Positions& now = geometry.mesh.now;
      Triangle triangle{element, {now[i], now[j], now[k]}, {}, {}};
      for (const Vector3d& corner : triangle.corners) triangle.box.extend(corner);
      const auto& [a, b, c] = triangle.corners;
      triangle.normal = windingNormal(a, b, c);
      triangles.push_back(triangle);
    }
    std::sort(triangles.begin(), triangles.end(), [](const Triangle& a, const Triangle& b) {
      return std::pair(a.box.min()[0], a.element) < std::pair(b.box.min()[0], b.element);
    });
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      const Triangle& triangle = triangles[i];
      const auto& [a, b, c] = triangle.corners;
      add(p, triangle.element, p - finiteVertexTriangleDistance(p, a, b, c).difference);
      for (const auto& [start, end] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)})
        add(p, triangle.element, closestOnSegment(p, start, end));
      for (std::size_t j = i + 1; j < triangles.size(); ++j) {
        if (triangles[j].box.min()[0] > triangle.box.max()[0]) break;
        if (triangle.box.intersects(triangles[j].box)) addCommon(p, triangle, triangles[j]);
      }
    }
    std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) {
      return std::tuple(a.distance, a.element, a.point[0], a.point[1], a.point[2]) <
             std::tuple(b.distance, b.element, b.point[0], b.point[1], b.point[2]);
    });
  }

 private:
  void add(const Vector3d& p, std::uint32_t element, const Vector3d& point) {
    points.push_back({stableLength(p - point), element, point});
  }
  void addCommon(const Vector3d& p, const Triangle& a, const Triangle& b) {
    SignCounts counts;
    const TriangleIntersection found = intersectTriangles(a.corners, b.corners, counts);
    if (!found.intersect()) return;
    std::vector<Vector3d> common;
    addCommonPoints(a.corners, b.corners, found, common);
    const Vector3d along = a.normal.cross(b.normal);
    const auto [first, last] = std::minmax_element(
        common.begin(), common.end(),
        [&](const Vector3d& l, const Vector3d& r) { return along.dot(l) < along.dot(r); });
    add(p, std::min(a.element, b.element), closestOnSegment(p, *first, *last));
  }
};

OuterSurface::OuterSurface(const SearchableGeometry& geometry, bool bruteForce,
                           WindingNumber windingNumber)
    : m_geometry(geometry), m_bruteForce(bruteForce), m_windingNumber(std::move(windingNumber)) {}

/// L: how far beside the surface winding numbers are asked for.
double OuterSurface::aside(const Vector3d& p) const {
  const FloatFrame& frame = m_geometry.tree.frame();
  const FloatBox root = m_geometry.tree.octree().box(0);
  double reach = 0.0;
  for (int k = 0; k < 3; ++k)
    reach = std::max({reach, std::abs(double{root.lower[k]}), std::abs(double{root.upper[k]})});
  return kOuterAside * (reach / frame.scale + worldOrigin(m_geometry).cwiseAbs().maxCoeff() +
                        p.cwiseAbs().maxCoeff());
}

bool OuterSurface::holds(const Vector3d& p, const PointDistances& distances,
                         const PointDistances::Near& near, int number) const {
  const VertexTriangleDistance& closest = near.closest;
  if (closest.feature == TriangleFeature::Face && std::abs(number) == 1) {
    const auto& [i, j, k] = m_geometry.mesh.topology.triangles[near.element];
    const Positions& now = m_geometry.mesh.now;
    // Of a closed surface the number falls by 1 where a face is left through its front.
    if ((windingNormal(now[i], now[j], now[k]).dot(closest.normal) < 0) == (number > 0))
      return true;
  }
  const Vector3d q = p - closest.difference;
  if (!(aside(q) > 0x1p-900)) return true;  // nothing can be told so near to the smallest double
  std::vector<std::uint32_t> elements;
  distances.within(near.distance + kExitSlack / kOuterAside * aside(q), elements);
  return holdsPoint(q, p, Candidates(m_geometry, elements, p));
}

/// Whether some point beside q is outside. Tried are those in front of the triangles at q, and of
/// pairs of them, and the one beyond q.
bool OuterSurface::holdsPoint(const Vector3d& q, const Vector3d& from,
                              const Candidates& candidates) const {
  const double step = aside(q), touch = kExitSlack / kOuterAside * step;
  const auto isOutside = [&](const Vector3d& direction) {
    const double length = stableLength(direction);
    return length > 0.0 && m_windingNumber(q + step / length * direction) == 0;
  };
  if (isOutside(q - from)) return true;
  std::vector<Vector3d> normals;
  for (const Candidates::Triangle& triangle : candidates.triangles) {
    const auto& [a, b, c] = triangle.corners;
    if (triangle.box.squaredExteriorDistance(q) > touch * touch) continue;
    if (finiteVertexTriangleDistance(q, a, b, c).distance > touch) continue;
    const auto isKnown = [&](const Vector3d& normal) {
      return (normal - triangle.normal).squaredNorm() < 0x1p-40;
    };
    if (std::none_of(normals.begin(), normals.end(), isKnown)) normals.push_back(triangle.normal);
  }
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& normal : normals) sum += normal;
  // A body that is inside out has its outside behind its faces.
  for (const double side : {1.0, -1.0}) {
    if (isOutside(side * sum)) return true;
    for (std::size_t i = 0; i < normals.size(); ++i) {
      if (isOutside(side * normals[i])) return true;
      for (std::size_t j = 0; j < i; ++j)
        if (isOutside(side * (normals[i] + normals[j]))) return true;
    }
  }
  return false;
}

std::optional<OuterSurface::Near> OuterSurface::nearest(const Vector3d& p, double nearest) const {
  const PointDistances distances(m_geometry, p, m_bruteForce);
  std::vector<std::uint32_t> elements;
  const std::size_t all = m_geometry.tree.ordered().size();
  for (double radius = 2.0 * nearest;; radius *= 2.0) {
    distances.within(radius, elements);
    const Candidates candidates(m_geometry, elements, p);
    const Vector3d* rejected = nullptr;
    for (const Candidates::Point& point : candidates.points) {
      if (point.distance > radius && elements.size() < all) break;
      if (rejected && *rejected == point.point) continue;
      if (holdsPoint(point.point, p, candidates)) return Near{point.element, point.point};
      rejected = &point.point;
    }
    if (elements.size() == all || !(radius < kLargestMeasure)) return {};
  }
}

}  // namespace palpate
