#include "Queries/ElementDistance.h"

#include <palpate/FeaturePairs.h>

#include "Math/ClosestPoint.h"
#include "Math/ConvexMinimum.h"
#include "Math/RayTriangle.h"
#include "Math/RoundSegment.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Exact/Compensated.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

SurfacePoint surfacePointOf(const Body& geometry, std::uint32_t element, const Vector3d& weights,
                            double distance) {
  const Triangle& vertices = geometry.mesh.topology.elements[element];
  Vector3d position = Vector3d::Zero();
  for (int i = 0; i < 3; ++i)
    position += weights[i] * geometry.mesh.now[vertices[static_cast<std::size_t>(i)]];
  return {geometry.id, element, vertices, weights, position, distance};
}

Vector3d cornerWeights(std::size_t corner) {
  return Vector3d::Unit(static_cast<Eigen::Index>(corner));
}

Vector3d edgeWeights(std::size_t edge, double weight) {
  Vector3d weights = Vector3d::Zero();
  weights[static_cast<Eigen::Index>(edge)] = 1.0 - weight;
  weights[static_cast<Eigen::Index>((edge + 1) % 3)] = weight;
  return weights;
}

namespace {

/// The nearest of all pairs of a corner and an element, and of two edges.
ElementDistance featureDistance(const Element& a, const Element& b) {
  ElementDistance best;
  const auto take = [&](double distance, const Vector3d& weightsA, const Vector3d& weightsB) {
    const double least = std::max(0.0, distance - (a.radius(weightsA) + b.radius(weightsB)));
    if (least < best.distance) best = {least, weightsA, weightsB};
  };
  for (std::size_t i = 0; i < 3; ++i) {
    if (!a.repeatsCorner(i)) {
      const auto found = finiteVertexTriangleDistance(a[i], b[0], b[1], b[2]);
      take(found.distance, cornerWeights(i), found.weights);
    }
    if (!b.repeatsCorner(i)) {
      const auto found = finiteVertexTriangleDistance(b[i], a[0], a[1], a[2]);
      take(found.distance, found.weights, cornerWeights(i));
    }
  }
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3 && a.hasEdge(i); ++j) {
      if (!b.hasEdge(j)) continue;
      const auto found = finiteEdgeEdgeDistance(a[i], a[i + 1], b[j], b[j + 1]);
      take(found.distance, edgeWeights(i, found.weightA), edgeWeights(j, found.weightB));
    }
  return best;
}

/// The nearest of all pairs of a ball of a tapered segment and a point of another element. The gap
/// between a ball and an element is convex along the segment.
ElementDistance taperedDistance(const Element& tapered, const Element& other) {
  double size = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    size = std::max({size, tapered[i].cwiseAbs().maxCoeff(), other[i].cwiseAbs().maxCoeff(),
                     tapered.radius(i), other.radius(i)});
  // From the segment's start, so that differences of positions are rounded, not positions.
  const double scale = scaleTowardsOne(size);
  const auto place = [&](const Vector3d& p) -> Vector3d { return scale * p - scale * tapered[0]; };
  const Vector3d along = place(tapered[1]), a = place(other[0]), b = place(other[1]),
                 c = place(other[2]);
  const double start = scale * tapered.radius(std::size_t{0}),
               change = scale * tapered.radius(std::size_t{1}) - start;
  Vector3d weights;  // on the other element, of the last gap
  const auto gapAt = [&](double t) -> Tangent {
    const Vector3d centre = t * along;
    if (other.isTapered()) {
      const double at = nearestBall(centre, a, b, scale * other.radius(std::size_t{0}),
                                    scale * other.radius(std::size_t{1}));
      weights = edgeWeights(0, at);
    } else {
      weights = finiteVertexTriangleDistance(centre, a, b, c).weights;
    }
    const Vector3d difference =
        (weights[0] * (centre - a) + weights[1] * (centre - b)) + weights[2] * (centre - c);
    const double length = stableLength(difference);
    return {t, length - scale * other.radius(weights) - (start + t * change),
            (length > 0.0 ? difference.dot(along) / length : 0.0) - change};
  };
  const Tangent nearest = leastTangent(gapAt);
  const double gap = gapAt(nearest.at).value;
  return {std::max(0.0, gap / scale), edgeWeights(0, nearest.at), weights};
}

