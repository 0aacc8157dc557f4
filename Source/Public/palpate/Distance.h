#pragma once

#include <palpate/Export.h>

#include <Eigen/Core>

#include <cstdint>

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
///
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
///
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

}  // namespace palpate
