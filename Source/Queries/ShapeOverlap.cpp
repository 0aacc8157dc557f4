#include "Queries/ShapeOverlap.h"

#include "Queries/ElementsNearShape.h"
#include "Queries/OverlapSearch.h"
#include "Queries/PointDistances.h"
#include "Shapes/Shape.h"
#include "Mesh/Corners.h"
#include "Math/ConvexMinimum.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Math/TriangleIntersection.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

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

/// Whether the hull of the balls at a segment's ends has a point in the shape. The hull is the
/// union of the balls along the segment, with radii in proportion. A ball meets a shape if its
/// centre's distance is at most its radius. This distance less the radius is convex along the
/// segment, so that its tangents bound it from below.
bool meetsTapered(const Shape& shape, const std::array<Vector3d, 2>& ends,
                  const std::array<double, 2>& radii) {
  const Vector3d along = ends[1] - ends[0];
  const double taper = radii[1] - radii[0];
  const auto tangent = [&](double t) {
    const PointShapeDistance centre = shape.signedDistance((1.0 - t) * ends[0] + t * ends[1]);
    return Tangent{t, centre.distance - ((1.0 - t) * radii[0] + t * radii[1]),
                   centre.normal.dot(along) - taper};
  };
  Tangent low = tangent(0.0), high = tangent(1.0);
  if (low.value <= 0.0 || high.value <= 0.0) return true;
  while (low.slope < 0.0 && high.slope > 0.0 && high.at - low.at > kEdgeWeight) {
    const double crossing = (high(0.0) - low(0.0)) / (low.slope - high.slope);
    if (low(crossing) > 0.0) return false;
    const Tangent middle = tangent(0.5 * (low.at + high.at));
    if (middle.value <= 0.0) return true;
    (middle.slope < 0.0 ? low : high) = middle;
  }
  return false;
}

/// Whether an element has a point in the shape. Radii of lines and points enlarge it.
bool meets(const TriangleMesh& mesh, const Triangle& corners, const Shape& shape) {
  const auto at = [&](std::size_t i) { return mesh.now[corners[i % 3]]; };
  if (shape.hasCorners() && shape.faces().size() > 1 && mesh.largestRadius == 0.0)
    return meetsHull({at(0), at(1), at(2)}, shape);
  if (corners[0] == corners[1] && corners[1] == corners[2])
    return shape.signedDistance(at(0)).distance <= mesh.radius(corners[0]);
  for (std::size_t i = 0; i < 3; ++i) {
    if (corners[i] == corners[(i + 1) % 3]) continue;  // {p, q, q} is a segment
    const double first = mesh.radius(corners[i]), last = mesh.radius(corners[(i + 1) % 3]);
    if (first != last) return meetsTapered(shape, {at(i), at(i + 1)}, {first, last});
    if (shape.nearestOfEdge(at(i), at(i + 1)).distance <= first) return true;
  }
  if (corners[1] == corners[2]) return false;
  const auto inside = shape.nearestInTriangle(at(0), at(1), at(2));
  return inside && inside->distance <= 0.0;
}

/// A convex shape in the world: all points within `radius` of the segment pq, or, if there are
/// slabs, all points x with least <= normal . (x - p) <= most for every slab.
struct Convex {
  struct Slab {
    Vector3d normal;
    double least, most;
    bool isTwoSided = false;  ///< otherwise the other slabs and `most` alone bound the shape
  };
  Vector3d p, q;
  double radius = 0;
  std::array<Slab, FloatConvex::kMaxSlabs> slabs;
  std::size_t slabCount = 0;
  double magnitude = 0;  ///< L: about the largest distance of its points from p
};

Convex convexOf(const Box& box, const Pose& pose) {
  Convex convex;
  convex.p = convex.q = pose(box.centre);
  const Eigen::Matrix3d axes = orthonormal(pose.rotation);
  for (int k = 0; k < 3; ++k)
    convex.slabs[convex.slabCount++] = {axes.col(k), -box.halfExtents[k], box.halfExtents[k], true};
  convex.magnitude = box.halfExtents.sum();
  return convex;
}

