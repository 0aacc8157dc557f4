#include "Queries/GeometryDistances.h"

#include <palpate/Intersection.h>

#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The closest points of two elements.
struct ElementDistance {
  double distance = std::numeric_limits<double>::infinity();  ///< L, less the radii; never negative
  Vector3d weightsA = Vector3d::Zero(), weightsB = Vector3d::Zero();
};

class Elements {
 public:
  Elements(const SearchableGeometry& geometry, std::uint32_t element)
      : m_mesh(geometry.mesh), m_vertices(geometry.mesh.topology.triangles[element]) {
    for (std::size_t i = 0; i < 3; ++i) m_corners[i] = m_mesh.now[m_vertices[i]];
  }

  const Vector3d& operator[](std::size_t i) const { return m_corners[i % 3]; }
  double radius(const Vector3d& weights) const { return m_mesh.radius(m_vertices, weights); }
  /// Whether corner i repeats an earlier one, and edge i an earlier edge.
  bool repeatsCorner(std::size_t i) const {
    return (i > 0 && m_vertices[i] == m_vertices[0]) || (i > 1 && m_vertices[2] == m_vertices[1]);
  }
  bool hasEdge(std::size_t i) const {
    return m_vertices[i] != m_vertices[(i + 1) % 3] &&
           !(i == 2 && m_vertices[1] == m_vertices[2]);  // {p, q, q} has one edge
  }

 private:
  const TriangleMesh& m_mesh;
  Triangle m_vertices;
  std::array<Vector3d, 3> m_corners;
};

Vector3d cornerWeights(std::size_t i) { return Vector3d::Unit(static_cast<Eigen::Index>(i)); }
Vector3d edgeWeights(std::size_t i, double weight) {
  Vector3d weights = Vector3d::Zero();
  weights[static_cast<Eigen::Index>(i)] = 1.0 - weight;
  weights[static_cast<Eigen::Index>((i + 1) % 3)] = weight;
  return weights;
}

/// The nearest of all feature pairs. Features that cross meet in an edge and a face, which no
/// feature pair is near to: then the exact test decides.
ElementDistance elementDistance(const Elements& a, const Elements& b) {
  ElementDistance best;
  const auto take = [&](double distance, const Vector3d& weightsA, const Vector3d& weightsB) {
    const double least = std::max(0.0, distance - a.radius(weightsA) - b.radius(weightsB));
    if (least < best.distance) best = {least, weightsA, weightsB};
  };
  for (std::size_t i = 0; i < 3; ++i) {
    if (!a.repeatsCorner(i)) {
      const auto found = finiteVertexTriangleDistance(a[i], b[0], b[1], b[2]);
      take(found.distance, cornerWeights(i), found.barycentric);
    }
    if (!b.repeatsCorner(i)) {
      const auto found = finiteVertexTriangleDistance(b[i], a[0], a[1], a[2]);
      take(found.distance, found.barycentric, cornerWeights(i));
    }
    for (std::size_t j = 0; j < 3 && a.hasEdge(i); ++j) {
      if (!b.hasEdge(j)) continue;
      const auto found = finiteEdgeEdgeDistance(a[i], a[i + 1], b[j], b[j + 1]);
      take(found.distance, edgeWeights(i, found.weightA), edgeWeights(j, found.weightB));
    }
  }
  return best;
}

/// A common point of two triangles that intersect: where an edge of one crosses the other.
std::optional<ElementDistance> crossing(const Elements& a, const Elements& b) {
  if (!trianglesIntersect(a[0], a[1], a[2], b[0], b[1], b[2])) return {};
  const auto edgeIn = [](const Elements& edges, const Elements& face, ElementDistance& found,
                         bool exchanged) {
    const Vector3d normal = (face[1] - face[0]).cross(face[2] - face[0]);
    for (std::size_t i = 0; i < 3; ++i) {
      if (!trianglesIntersect(edges[i], edges[i + 1], edges[i + 1], face[0], face[1], face[2]))
        continue;
      const double from = normal.dot(edges[i] - face[0]), to = normal.dot(edges[i + 1] - face[0]);
      const double weight = from == to ? 0.5 : std::clamp(from / (from - to), 0.0, 1.0);
      const Vector3d point = edges[i] + weight * (edges[i + 1] - edges[i]);
      const Vector3d onFace =
          finiteVertexTriangleDistance(point, face[0], face[1], face[2]).barycentric;
      found = {0.0, edgeWeights(i, weight), onFace};
      if (exchanged) std::swap(found.weightsA, found.weightsB);
      return true;
    }
    return false;
  };
  ElementDistance found;
  if (edgeIn(a, b, found, false) || edgeIn(b, a, found, true)) return found;
  return {};
}

SurfacePoint surfacePoint(const SearchableGeometry& geometry, std::uint32_t element,
                          const Vector3d& weights, double distance) {
  const Triangle& vertices = geometry.mesh.topology.triangles[element];
  Vector3d position = Vector3d::Zero();
  for (int i = 0; i < 3; ++i)
    position += weights[i] * geometry.mesh.now[vertices[static_cast<std::size_t>(i)]];
  return {geometry.id, element, vertices, weights, position, distance};
}

}  // namespace

}  // namespace palpate
