#include "Queries/ShapePenetration.h"

#include "Queries/BodyOverlap.h"
#include "Queries/GeometryDistances.h"
#include "Queries/HullSeparation.h"
#include "Queries/ShapeBody.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

SurfacePoint pointOfShape(GeometryId id, const Vector3d& position, double distance) {
  return {id, kNoElement, {}, Vector3d::Zero(), position, distance};
}

/// The same bodies in the other order.
Penetration exchanged(Penetration p) {
  p.direction = -p.direction;
  std::swap(p.a, p.b);
  return p;
}

Penetration ofShapes(const Body& a, const Body& b, ShapePairScratch& scratch) {
  const Shape &first = a.shape->now, &second = b.shape->now;
  const ShapePairDistance found = first.distanceFrom(second, scratch);
  const double finite = std::min(first.isPlane() ? kInfinity : first.magnitude(),
                                 second.isPlane() ? kInfinity : second.magnitude()),
               slack = kExitSlack * (std::isfinite(finite) ? finite : 0.0);
  if (!(found.distance < -slack)) return apart(a.id, b.id);
  const double depth = slack - found.distance;
  return {true,
          found.normal,
          depth,
          pointOfShape(a.id, found.pointA, depth),
          pointOfShape(b.id, found.pointB, depth),
          true};
}

SurfacePoint vertexOf(const Body& mesh, const BodyVertices& vertices, std::uint32_t vertex,
                      double depth) {
  const std::uint32_t element = vertices.triangleOf[vertex];
  const Triangle& corners = mesh.mesh.topology.elements[element];
  Vector3d weights = Vector3d::Zero();
  for (int i = 0; i < 3; ++i)
    if (corners[static_cast<std::size_t>(i)] == vertex) weights = Vector3d::Unit(i);
  return {mesh.id, element, corners, weights, vertices.positions[vertex], depth};
}

/// A mesh leaves a half-space along its normal.
Penetration ofPlane(const Body& mesh, const Body& plane, BodyVertices& vertices) {
  vertices.assign(mesh);
  const Shape& shape = plane.shape->now;
  const Vector3d normal = shape.axes().col(2);
  double lowest = kInfinity;
  std::uint32_t vertex = 0;
  for (std::uint32_t v = 0; v < vertices.positions.size(); ++v) {
    const double height = normal.dot(vertices.positions[v] - shape.origin());
    if (vertices.triangleOf[v] == kNoElement || !(height < lowest)) continue;
    lowest = height;
    vertex = v;
  }
  const double slack = kExitSlack * std::max(shape.magnitude(), vertices.magnitude());
  if (!(lowest < -slack)) return apart(mesh.id, plane.id);
  const double depth = slack - lowest;
  return {true,
          normal,
          depth,
          vertexOf(mesh, vertices, vertex, depth),
          pointOfShape(plane.id, vertices.positions[vertex] + depth * normal, depth),
          true};
}

/// A mesh that moves, and a round shape.
class MeshAndRoundShape {
 public:
  MeshAndRoundShape(const Body& mesh, const Body& shape, bool bruteForce)
      : m_mesh(mesh), m_id(shape.id), m_shape(shape.shape->now), m_bruteForce(bruteForce) {}

  /// Goes back from where they are apart, to where they touch.
  Penetration retreat(const Vector3d& direction, double depth, double magnitude) const {
    constexpr int kMostSteps = 256;
    const double slack = kExitSlack * magnitude;
    Penetration out = apart(m_mesh.id, m_id);
    double end = depth;  // where they are apart
    for (int step = 0; step < kMostSteps && depth > slack; ++step) {
      const GeometryDistance between = distanceAt(depth * direction);
      if (!(between.distance > 0)) break;
      end = depth;
      out = {true, direction, depth, between.a, between.b, false};
      out.a.distance = out.b.distance = depth;
      if (between.distance <= 2 * slack) return out;
      depth -= between.distance - slack;
    }
    return depth > slack && end > slack ? out : apart(m_mesh.id, m_id);
  }

 private:
  /// The shape moves back instead of the mesh.
  GeometryDistance distanceAt(const Vector3d& shift) const {
    Shape moved = m_shape;
    moved.translate(-shift);
    GeometryDistance found = distanceBetween(m_mesh, m_id, moved, m_bruteForce);
    found.b.position += shift;
    return found;
  }

  const Body& m_mesh;
  const GeometryId m_id;
  const Shape& m_shape;
  const bool m_bruteForce;
};

/// A mesh that moves, and a shape that `around` encloses.
Penetration ofMesh(const Body& mesh, const Body& geometry, const Body& around, Engine engine,
                   PenetrationScratch& scratch) {
  Penetration found = penetrationOf(mesh, around, engine, scratch);
  if (!found.intersecting) return apart(mesh.id, geometry.id);
  found.b = pointOfShape(geometry.id, found.b.position, found.depth);
  const Shape& shape = geometry.shape->now;
  if (!(shape.radius() > 0)) return found;
  const BodyPair pair(mesh, around, engine, scratch.pair);
  const MeshAndRoundShape round(mesh, geometry, engine == Engine::BruteForce);
  if (!isConvex(pair, true)) return round.retreat(found.direction, found.depth, pair.magnitude());
  const double unit = unitOf(pair.magnitude());
  const HullSeparation hulls = separateHulls(
      [&](const Vector3d& d) { return Vector3d(unit * pair.vertices(true).furthest(d)); },
      [&](const Vector3d& d) { return Vector3d(unit * (shape.support(d, 0.0) + shape.origin())); },
      kExitSlack, scratch.difference);
  const double radius = shape.isCylinder() ? 0.0 : shape.radius(),
               depth = hulls.depth / unit + radius + kExitSlack * pair.magnitude();
  Penetration out = round.retreat(hulls.direction, depth, pair.magnitude());
  out.minimal = !out.intersecting || hulls.gap <= kMinimalSlack;
  return out;
}

}  // namespace

Penetration shapePenetration(const Body& a, const Body& b, Engine engine,
                             const OctreeSettings& settings, PenetrationScratch& scratch,
                             ShapePairScratch& pairScratch) {
  PALPATE_ASSERT(a.shape || b.shape);
  PALPATE_ASSERT(!(a.shape && b.shape && a.shape->now.isPlane() && b.shape->now.isPlane()));
  if (a.shape && b.shape) return ofShapes(a, b, pairScratch);
  if (a.shape) return exchanged(shapePenetration(b, a, engine, settings, scratch, pairScratch));
  if (a.mesh.topology.count() == 0) return apart(a.id, b.id);
  if (b.shape->now.isPlane()) return ofPlane(a, b, scratch.pair.a);
  const auto around = meshAround(b.id, b.shape->now, a.tree.frame().scale, settings);
  return around ? ofMesh(a, b, *around, engine, scratch) : apart(a.id, b.id);
}

}  // namespace palpate
