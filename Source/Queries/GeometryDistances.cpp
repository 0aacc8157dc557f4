#include "Queries/GeometryDistances.h"

#include "Queries/ElementDistance.h"
#include "Queries/NearestPair.h"
#include "Queries/PairTraversal.h"
#include "Queries/PointDistances.h"
#include "Bodies/OctreeFrame.h"
#include "Math/ClosestPoint.h"
#include "Math/ConvexMinimum.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <memory>

namespace palpate {

using Eigen::Vector3d;

namespace {

SurfacePoint noPoint(GeometryId id) {
  return {id, kNoElement, {}, Vector3d::Zero(), Vector3d::Zero(), kInfinity};
}

std::array<float, 3> toFloats(const Vector3d& direction) {
  return {static_cast<float>(direction[0]), static_cast<float>(direction[1]),
          static_cast<float>(direction[2])};
}

/// Bounds the error of heights in a geometry's floats, and of their offset. Positions and direction
/// are off by 2^-24 along each axis, and there are four more roundings.
double heightsErrorOf(const Body& geometry, const OctreeFrame& frame) {
  const FloatBox root = geometry.tree.octree().box(0);
  if (root.mayBeClamped()) return kInfinity;
  return 2.0 * kFloatPointError * root.reach() + OutwardRounding::kAbsolute +
         kNearestError * frame.scale() * frame.magnitude();
}

/// Visits the elements of a geometry, nearest boxes first. bound(centre, half): a lower bound of
/// what test(element) would find in the box with this centre and these half extents, in L, in the
/// world. test returns the least distance that was found so far.
template <class Bound, class Test>
void descend(const Body& geometry, bool bruteForce, double best, Bound&& bound, Test&& test) {
  const Octree& octree = geometry.tree.octree();
  if (bruteForce) {
    geometry.mesh.topology.forEachElement(test);
    return;
  }
  octree.requireBuilt();
  const OctreeFrame frame(geometry);
  const Vector3d& origin = frame.origin();
  const BoxMap map = frame.toWorld();
  const auto boundOf = [&](const FloatBox& stored) {
    const auto box = frame.lengthsOf(map(stored));
    if (!box) return -kInfinity;
    const Vector3d half = 0.5 * box->sizes(), middle = box->center(), centre = middle + origin;
    return bound(centre, half) - kNearestError * (half.sum() + middle.cwiseAbs().sum()) -
           kShapeBoundError * (centre.cwiseAbs().sum() + origin.cwiseAbs().sum());
  };
  for (NearestWalk<double> walk(octree, -kInfinity); walk.next(best);) {
    for (std::uint32_t i = walk.begin(); i < walk.end(); ++i)
      if (!(boundOf(octree.boxes()[i]) > best)) best = test(octree.order()[i]);
    walk.forEachChild([&](OctreeNode child) {
      const double least = boundOf(octree.box(child));
      if (!(least > best)) walk.enter(child, least);
    });
  }
}

/// The centre of the ball of a tapered segment that is nearest to a shape.
NearestToShape nearestBallTo(const Shape& shape, const Element& segment) {
  const auto at = [&](double t) {
    return shape.signedDistance((1.0 - t) * segment[0] + t * segment[1]);
  };
  const double start = segment.radius(std::size_t{0}),
               change = segment.radius(std::size_t{1}) - start;
  const Vector3d along = segment[1] - segment[0];
  const Tangent least = leastTangent([&](double t) -> Tangent {
    const PointShapeDistance centre = at(t);
    return {t, centre.distance - (start + t * change), centre.normal.dot(along) - change};
  });
  const PointShapeDistance nearest = at(least.at);
  return {edgeWeights(0, least.at), nearest.normal, nearest.distance, false};
}

}  // namespace

GeometryDistance distanceBetween(const Body& a, const Body& b, bool bruteForce,
                                 std::unique_ptr<PairScratch>& scratch) {
  const std::size_t sizeA = a.tree.ordered().size(), sizeB = b.tree.ordered().size();
  if (sizeA == 0 || sizeB == 0) return {noPoint(a.id), noPoint(b.id), kInfinity};
  NearestPair nearest(a, b);
  if (bruteForce) {
    for (std::uint32_t i = 0; i < sizeA; ++i)
      for (std::uint32_t j = 0; j < sizeB; ++j) nearest.test(i, j);
    return nearest.result();
  }
  nearest.testLikely();
  const OctreeFrame frameA(a), frameB(b);
  const Vector3d offset = frameB.origin() - frameA.origin();
  // The error covers that of computed distances. If positions are clamped to the floats' range, it
  // is so large that no pair of boxes is skipped.
  const double radii = a.mesh.largestRadius + b.mesh.largestRadius, scale = frameA.scale(),
               error = boxErrorOf(a, b),
               heightsError = heightsErrorOf(a, frameA) + heightsErrorOf(b, frameB);
  const auto boundOf = [&] {
    const double distance = (nearest.distance() + radii) * scale * (1.0 + 4 * kOrthonormal) + error;
    PairBound bound{OutwardRounding::up(distance)};
    const Vector3d& direction = nearest.direction();
    // Without radii, the direction between two points that meet is no more than rounding.
    if (direction == Vector3d::Zero() || nearest.distance() + radii == 0.0) return bound;
    bound.heights = OutwardRounding::up(distance - direction.dot(offset) * scale + heightsError);
    bound.alongA = toFloats(frameA.turned(-direction));
    bound.alongB = toFloats(frameB.turned(direction));
    return bound;
  };
  if (!scratch) scratch = std::make_unique<PairScratch>();
  forNearElements(PairSide(a), PairSide(b, mapBetween(a, b)), boundOf(), *scratch,
                  [&](const NearElements& elements) {
                    nearest.test(elements);
                    return boundOf();
                  });
  return nearest.result();
}

GeometryDistance distanceBetween(const Body& geometry, GeometryId id, const Shape& shape,
                                 bool bruteForce) {
  if (geometry.tree.ordered().empty()) return {noPoint(geometry.id), noPoint(id), kInfinity};
  std::uint32_t best = kNoElement;
  NearestToShape nearest{Vector3d::Zero(), Vector3d::Zero(), kInfinity, false};
  descend(
      geometry, bruteForce, kInfinity,
      [&](const Vector3d& centre, const Vector3d& half) {
        const PointShapeDistance at = shape.signedDistance(centre);
        return std::max(0.0, at.distance - at.normal.cwiseAbs().dot(half) -
                                 geometry.mesh.largestRadius -
                                 kShapeBoundError * shape.magnitude());
      },
      [&](std::uint32_t element) {
        const Element corners(geometry.mesh, geometry.mesh.topology.elements[element]);
        const auto take = [&](const NearestToShape& found, const Vector3d& weights) {
          const double distance = std::max(0.0, found.distance - corners.radius(weights));
          if (!(distance < nearest.distance || (distance == nearest.distance && element < best)))
            return;
          best = element;
          nearest = found;
          nearest.weights = weights;
          nearest.distance = distance;
        };
        for (std::size_t i = 0; i < 3; ++i) {
          if (!corners.hasEdge(i)) continue;
          const NearestToShape found = corners.isTapered()
                                           ? nearestBallTo(shape, corners)
                                           : shape.nearestOfEdge(corners[i], corners[i + 1]);
          take(found, edgeWeights(i, found.weights[1]));
        }
        if (corners.isPoint()) {
          const PointShapeDistance at = shape.signedDistance(corners[0]);
          take({Vector3d::UnitX(), at.normal, at.distance, false}, cornerWeights(0));
        }
        if (geometry.mesh.topology.hasFaces())
          if (const auto found = shape.nearestInTriangle(corners[0], corners[1], corners[2]))
            take(*found, found->weights);
        return nearest.distance;
      });
  PALPATE_ASSERT(best != kNoElement);
  GeometryDistance out{surfacePointOf(geometry, best, nearest.weights, nearest.distance),
                       noPoint(id), nearest.distance};
  out.b.distance = nearest.distance;
  // The witness of a common point is the element's point, which the shape holds.
  const PointShapeDistance at = shape.signedDistance(out.a.position);
  out.b.position =
      at.distance > 0.0 ? Vector3d(out.a.position - at.distance * at.normal) : out.a.position;
  return out;
}

namespace {

/// A common point of two shapes that overlap: each in turn moves the point to its own nearest one.
Vector3d commonPoint(const Shape& a, const Shape& b, Vector3d point) {
  constexpr int kMostSteps = 1000;  // usually one
  const double tolerance = kOnSurface * (a.magnitude() + b.magnitude());
  bool isCommon = false;
  for (int step = 0; step < kMostSteps && !isCommon; ++step) {
    isCommon = true;
    for (const Shape* shape : {&a, &b}) {
      const PointShapeDistance at = shape->signedDistance(point);
      if (!(at.distance > tolerance)) continue;
      point -= at.distance * at.normal;
      isCommon = false;
    }
  }
  return point;
}

}  // namespace

GeometryDistance distanceBetween(GeometryId idA, const Shape& a, GeometryId idB, const Shape& b,
                                 ShapePairScratch& scratch) {
  PALPATE_ASSERT(!a.isPlane() || !b.isPlane());
  const ShapePairDistance found = a.distanceFrom(b, scratch);
  GeometryDistance out{noPoint(idA), noPoint(idB), std::max(0.0, found.distance)};
  out.a.distance = out.b.distance = out.distance;
  out.a.position = found.pointA;
  out.b.position = found.pointB;
  if (found.distance <= 0.0) out.a.position = out.b.position = commonPoint(a, b, found.pointA);
  return out;
}

SegmentDistance distanceFromSegment(const Body& geometry, const Vector3d& p, const Vector3d& q,
                                    double maxDistance, bool bruteForce) {
  PALPATE_ASSERT(maxDistance >= 0.0);
  ElementDistance best;
  best.distance = maxDistance;
  std::uint32_t nearest = kNoElement;
  const Element segment(p, q);
  const double radius = geometry.mesh.largestRadius;
  const auto test = [&](std::uint32_t element) {
    const Element other(geometry.mesh, geometry.mesh.topology.elements[element]);
    if (!bruteForce && areFurtherApart(segment, other, best.distance + radius))
      return best.distance;
    const ElementDistance found = elementDistance(segment, other);
    if (found.distance < best.distance || (found.distance == best.distance && element < nearest)) {
      best = found;
      nearest = element;
    }
    return best.distance;
  };
  // Elements that are likely near: each nearest to the segment's point that is nearest to the one
  // before.
  constexpr int kRounds = 4;
  Vector3d point = segment.point({0.5, 0.5, 0.0});
  for (int round = 0; !bruteForce && maxDistance == kInfinity && round < kRounds; ++round) {
    const auto near = PointDistances(geometry, point, false).nearest(kInfinity, 0);
    if (!near || near->element == nearest) break;
    test(near->element);
    point = segment.point(best.weightsA);
  }
  // The height of the box over a plane in front of the segment: across the shortest way to the
  // box's centre, or, after rounding, almost so.
  const Vector3d along = q - p;
  const double square = along.squaredNorm();
  descend(
      geometry, bruteForce, best.distance,
      [&](const Vector3d& centre, const Vector3d& half) {
        const Vector3d fromP = centre - p, fromQ = centre - q;
        const double t = fromP.dot(along) / square;
        const Vector3d up =
            stableUnit(t > 0.0 ? (t < 1.0 ? Vector3d(fromP - t * along) : fromQ) : fromP);
        return std::min(up.dot(fromP), up.dot(fromQ)) - up.cwiseAbs().dot(half) - radius -
               kNearestError * (fromP.cwiseAbs().sum() + fromQ.cwiseAbs().sum());
      },
      test);
  if (nearest == kNoElement) return {0.0, noPoint(geometry.id)};
  return {best.weightsA[1] + best.weightsA[2],
          surfacePointOf(geometry, nearest, best.weightsB, best.distance)};
}

}  // namespace palpate
