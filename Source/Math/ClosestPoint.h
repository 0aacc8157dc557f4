#pragma once

#include <palpate/FeaturePairs.h>

#include <optional>

namespace palpate {

// The public functions of <palpate/FeaturePairs.h> without their check for NaN and infinity, and
// the decisions that they use. Every decision is exact for the given doubles.

VertexTriangleDistance finiteVertexTriangleDistance(const Eigen::Vector3d& p,
                                                    const Eigen::Vector3d& a,
                                                    const Eigen::Vector3d& b,
                                                    const Eigen::Vector3d& c);
EdgeEdgeDistance finiteEdgeEdgeDistance(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1,
                                        const Eigen::Vector3d& q0, const Eigen::Vector3d& q1);

/// The same as edgeEdgeDistance() if the edges are not parallel and both closest points lie
/// strictly inside, else none.
std::optional<EdgeEdgeDistance> crossingEdgesDistance(const Eigen::Vector3d& p0,
                                                      const Eigen::Vector3d& p1,
                                                      const Eigen::Vector3d& q0,
                                                      const Eigen::Vector3d& q1);

/// The normals that the distance functions return at a distance of zero: for edges that touch, and
/// for a triangle and its corner a.
Eigen::Vector3d normalOfCrossing(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1,
                                 const Eigen::Vector3d& q0, const Eigen::Vector3d& q1);
Eigen::Vector3d windingNormal(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                              const Eigen::Vector3d& c);

/// The feature of triangle (a, b, c) that holds the point closest to p.
TriangleFeature closestTriangleFeature(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                       const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Whether the triangle's area is not zero.
bool hasArea(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Whether moving from a towards b comes nearer to p: (p - a) . (b - a) > 0.
bool comesNearer(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// Whether p's projection onto the plane of (a, b, c) lies on c's side of edge ab, and not on it.
bool liesInwards(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                 const Eigen::Vector3d& c);

inline bool areFinite(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                      const Eigen::Vector3d& d) {
  const Eigen::Vector3d zeros = 0.0 * a + 0.0 * b + 0.0 * c + 0.0 * d;  // NaN where not finite
  return zeros == Eigen::Vector3d::Zero();
}

}  // namespace palpate
