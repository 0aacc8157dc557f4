#include "Contact/Filters.h"

#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The angle between unit vectors, in [0, pi]. Does not use the standard library's functions,
/// because their results differ between processors.
double angleBetween(const Vector3d& u, const Vector3d& v) {
  const double y = (u - v).norm(), x = (u + v).norm();
  double t = y / (x + std::sqrt(x * x + y * y));  // the tangent of a quarter of the angle
  for (int i = 0; i < 3; ++i) t /= 1.0 + std::sqrt(1.0 + t * t);
  double series = 0.0;
  for (int k = 13; k > 0; k -= 2) series = 1.0 / k - t * t * series;
  return 32.0 * t * series;
}

/// The surface around a feature at a time of the step.
class Surface {
 public:
  Surface(const TriangleMesh& mesh, double time) : m_mesh(mesh), m_time(time) {}

  /// Whether a direction from a feature points below the surface. At a vertex it does if it is
  /// below the mean of the normals, weighted by the triangles' angles. At a convex edge it does if
  /// it is below all of the edge's triangles, at any other edge if it is below one of them.
  ///
  /// Source   Bærentzen and Aanæs, Signed distance computation using the angle weighted pseudonormal,
  ///          IEEE TVCG 11 (2005). Difference: an edge is tested by its two planes. This is exact
  ///          even where the direction is not that of a closest point.
  bool isBelow(const MeshFeature& feature, const Vector3d& direction) const {
    switch (feature.kind) {
      case MeshFeature::Kind::Vertex: {
        Vector3d sum = Vector3d::Zero();
        for (const std::uint32_t t : m_mesh.topology.vertexTriangles[feature.id])
          if (const Vector3d normal = normalOf(t); !normal.isZero(0.0))
            sum += angleAt(t, feature.id) * normal;
        return direction.dot(sum) < 0.0;
      }
      case MeshFeature::Kind::Edge:
        return isBelowEdge(feature.id, direction);
      case MeshFeature::Kind::Face:
        return direction.dot(normalOf(feature.id)) < 0.0;
    }
    return false;
  }
  bool isBeyondBorder(const MeshFeature& closest, const Vector3d& way) const {
    const auto around = holdersOf(m_mesh.topology, closest);
    return isOnBorder(m_mesh.topology, closest) &&
           std::none_of(around.begin(), around.end(), [&](std::uint32_t t) {
             return way.cross(normalOf(t)).norm() <= kTouchAngle;
           });
  }

 private:
  Vector3d at(std::uint32_t vertex) const {
    return (1.0 - m_time) * m_mesh.before[vertex] + m_time * m_mesh.now[vertex];
  }
  /// A unit vector; zero for a triangle without area, which has no sides.
  Vector3d normalOf(std::uint32_t triangle) const {
    const auto& [i, j, k] = m_mesh.topology.elements[triangle];
    const Vector3d a = at(i);
    return (at(j) - a).stableNormalized().cross((at(k) - a).stableNormalized()).stableNormalized();
  }
  double angleAt(std::uint32_t triangle, std::uint32_t vertex) const {
    Triangle corners = m_mesh.topology.elements[triangle];
    PALPATE_ASSERT(std::find(corners.begin(), corners.end(), vertex) != corners.end());
    while (corners[0] != vertex) corners = {corners[1], corners[2], corners[0]};
    const Vector3d p = at(vertex);
    return angleBetween((at(corners[1]) - p).stableNormalized(),
                        (at(corners[2]) - p).stableNormalized());
  }
  /// Triangles without area do not count.
  bool isBelowEdge(std::uint32_t edge, const Vector3d& direction) const {
    std::array<std::uint32_t, 2> triangles{};
    std::size_t count = 0, below = 0;
    for (const std::uint32_t t : m_mesh.topology.edgeTriangles[edge]) {
      const Vector3d normal = normalOf(t);
      if (normal.isZero(0.0)) continue;
      if (count < 2) triangles[count] = t;
      ++count;
      below += direction.dot(normal) < 0.0;
    }
    const bool isConvex = count != 2 || isSecondBelowFirst(edge, triangles);
    return isConvex ? count > 0 && below == count : below > 0;
  }
  /// For the two triangles with area at an edge.
  bool isSecondBelowFirst(std::uint32_t edge, const std::array<std::uint32_t, 2>& triangles) const {
    const Segment& ends = m_mesh.topology.edges[edge];
    const Triangle& corners = m_mesh.topology.elements[triangles[1]];
    const auto across = std::find_if(corners.begin(), corners.end(), [&](auto corner) {
      return corner != ends[0] && corner != ends[1];
    });
    PALPATE_ASSERT(across != corners.end());
    return (at(*across) - at(ends[0])).dot(normalOf(triangles[0])) < 0.0;
  }

