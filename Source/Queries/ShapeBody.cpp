#include "Queries/ShapeBody.h"

#include "Shapes/Polytope.h"
#include "Math/StableLength.h"
#include "Core/Threads.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>
#include <vector>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// A mesh that is not in a table.
struct Surface {
  std::vector<Vector3d> positions;
  std::vector<Triangle> triangles;

  void assign(const Polytope& hull) {
    positions = hull.points();
    triangles.clear();
    for (std::uint32_t face = 0; face < hull.faceCount(); ++face)
      triangles.push_back(hull.corners(face));
  }
};

/// Unit vectors around the sphere: the points of a grid on an octahedron.
std::vector<Vector3d> directionsOfSphere() {
  constexpr int kSteps = 8;
  std::vector<Vector3d> directions;
  for (int x = -kSteps; x <= kSteps; ++x)
    for (int y = -(kSteps - std::abs(x)); y <= kSteps - std::abs(x); ++y) {
      const int z = kSteps - std::abs(x) - std::abs(y);
      directions.push_back(Vector3d(x, y, z).normalized());
      if (z > 0) directions.push_back(Vector3d(x, y, -z).normalized());
    }
  return directions;
}

/// Unit vectors around an axis, by bisection of four.
std::vector<Vector3d> directionsAround(const Vector3d& u, const Vector3d& v) {
  std::vector<Vector3d> directions{u, v, -u, -v};
  for (int round = 0; round < 3; ++round) {
    std::vector<Vector3d> finer;
    for (std::size_t i = 0; i < directions.size(); ++i) {
      const Vector3d& next = directions[(i + 1) % directions.size()];
      finer.insert(finer.end(), {directions[i], (directions[i] + next).normalized()});
    }
    directions = std::move(finer);
  }
  return directions;
}

/// The least distance of the faces of a hull of unit vectors from the origin.
double innerRadius(const Polytope& hull) {
  double least = 1.0;
  for (std::uint32_t face = 0; face < hull.faceCount(); ++face)
    least = std::min(least, hull.normal(face).dot(hull.points()[hull.corners(face)[0]]));
  return least;
}

constexpr double kRoundingOutward = 1.0 + 0x1p-40;

void encloseCapsule(const Shape& shape, Surface& out) {
  const std::vector<Vector3d> directions = directionsOfSphere();
  const double radius = kRoundingOutward * shape.radius() / innerRadius(Polytope(directions));
  std::vector<Vector3d> points;
  for (const Vector3d& end : shape.corners())
    for (const Vector3d& direction : directions) points.push_back(end + radius * direction);
  out.assign(Polytope(points));
}

void encloseCylinder(const Shape& shape, Surface& out) {
  const std::vector<Vector3d> directions =
      directionsAround(shape.axes().col(0), shape.axes().col(1));
  const double inner = 0.5 * (directions[0] + directions[1]).norm(),
               radius = kRoundingOutward * shape.radius() / inner;
  std::vector<Vector3d> points;
  for (const Vector3d& end : shape.corners())
    for (const Vector3d& direction : directions) points.push_back(end + radius * direction);
  out.assign(Polytope(points));
}

/// Returns false for a shape without volume.
bool enclose(const Shape& shape, Surface& out) {
  if (shape.isCylinder()) {
    if (!(shape.radius() > 0)) return false;
    encloseCylinder(shape, out);
  } else if (!shape.faces().empty() && !(shape.radius() > 0)) {
    out.positions.assign(shape.corners().begin(), shape.corners().end());
    out.triangles.assign(shape.faces().begin(), shape.faces().end());
  } else {
    if (!(shape.radius() > 0)) return false;
    encloseCapsule(shape, out);
  }
  return spanOf(out.positions).size() == 4;
}

}  // namespace

std::unique_ptr<Body> meshAround(GeometryId id, const Shape& shape, double scale,
                                 const OctreeSettings& settings) {
  Surface surface;
  if (!enclose(shape, surface)) return nullptr;
  auto geometry = std::make_unique<Body>(id);
  geometry->mesh.topology = MeshTopology(surface.positions.size(), surface.triangles);
  geometry->mesh.now = geometry->mesh.before = Positions(surface.positions);
  geometry->revisions.elements.topology = geometry->revisions.counter.next();
  GeometryOctree& tree = geometry->tree;
  tree.sampleFrame(geometry->mesh, geometry->revisions.elements.topology);
  tree.update(geometry->mesh, geometry->revisions.elements.topology, scale, settings, Threads(1));
  return geometry;
}

}  // namespace palpate
