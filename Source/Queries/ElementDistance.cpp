#include "Queries/ElementDistance.h"

#include <palpate/Intersection.h>

#include "Math/ClosestPoint.h"
#include "Math/RayTriangle.h"
#include "Math/StableLength.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

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
      take(found.distance, cornerWeights(i), found.barycentric);
    }
    if (!b.repeatsCorner(i)) {
      const auto found = finiteVertexTriangleDistance(b[i], a[0], a[1], a[2]);
      take(found.distance, found.barycentric, cornerWeights(i));
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
      found.weightsB = foot.barycentric;
      if (exchanged) std::swap(found.weightsA, found.weightsB);
    }
  };
  follow(a, b, false);
  follow(b, a, true);
}

}  // namespace

ElementDistance elementDistance(const Element& a, const Element& b) {
  ElementDistance found = featureDistance(a, b);
  if (boxesMeet(a, b) && trianglesIntersect(a[0], a[1], a[2], b[0], b[1], b[2])) {
    found.distance = 0.0;
    moveToCrossing(a, b, found);
  }
  return found;
}

}  // namespace palpate
