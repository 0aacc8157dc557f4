#pragma once

#include <palpate/Export.h>

#include <Eigen/Core>

#include <cstdint>
#include <optional>

namespace palpate {

// No function throws, and the caller's floating-point environment changes no result.

/// What holds a point. Corner i has the value i, the edge from it to the next corner 3 + i.
enum class TriangleFeature : std::uint8_t {
  CornerA,
  CornerB,
  CornerC,
  EdgeAB,
  EdgeBC,
  EdgeCA,
  Face
};
PALPATE_EXPORT const char* toString(TriangleFeature) noexcept;  ///< its name, or "unknown"

enum class EdgeFeature : std::uint8_t { Start, End, Interior };
PALPATE_EXPORT const char* toString(EdgeFeature) noexcept;  ///< its name, or "unknown"

struct VertexTriangleDistance {
  Eigen::Vector3d weights;     ///< Weights of the closest point: at least 0, sum exactly 1.
  Eigen::Vector3d difference;  ///< L: from the closest point to the vertex.
  Eigen::Vector3d normal;      ///< Unit, along the difference.
  double distance;             ///< L; infinity if it exceeds the largest double.
  TriangleFeature feature;     ///< The feature that holds the closest point.
  bool exact;                  ///< Whether exact arithmetic was necessary.
};

/// The point of triangle (a, b, c) that is closest to p, and the distance.
/// Shapes   one position each, any winding, all finite doubles. L in and out; weights 1.
/// Returns  all within 8 ulp of the largest coordinate difference of the positions, the normal
///          within that divided by the distance; the feature exactly. At distance 0 the normal is
///          the winding normal, or without area the axis of least extent, x before y before z. A
///          triangle without area is its longest edge or corner. NaN or infinity gives NaN.
/// Laws     (1) permuting corners, mirroring an axis and scaling by powers of two, where exact,
///          give the same bits. If corners are mirror images, weights may differ by 2^-53.
///          (2) if an edge or corner holds the point, all triangles with it give the same bits.
/// Source   Gram-determinant signs certified by error bounds, else by integers; one compensated
///          Newton step in the feature's own coordinates. See Docs/Accuracy.md.
PALPATE_EXPORT VertexTriangleDistance vertexTriangleDistance(const Eigen::Vector3d& p,
                                                             const Eigen::Vector3d& a,
                                                             const Eigen::Vector3d& b,
                                                             const Eigen::Vector3d& c);

struct EdgeEdgeDistance {
  double weightA, weightB;     ///< Closest points: p0 + weightA (p1 - p0), q0 + weightB (q1 - q0).
  Eigen::Vector3d difference;  ///< L: from the point on edge q to the point on edge p.
  Eigen::Vector3d normal;      ///< Unit, along the difference.
  double distance;             ///< L; infinity if it exceeds the largest double.
  EdgeFeature featureA, featureB;  ///< The features that hold the closest points.
  bool parallel;  ///< Whether the edges are exactly parallel, or an edge has no length.
  bool exact;     ///< Whether exact arithmetic was necessary.
};

/// The closest points of edges (p0, p1) and (q0, q1), and their distance.
/// Shapes   one position each, all finite doubles. NaN or infinity gives NaN.
/// Returns  with the accuracy of vertexTriangleDistance(). At distance 0 the normal is the cross
///          product of p1 - p0 and q1 - q0. For parallel edges it is then the axis of least extent,
///          x before y before z, reversed if edge q comes before p in lexicographic order. Parallel
///          edges side by side have their closest points in the middle of the shared stretch.
/// Laws     (1) swapping an edge's ends turns its weight w into 1 - w, and reverses the normal at
///          distance 0 of edges that are not parallel; all else has the same bits.
///          (2) swapping different edges swaps the weights and reverses difference and normal.
PALPATE_EXPORT EdgeEdgeDistance edgeEdgeDistance(const Eigen::Vector3d& p0,
                                                 const Eigen::Vector3d& p1,
                                                 const Eigen::Vector3d& q0,
                                                 const Eigen::Vector3d& q1);

/// Whether two triangles have a common point, also by touching, decided exactly for finite doubles.
/// A triangle without area is the segment or point that it covers. NaN has no meaning.
/// Cost     bounded: least where floating point decides, most where only exact sums do.
PALPATE_EXPORT bool trianglesIntersect(const Eigen::Vector3d& a0, const Eigen::Vector3d& a1,
                                       const Eigen::Vector3d& a2, const Eigen::Vector3d& b0,
                                       const Eigen::Vector3d& b1, const Eigen::Vector3d& b2);

struct TimeOfImpactSettings {
  /// L, finite: an impact is a distance of at most this; if not positive, a touch, decided exactly.
  double minimumDistance = 0.0;
  /// Fraction of the step, in [2^-50, 1], else the nearer end: how early the result may be.
  double timeTolerance = 1e-6;
};

/// The time at which a moving vertex first touches a moving triangle, which includes its border.
/// Shapes   positions before, then now, of v and of the corners a, b, c. Each moves along p(t) = (1
///          - t) before + t now, in real arithmetic, t in [0, 1]. All finite doubles are valid.
/// Returns  a fraction of the step, at most `timeTolerance` before the first impact and never after
///          it; none without one. Exact with minimumDistance 0, also without area, extent or
///          motion. With d > 0 there may be false positives, at distances up to d + e. Here e =
///          timeTolerance * m + 2^-35 * (c + d), m is the largest relative displacement of vertices
///          of the two features, c their largest coordinate difference.
/// Laws     (1) permuting corners, swapping before and now, and exact scaling by a power of two do
///          not change whether there is an impact.
/// Cost     bounded, most where floating point cannot decide; for d > 0 by 1 / timeTolerance steps.
PALPATE_EXPORT std::optional<double> vertexTriangleTimeOfImpact(
    const Eigen::Vector3d& vBefore, const Eigen::Vector3d& aBefore, const Eigen::Vector3d& bBefore,
    const Eigen::Vector3d& cBefore, const Eigen::Vector3d& vNow, const Eigen::Vector3d& aNow,
    const Eigen::Vector3d& bNow, const Eigen::Vector3d& cNow, const TimeOfImpactSettings& = {});

/// The same for edges p0 p1 and q0 q1 with their ends, also parallel or without length.
/// Laws     (2) swapping edges, or ends of an edge, does not change whether there is an impact.
PALPATE_EXPORT std::optional<double> edgeEdgeTimeOfImpact(
    const Eigen::Vector3d& p0Before, const Eigen::Vector3d& p1Before,
    const Eigen::Vector3d& q0Before, const Eigen::Vector3d& q1Before, const Eigen::Vector3d& p0Now,
    const Eigen::Vector3d& p1Now, const Eigen::Vector3d& q0Now, const Eigen::Vector3d& q1Now,
    const TimeOfImpactSettings& = {});

}  // namespace palpate