/// None for a hull with many or narrow faces, or without a volume.
std::optional<Convex> convexOf(const Shape& hull) {
  constexpr double kNarrow = 1e-3, kParallel = 0x1p-46;
  const auto corners = hull.corners();
  if (!hull.hasCorners() || hull.faces().size() < 4 || hull.faces().size() > FloatConvex::kMaxSlabs)
    return {};
  Convex convex;
  convex.p = convex.q = corners[0];
  for (const Vector3d& corner : corners)
    convex.magnitude = std::max(convex.magnitude, stableLength(corner - convex.p));
  for (const auto& [a, b, c] : hull.faces()) {
    const Vector3d u = corners[b] - corners[a], v = corners[c] - corners[a];
    const Vector3d normal = u.cross(v);
    const double longest = std::max({u.squaredNorm(), v.squaredNorm(), (v - u).squaredNorm()});
    if (!(normal.norm() > kNarrow * longest)) return {};
    const Vector3d unit = normal.normalized();
    double most = -std::numeric_limits<double>::infinity(), least = -most;
    for (const Vector3d& corner : corners) {
      most = std::max(most, unit.dot(corner - convex.p));
      least = std::min(least, unit.dot(corner - convex.p));
    }
    if (!(most - least > kNarrow * convex.magnitude)) return {};
    // Coplanar and opposite faces share a slab.
    const auto slabs = std::span(convex.slabs).first(convex.slabCount);
    const auto shared = std::find_if(slabs.begin(), slabs.end(), [&](const Convex::Slab& slab) {
      return slab.normal.cross(unit).squaredNorm() <= kParallel * kParallel;
    });
    if (shared == slabs.end())
      convex.slabs[convex.slabCount++] = {unit, least, most, false};
    else if (shared->normal.dot(unit) < 0)
      shared->isTwoSided = true;
  }
  return convex;
}

/// Whether a triangle has a point in a shape with slabs; none if rounding leaves it open.
std::optional<bool> meetsSlabs(const Convex& convex, const std::array<Vector3d, 3>& corners) {
  using Polygon = std::array<Vector3d, 3 + FloatConvex::kMaxSlabs>;
  std::array<Vector3d, 3> from;
  double size = convex.magnitude;
  for (std::size_t i = 0; i < 3; ++i) {
    from[i] = corners[i] - convex.p;
    size = std::max(size, from[i].cwiseAbs().maxCoeff());
  }
  const double margin = kClipError * (size + kClipOrigin * convex.p.cwiseAbs().maxCoeff());
  // Clips by the planes moved outward by the margin. The corners of what remains are off by less.
  const auto remains = [&](double outward) {
    Polygon polygon, next;
    std::copy(from.begin(), from.end(), polygon.begin());
    std::size_t count = 3;
    const auto clip = [&](const Vector3d& normal, double offset) {
      std::array<double, 3 + FloatConvex::kMaxSlabs> heights;
      bool cuts = false;
      for (std::size_t k = 0; k < count; ++k) {
        heights[k] = normal.dot(polygon[k]) - (offset + outward);
        cuts |= heights[k] > 0;
      }
      if (!cuts) return;
      std::size_t kept = 0;
      for (std::size_t k = 0; k < count; ++k) {
        const std::size_t l = k + 1 == count ? 0 : k + 1;
        if (heights[k] <= 0) next[kept++] = polygon[k];
        if (kept < next.size() && (heights[k] <= 0) != (heights[l] <= 0))
          next[kept++] =
              polygon[k] + heights[k] / (heights[k] - heights[l]) * (polygon[l] - polygon[k]);
      }
      std::copy(next.begin(), next.begin() + static_cast<std::ptrdiff_t>(kept), polygon.begin());
      count = kept;
    };
    for (std::size_t i = 0; i < convex.slabCount && count > 0; ++i) {
      const auto& [normal, least, most, isTwoSided] = convex.slabs[i];
      clip(normal, most);
      if (isTwoSided) clip(-normal, -least);
    }
    return count > 0;
  };
  if (remains(-margin)) return true;
  if (!remains(margin)) return false;
  return {};
}

/// The shape in the floats of a geometry's octree; none beyond float's range.
std::optional<FloatConvex> floatsOf(const Convex& convex, const Body& geometry) {
  const OctreeFrame frame(geometry);
  const Vector3d p = frame.toFrame(convex.p), q = frame.toFrame(convex.q);
  const double scale = frame.scale(),
               radius = (convex.radius + geometry.mesh.largestRadius) * scale,
               sizes = p.cwiseAbs().sum() + q.cwiseAbs().sum() + radius + convex.magnitude * scale,
               extent = std::max(sizes, double{geometry.tree.octree().box(0).reach()});
  // A rotation within kOrthonormal changes heights and distances in the frame by less than 2^-27 of
  // the extent, which kFloatOverlapError covers.
  const double slack = kFloatOverlapError * extent + 2.0 * frame.error();
  if (!(extent < kLargestFloat)) return {};
  FloatConvex floats;
  floats.slack = static_cast<float>(slack) + OutwardRounding::kAbsolute;
  floats.radius = static_cast<float>(radius);
  const Vector3d along = q - p;
  for (int k = 0; k < 3; ++k) {
    floats.start[k] = static_cast<float>(p[k]);
    floats.along[k] = static_cast<float>(along[k]);
  }
  const double square = along.squaredNorm();
  floats.inverseSquare = square > 0x1p-100 ? static_cast<float>(1.0 / square) : 0.0f;
  if (!(square > 0x1p-100)) floats.slack += 0x1p-50f;  // the segment counts as its first point
  floats.slabCount = convex.slabCount;
  for (std::size_t i = 0; i < convex.slabCount; ++i) {
    const auto& [normal, least, most, isTwoSided] = convex.slabs[i];
    const Vector3d n = frame.turned(normal);
    for (int k = 0; k < 3; ++k) floats.slabs[i].normal[k] = static_cast<float>(n[k]);
    floats.slabs[i].middle = static_cast<float>(0.5 * (least + most) * scale + n.dot(p));
    floats.slabs[i].halfWidth = static_cast<float>(0.5 * (most - least) * scale);
  }
  return floats;
}

