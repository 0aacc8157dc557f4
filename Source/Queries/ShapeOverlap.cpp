#include "Queries/ShapeOverlap.h"

#include "Queries/ElementsNearShape.h"
#include "Queries/PointDistances.h"
#include "Math/TriangleIntersection.h"

#include <algorithm>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Whether an element without radius has a point in a hull or a box, decided exactly on its placed
/// corners.
bool meetsHull(const Corners& element, const Shape& hull) {
  SignCounts counts;
  bool isInside = true;  // the first corner
  for (const auto& [i, j, k] : hull.faces()) {
    const Corners face{hull.corners()[i], hull.corners()[j], hull.corners()[k]};
    if (intersectTriangles(face, element, counts).intersect()) return true;
    isInside = isInside && OrientedPlane(face[0], face[1], face[2]).side(element[0], counts) < 0;
  }
  return isInside;
}

/// Whether an element has a point in the shape. Radii of lines and points enlarge it.
bool meets(const TriangleMesh& mesh, const Triangle& corners, const Shape& shape) {
  const auto at = [&](std::size_t i) { return mesh.now[corners[i % 3]]; };
  if (shape.hasCorners() && shape.faces().size() > 1 && mesh.largestRadius == 0.0)
    return meetsHull({at(0), at(1), at(2)}, shape);
  if (corners[0] == corners[1])
    return shape.signedDistance(at(0)).distance <= mesh.radius(corners[0]);
  for (std::size_t i = 0; i < 3; ++i) {
    if (corners[i] == corners[(i + 1) % 3]) continue;  // {p, q, q} is a segment
    const NearestToShape edge = shape.nearestOfEdge(at(i), at(i + 1));
    const Segment ends{corners[i], corners[(i + 1) % 3]};
    if (edge.distance <= mesh.radius(ends, edge.weights[1])) return true;
  }
  if (corners[1] == corners[2]) return false;
  const auto inside = shape.nearestInTriangle(at(0), at(1), at(2));
  return inside && inside->distance <= 0.0;
}

}  // namespace

void findOverlapping(const SearchableGeometry& geometry, const Shape& shape, bool bruteForce,
                     PointQueryStack& stack, Buffer<std::uint32_t>& near,
                     std::vector<std::uint32_t>& out) {
  if (shape.hasCorners() && shape.faces().size() == 1 &&
      shape.corners().front() == shape.corners().back())  // a ball
    return PointDistances(geometry, shape.origin(), bruteForce).within(shape.radius(), out);
  const TriangleMesh& mesh = geometry.mesh;
  const auto test = [&](std::uint32_t element) {
    if (meets(mesh, mesh.topology.triangles[element], shape)) out.push_back(element);
  };
  if (bruteForce) {
    for (std::uint32_t i = 0; i < mesh.topology.triangles.size(); ++i) test(i);
    return;
  }
  findElementsNear(geometry, shape, shape, mesh.largestRadius, stack, near);
  for (const std::uint32_t element : near) test(element);
}

}  // namespace palpate
