#include "Shapes/ShapeFreeMotion.h"

#include "Math/Tolerances.h"
#include "Core/AtomicLeast.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace palpate {

namespace {

using Eigen::Vector3d;

class ShapeMotionFinder {
 public:
  ShapeMotionFinder(const TriangleMesh& mesh, const Shape& shape, const FreeMotionRange& range,
                    std::span<double> ofVertices, double& ofShape)
      : m_mesh(mesh),
        m_shape(shape),
        m_range(range),
        m_ofVertices(ofVertices),
        m_ofShape(ofShape) {}

  /// An element, its edges and its vertices. As a whole it is bounded by its least distance, also
  /// where that is a vertex's: another vertex may move its interior.
  void bound(std::uint32_t element) const {
    const auto& [a, b, c] = m_mesh.topology.elements[element];
    double least = boundVertex(a);
    if (a != b) {
      least = std::min({least, boundVertex(b), boundEdge(a, b)});
      if (b != c) {
        least = std::min({least, boundVertex(c), boundEdge(b, c), boundEdge(c, a)});
        const std::optional<NearestToShape> inside =
            m_shape.nearestInTriangle(m_mesh.now[a], m_mesh.now[b], m_mesh.now[c]);
        if (inside) least = std::min(least, inside->distance);
        boundAll(std::array{a, b, c}, least, m_mesh.largestRadius, false);
      }
    }
  }

 private:
  double boundVertex(std::uint32_t v) const {
    const double distance = m_shape.signedDistance(m_mesh.now[v]).distance;
    boundAll(std::array{v}, distance, m_mesh.radius(v), true);
    return distance;
  }
  double boundEdge(std::uint32_t p, std::uint32_t q) const {
    const NearestToShape nearest = m_shape.nearestOfEdge(m_mesh.now[p], m_mesh.now[q]);
    boundAll(std::array{p, q}, nearest.distance, m_mesh.radius({p, q, q}, nearest.weights), false);
    return nearest.distance;
  }

  /// radius: at the nearest point. passesThrough: whether a feature inside the shape could leave it
  /// on another side.
  template <class Vertices>
  void boundAll(const Vertices& vertices, double distance, double radius,
                bool passesThrough) const {
    double largestRadius = 0.0, largest = m_shape.magnitude() + m_range.thickness();
    for (const std::uint32_t v : vertices) {
      largestRadius = std::max(largestRadius, m_mesh.radius(v));
      largest = std::max(largest, m_mesh.now[v].cwiseAbs().maxCoeff());
    }
    largest += largestRadius;
    const GapSize size{largest, 2.0 * largest};
    const double error = kShapeBoundError * 4.0 * largest;
    double free = m_range.freeGap(distance - largestRadius - error, size);
    if (m_range.isContact(distance - radius)) {
      if (distance < 0.0 && !passesThrough) return;
      free = FreeMotionRange::gapOfContact(std::abs(distance) - error, size);
    }
    for (const std::uint32_t v : vertices) lower(m_ofVertices[v], 0.5 * free);
    lower(m_ofShape, 0.5 * free);
  }

  const TriangleMesh& m_mesh;
  const Shape& m_shape;
  const FreeMotionRange& m_range;
  const std::span<double> m_ofVertices;
  double& m_ofShape;
};

}  // namespace

void findFreeMotion(const TriangleMesh& mesh, const Shape& shape, const FreeMotionRange& range,
                    std::span<const std::uint32_t> elements, std::span<double> ofVertices,
                    double& ofShape) {
  const ShapeMotionFinder finder(mesh, shape, range, ofVertices, ofShape);
  for (const std::uint32_t element : elements)
    if (mesh.topology.isEnabled(element)) finder.bound(element);
}

void findFreeMotion(const Shape& a, const Shape& b, const FreeMotionRange& range,
                    ShapePairScratch& scratch, double& ofA, double& ofB) {
  const double distance = a.distanceFrom(b, scratch).distance;
  const double largest = a.magnitude() + b.magnitude() + range.thickness();
  const GapSize size{largest, 2.0 * largest};
  const double error = kShapeBoundError * 4.0 * largest;
  double free = range.freeGap(distance - error, size);
  if (range.isContact(distance)) {
    if (distance < 0.0) return;
    free = FreeMotionRange::gapOfContact(distance - error, size);
  }
  lower(ofA, 0.5 * free);
  lower(ofB, 0.5 * free);
}

}  // namespace palpate