/// None for a shape that is not round and has no planes of its own.
std::optional<Convex> convexOf(const AnalyticalGeometry& analytical, const Pose& pose) {
  Convex convex;
  if (const auto* box = std::get_if<Box>(&analytical)) return convexOf(*box, pose);
  if (const auto* sphere = std::get_if<Sphere>(&analytical)) {
    convex.p = convex.q = pose(sphere->centre);
    convex.radius = sphere->radius;
    return convex;
  }
  if (const auto* capsule = std::get_if<Capsule>(&analytical)) {
    convex.p = pose(capsule->p0);
    convex.q = pose(capsule->p1);
    convex.radius = capsule->radius;
    return convex;
  }
  return {};
}

}  // namespace

void findWithin(const Body& geometry, const Vector3d& point, double distance, bool bruteForce,
                Buffer<std::uint32_t>& near, std::vector<std::uint32_t>& out) {
  const PointDistances distances(geometry, point, bruteForce);
  Convex ball;
  ball.p = ball.q = point;
  ball.radius = distance;
  const auto floats =
      bruteForce || !geometry.mesh.radii.empty() ? std::nullopt : floatsOf(ball, geometry);
  if (!floats) return distances.within(distance, out);
  near.clear();
  searchOverlapping({geometry.tree.octree(), geometry.tree.floats().now(),
                     geometry.tree.ordered().data(), *floats},
                    out, near);
  for (const std::uint32_t place : near)
    if (const auto at = distances.at(place); distances.isWithin(at, distance))
      out.push_back(at.element);
}

void findOverlapping(const Body& geometry, const AnalyticalGeometry& analytical, const Pose& pose,
                     bool bruteForce, KeptShapes& kept, Buffer<std::uint32_t>& near,
                     std::vector<std::uint32_t>& out) {
  const TriangleMesh& mesh = geometry.mesh;
  const Shape* shape = nullptr;  // placed where needed, because a hull is costly
  const auto build = [&] {
    if (!shape) shape = &placeAtRest(analytical, pose, kept).now;
  };
  const auto test = [&](std::uint32_t element) {
    build();
    if (meets(mesh, mesh.topology.elements[element], *shape)) out.push_back(element);
  };
  std::optional<Convex> convex;
  if (std::holds_alternative<ConvexHull>(analytical)) {
    build();
    convex = convexOf(*shape);
  } else {
    convex = convexOf(analytical, pose);
  }
  if (convex && convex->slabCount == 0 && convex->p == convex->q)
    return findWithin(geometry, convex->p, convex->radius, bruteForce, near, out);
  near.clear();
  const bool hasRadii =
      convex && convex->slabCount > 0 ? mesh.largestRadius > 0 : !mesh.radii.empty();
  const auto floats =
      convex && !hasRadii && !bruteForce ? floatsOf(*convex, geometry) : std::nullopt;
  if (!floats) {
    build();
    if (shape->hasCorners() && shape->faces().size() == 1 &&
        shape->corners().front() == shape->corners().back())  // a point
      return findWithin(geometry, shape->origin(), shape->radius(), bruteForce, near, out);
    if (bruteForce) {
      mesh.topology.forEachElement(test);
      return;
    }
    findElementsNear(geometry, *shape, *shape, mesh.largestRadius, near);
    for (const std::uint32_t element : near) test(element);
    return;
  }
  const auto& ordered = geometry.tree.ordered();
  searchOverlapping({geometry.tree.octree(), geometry.tree.floats().now(), ordered.data(), *floats},
                    out, near);
  for (const std::uint32_t place : near) {
    const std::uint32_t element = geometry.tree.octree().order()[place];
    const auto decided = convex->slabCount > 0
                             ? meetsSlabs(*convex, cornersOf(ordered[place], mesh.now))
                             : std::nullopt;
    if (!decided)
      test(element);
    else if (*decided)
      out.push_back(element);
  }
}

}  // namespace palpate
