#pragma once

#include <palpate/SpatialQueries.h>

#include "Bodies/Body.h"
#include "Mesh/TriangleMesh.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace palpate {

/// A triangle, segment or point, whose positions are read once.
class Element {
 public:
  Element() = default;
  Element(const TriangleMesh& mesh, const Triangle& vertices)
      : m_mesh(&mesh), m_vertices(vertices) {
    for (std::size_t i = 0; i < 3; ++i) m_corners[i] = mesh.now[vertices[i]];
  }
  /// A segment without a radius.
  Element(const Eigen::Vector3d& p, const Eigen::Vector3d& q)
      : m_vertices{0, 1, 1}, m_corners{p, q, q} {}

  const Eigen::Vector3d& operator[](std::size_t i) const { return m_corners[i % 3]; }
  Eigen::Vector3d point(const Eigen::Vector3d& weights) const {
    return weights[0] * m_corners[0] + weights[1] * m_corners[1] + weights[2] * m_corners[2];
  }
  /// The corner that is furthest along a direction.
  const Eigen::Vector3d& furthest(const Eigen::Vector3d& direction) const {
    // Relative to the first corner, as the element may be far from the origin.
    const double heights[] = {0.0, direction.dot(m_corners[1] - m_corners[0]),
                              direction.dot(m_corners[2] - m_corners[0])};
    const std::size_t last = heights[2] > heights[1] ? 2 : 1;
    return m_corners[heights[last] > heights[0] ? last : 0];
  }
  double radius(const Eigen::Vector3d& weights) const {
    return m_mesh ? m_mesh->radius(m_vertices, weights) : 0.0;
  }
  double radius(std::size_t corner) const {
    return m_mesh ? m_mesh->radius(m_vertices[corner]) : 0.0;
  }
  bool isTapered() const { return radius(std::size_t{0}) != radius(std::size_t{1}); }
  bool isPoint() const { return m_vertices[0] == m_vertices[1] && m_vertices[1] == m_vertices[2]; }
  /// Whether corner i repeats an earlier one, and edge i an earlier edge.
  bool repeatsCorner(std::size_t i) const {
    return (i > 0 && m_vertices[i] == m_vertices[0]) || (i > 1 && m_vertices[2] == m_vertices[1]);
  }
  bool hasEdge(std::size_t i) const {
    return m_vertices[i] != m_vertices[(i + 1) % 3] &&
           !(i == 2 && m_vertices[1] == m_vertices[2]);  // {p, q, q} has one edge
  }

 private:
  const TriangleMesh* m_mesh = nullptr;
  Triangle m_vertices{};
  std::array<Eigen::Vector3d, 3> m_corners;
};

/// The point of an element with these weights. distance: L.
SurfacePoint surfacePointOf(const Body&, std::uint32_t element, const Eigen::Vector3d& weights,
                            double distance);
Eigen::Vector3d cornerWeights(std::size_t corner);
Eigen::Vector3d edgeWeights(std::size_t edge, double weight);  ///< weight: of the edge's end

/// The closest points of two elements.
struct ElementDistance {
  double distance = std::numeric_limits<double>::infinity();  ///< L, less the radii; never negative
  Eigen::Vector3d weightsA = Eigen::Vector3d::UnitX(), weightsB = Eigen::Vector3d::UnitX();
};

/// The least distance of two elements. A segment whose radii differ is the hull of the balls at its
/// ends; its point is the centre of the nearest ball. Whether the distance is 0 without radii is
/// decided exactly. Exchanged elements have the same distance.
ElementDistance elementDistance(const Element& a, const Element& b);
/// Whether a plane between two elements without their radii shows that they are further apart than
/// `distance`.
bool areFurtherApart(const Element& a, const Element& b, double distance);

}  // namespace palpate