  const TriangleMesh& m_mesh;
  double m_time;
};

}  // namespace

bool rejectsVertex(const MeshPair& pair, std::uint32_t vertex, std::uint32_t triangle,
                   bool swapped) {
  const TriangleMesh& mesh = swapped ? pair.a : pair.b;
  if (!pair.keepsApart && areNearAtRest(pair, std::array{vertex}, mesh.topology.elements[triangle]))
    return true;
  if (!pair.predicate) return false;
  using Kind = ContactFeatures::Kind;
  const std::array<std::uint32_t, 2> v{vertex, vertex}, t{triangle, triangle};
  const bool triangleFirst = swapped && !pair.self();
  const std::uint32_t tagOfVertex = (swapped ? pair.b : pair.a).tagOfVertex(vertex),
                      tagOfTriangle = mesh.tag(triangle);
  const StopScope ofPredicate(nullptr);
  return !(*pair.predicate)(
      triangleFirst ? ContactFeatures{Kind::TriangleVertex, t, v, tagOfTriangle, tagOfVertex}
                    : ContactFeatures{Kind::VertexTriangle, v, t, tagOfVertex, tagOfTriangle});
}

bool rejectsEdges(const MeshPair& pair, std::uint32_t edgeA, std::uint32_t edgeB) {
  const Segment &p = pair.a.topology.edges[edgeA], &q = pair.b.topology.edges[edgeB];
  if (!pair.keepsApart && areNearAtRest(pair, p, q)) return true;
  if (!pair.predicate) return false;
  const StopScope ofPredicate(nullptr);
  return !(*pair.predicate)(
      {ContactFeatures::Kind::EdgeEdge, p, q, pair.a.tagOfEdge(p), pair.b.tagOfEdge(q)});
}

bool liesBelow(const TriangleMesh& mesh, const MeshFeature& feature, const Vector3d& direction,
               double time) {
  return Surface(mesh, time).isBelow(feature, direction);
}

bool isBeyondBorder(const TriangleMesh& mesh, const MeshFeature& closest, const Vector3d& way,
                    double time) {
  return Surface(mesh, time).isBeyondBorder(closest, way);
}

bool pointsInward(const MeshPair& pair, const std::array<MeshFeature, 2>& features,
                  const Vector3d& direction, double time) {
  PALPATE_ASSERT(!direction.isZero(0.0) && time >= 0.0 && time <= 1.0);
  return (pair.a.outerSideOnly && Surface(pair.a, time).isBelow(features[0], -direction)) ||
         (pair.b.outerSideOnly && Surface(pair.b, time).isBelow(features[1], direction));
}

std::optional<NearbyEdges> measureEdges(const MeshPair& pair, std::uint32_t edgeA,
                                        std::uint32_t edgeB, double* gap) {
  const Segment &p = pair.a.topology.edges[edgeA], &q = pair.b.topology.edges[edgeB];
  if (pair.excludesEdges(edgeA, edgeB) || areNearAtRest(pair, p, q)) return {};
  const EdgeEdgeDistance centres = finiteEdgeEdgeDistance(pair.a.now[p[0]], pair.a.now[p[1]],
                                                          pair.b.now[q[0]], pair.b.now[q[1]]);
  if (gap) *gap = centres.distance - pair.largestRadii(p, q);
  const double radii = pair.a.radius(p, centres.weightA) + pair.b.radius(q, centres.weightB);
  const double distance = centres.distance - radii;
  if (!(distance <= pair.settings.thickness) || rejectsEdges(pair, edgeA, edgeB)) return {};
  return NearbyEdges{centres,
                     distance,
                     {featureOf(pair.a.topology, edgeA, centres.featureA),
                      featureOf(pair.b.topology, edgeB, centres.featureB)}};
}

}  // namespace palpate