/// The nearest points where one of the elements is tapered.
ElementDistance taperedPair(const Element& a, const Element& b) {
  // Of two tapered segments, that with the lower coordinates is followed.
  const auto precedes = [&] {
    for (const std::size_t i : {0u, 1u})
      for (int k = 0; k < 3; ++k)
        if (a[i][k] != b[i][k]) return a[i][k] < b[i][k];
    return a.radius(std::size_t{0}) <= b.radius(std::size_t{0});
  };
  if (a.isTapered() && (!b.isTapered() || precedes())) return taperedDistance(a, b);
  ElementDistance found = taperedDistance(b, a);
  std::swap(found.weightsA, found.weightsB);
  return found;
}

bool boxesMeet(const Element& a, const Element& b) {
  for (int k = 0; k < 3; ++k)
    if (std::min({a[0][k], a[1][k], a[2][k]}) > std::max({b[0][k], b[1][k], b[2][k]}) ||
        std::min({b[0][k], b[1][k], b[2][k]}) > std::max({a[0][k], a[1][k], a[2][k]}))
      return false;
  return true;
}

/// Moves the points of two elements that meet to where an edge of one crosses the other, if they
/// are nearer to each other there.
void moveToCrossing(const Element& a, const Element& b, ElementDistance& found) {
  double least = stableLength(a.point(found.weightsA) - b.point(found.weightsB));
  const auto follow = [&](const Element& edges, const Element& face, bool exchanged) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d along = edges[i + 1] - edges[i];
      if (!edges.hasEdge(i) || along == Vector3d::Zero() || !along.allFinite()) continue;
      const auto met = intersectRay({edges[i], along, 0.0, 1.0}, face[0], face[1], face[2]);
      if (!met) continue;
      const auto foot =
          finiteVertexTriangleDistance(edges[i] + met->first * along, face[0], face[1], face[2]);
      if (!(foot.distance < least)) continue;
      least = foot.distance;
      found.weightsA = edgeWeights(i, met->first);
      found.weightsB = foot.weights;
      if (exchanged) std::swap(found.weightsA, found.weightsB);
    }
  };
  follow(a, b, false);
  follow(b, a, true);
}

}  // namespace

ElementDistance elementDistance(const Element& a, const Element& b) {
  ElementDistance found =
      a.isTapered() || b.isTapered() ? taperedPair(a, b) : featureDistance(a, b);
  if (boxesMeet(a, b) && trianglesIntersect(a[0], a[1], a[2], b[0], b[1], b[2])) {
    found.distance = 0.0;
    moveToCrossing(a, b, found);
  }
  return found;
}

/// The first plane is across the direction between the corners. Each further one is across a
/// shorter difference of the elements' points.
/// Source   Gilbert, An iterative procedure for computing the minimum of a quadratic form (1966).
bool areFurtherApart(const Element& a, const Element& b, double distance) {
  constexpr int kMostPlanes = 5;
  double size = 0;
  for (std::size_t i = 0; i < 3; ++i)
    size =
        std::max({size, (a[i] - a[0]).cwiseAbs().maxCoeff(), (b[i] - a[0]).cwiseAbs().maxCoeff()});
  const double needed = distance + kNearestError * size;
  Vector3d normal = ((b[0] - a[0]) + (b[1] - a[1])) + (b[2] - a[2]), difference = Vector3d::Zero();
  for (int plane = 0; plane < kMostPlanes; ++plane) {
    const Vector3d nearest = b.furthest(-normal) - a.furthest(normal);
    const double length = normal.norm();
    if (length > kShortestDirection && normal.dot(nearest) > needed * length) return true;
    const Vector3d change = nearest - difference;
    const double square = change.squaredNorm();
    if (plane == 0)
      difference = nearest;
    else if (square > 0)
      difference += std::clamp(-difference.dot(change) / square, 0.0, 1.0) * change;
    normal = difference;
  }
  return false;
}

}  // namespace palpate
