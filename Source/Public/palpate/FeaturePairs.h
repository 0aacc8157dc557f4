#pragma once

#include <palpate/Export.h>

#include <Eigen/Core>

#include <cstdint>
#include <optional>

namespace palpate {

/// The part of a triangle that holds a point. Corner i has the value i. The edge from corner i to
/// corner i + 1 mod 3 has the value 3 + i.
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

/// The part of an edge that holds a point.
enum class EdgeFeature : std::uint8_t { Start, End, Interior };
PALPATE_EXPORT const char* toString(EdgeFeature) noexcept;  ///< its name, or "unknown"

/// The result of vertexTriangleDistance().
struct VertexTriangleDistance {
  Eigen::Vector3d weights;     ///< Weights of the closest point: at least 0, sum exactly 1.
  Eigen::Vector3d difference;  ///< L: from the closest point to the vertex.
  Eigen::Vector3d normal;      ///< Unit, along the difference.
  double distance;             ///< L; infinity if it exceeds the largest double.
  TriangleFeature feature;     ///< The feature that holds the closest point.
  bool exact;                  ///< Whether exact arithmetic was necessary.
};

/// The point of triangle (a, b, c) that is closest to a vertex p, and the distance.
/// Shapes   p, a, b, c: one position each. Any winding, all finite doubles.
/// Units    in: L. Out: weights 1, distance and difference L.
/// Returns  distance, difference and closest point within 8 ulp of the largest coordinate
///          difference among the four positions; the normal within that divided by the distance;
///          the feature as exact arithmetic decides it. At distance 0 the normal is the triangle's
///          winding normal. For a triangle without area it is the coordinate axis along which the
///          triangle extends least, x before y before z.
/// Laws     (1) permuting the corners, mirroring an axis and scaling by powers of two give the same
///          bits, permuted, mirrored or scaled. There are two conditions. If corners are mirror
///          images of each other, weights may differ by 2^-53. Scaling must neither lose bits of
///          positions and results nor make differences exceed the largest double.
///          (2) if an edge or corner holds the point, every triangle that shares it gives the same
///          bits.
/// Errors   none. For a triangle without area the result is that of its longest edge, for one
///          without length that of its corner. NaN or infinity in gives NaN out.
/// Floating point  the caller's rounding mode, traps and treatment of denormals change no result.
/// Source   Gram-determinant signs certified by error bounds, else by integers; one compensated
///          Newton step in the feature's own coordinates. See Docs/Accuracy.md.
PALPATE_EXPORT VertexTriangleDistance vertexTriangleDistance(const Eigen::Vector3d& p,
                                                             const Eigen::Vector3d& a,
                                                             const Eigen::Vector3d& b,
                                                             const Eigen::Vector3d& c);

/// The result of edgeEdgeDistance().
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
/// Shapes   one position each, all finite doubles.
/// Returns  with the accuracy of vertexTriangleDistance(). At distance 0 the normal is the cross
///          product of p1 - p0 and q1 - q0. For parallel edges it is then the coordinate axis along
///          which both together extend least, x before y before z, and reversed if the positions of
///          edge q come before those of edge p in lexicographic order. If parallel edges lie side
///          by side, the closest points are in the middle of the stretch that they share.
/// Laws     (1) swapping the ends of an edge turns its weight w into 1 - w; all else has the same
///          bits. At distance 0 it also reverses the normal of edges that are not parallel.
///          (2) swapping the edges swaps the weights and reverses difference and normal, unless
///          both edges have the same two ends.
/// Errors   none. NaN or infinity in gives NaN out.
/// Floating point  as for vertexTriangleDistance().
PALPATE_EXPORT EdgeEdgeDistance edgeEdgeDistance(const Eigen::Vector3d& p0,
                                                 const Eigen::Vector3d& p1,
                                                 const Eigen::Vector3d& q0,
                                                 const Eigen::Vector3d& q1);

/// Whether two triangles have a point in common. Touching counts. Decided exactly for all finite
/// doubles.
/// Shapes   three corners each, any winding. A triangle without area is the segment or the point
///          that it covers.
/// Errors   none. If a position is NaN or infinite, the result has no meaning.
/// Floating point  the caller's rounding mode, traps and treatment of denormals change no result.
/// Cost     bounded: least where floating point decides, most where only exact sums do.
PALPATE_EXPORT bool trianglesIntersect(const Eigen::Vector3d& a0, const Eigen::Vector3d& a1,
                                       const Eigen::Vector3d& a2, const Eigen::Vector3d& b0,
                                       const Eigen::Vector3d& b1, const Eigen::Vector3d& b2);

/// The definition of an impact and the accuracy of its time.
struct TimeOfImpactSettings {
  /// L, finite. An impact is a time at which the distance is at most this. If it is 0 or negative,
  /// an impact is a time at which the features touch. Whether they touch is then decided exactly.
  double minimumDistance = 0.0;
  /// Fraction of the step, in [2^-50, 1]: the result may be this much too early. A value outside
  /// the range counts as the nearer end. A larger value is slightly cheaper.
  double timeTolerance = 1e-6;
};

/// The time at which a moving vertex first touches a moving triangle. The triangle includes its
/// border.
/// Shapes   positions before the step, then now: of the vertex v and of the triangle's corners a,
///          b, c. Each moves along p(t) = (1 - t) before + t now, in real arithmetic, t in [0, 1].
/// Units    in: the length unit L of the positions. Out: a fraction of the step.
/// Needs    finite positions. All finite doubles are valid.
/// Returns  a time at most `timeTolerance` before the first impact and never after it; none if
///          there is no impact. With minimumDistance 0 the decision between impact and none is
///          exact for the given doubles. This includes triangles without area or extent, motion in
///          a plane, no motion, and contact only at time 0 or 1. With a minimum distance d > 0
///          there may be false positives: times at which the distance is at most d + e. Here
///          e = timeTolerance * m + 2^-35 * (c + d), with m the largest displacement of a vertex of
///          one feature relative to a vertex of the other, and c the largest difference of their
///          coordinates.
/// Laws     (1) permuting the corners does not change whether there is an impact, nor does swapping
///          before and now.
///          (2) scaling all positions by a power of two does not either, where it is exact.
/// Errors   none.
/// Floating point  the caller's rounding mode, traps and treatment of denormals change no result.
/// Cost     bounded: least for pairs without an impact, most where floating point cannot decide
///          (Docs/Performance.md). With a minimum distance there are at most 1 / timeTolerance
///          search steps; few unless the features pass each other at nearly that distance.
PALPATE_EXPORT std::optional<double> vertexTriangleTimeOfImpact(
    const Eigen::Vector3d& vBefore, const Eigen::Vector3d& aBefore, const Eigen::Vector3d& bBefore,
    const Eigen::Vector3d& cBefore, const Eigen::Vector3d& vNow, const Eigen::Vector3d& aNow,
    const Eigen::Vector3d& bNow, const Eigen::Vector3d& cNow, const TimeOfImpactSettings& = {});

/// The time at which two moving edges, p0 p1 and q0 q1, first touch. The edges include their ends.
/// They may be parallel, collinear or without length. All else is as in
/// vertexTriangleTimeOfImpact().
/// Laws     (3) swapping the edges, or the ends of either, does not change whether there is an
///          impact.
PALPATE_EXPORT std::optional<double> edgeEdgeTimeOfImpact(
    const Eigen::Vector3d& p0Before, const Eigen::Vector3d& p1Before,
    const Eigen::Vector3d& q0Before, const Eigen::Vector3d& q1Before, const Eigen::Vector3d& p0Now,
    const Eigen::Vector3d& p1Now, const Eigen::Vector3d& q0Now, const Eigen::Vector3d& q1Now,
    const TimeOfImpactSettings& = {});

}  // namespace palpate
