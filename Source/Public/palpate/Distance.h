#pragma once

#include <palpate/Export.h>

#include <Eigen/Core>

#include <cstdint>

namespace palpate {

/// What holds a point of a triangle. Corner i is i; the edge that joins corners i and i + 1 mod 3
/// is 3 + i.
enum class TriangleFeature : std::uint8_t {
  CornerA,
  CornerB,
  CornerC,
  EdgeAB,
  EdgeBC,
  EdgeCA,
  Face
};

/// What holds a point of an edge.
enum class EdgeFeature : std::uint8_t { Start, End, Interior };

struct VertexTriangleDistance {
  Eigen::Vector3d barycentric;  ///< of the closest point; never negative, sum exactly 1
  Eigen::Vector3d difference;   ///< L, from the closest point to the vertex
  Eigen::Vector3d normal;       ///< unit, along the difference
  double distance;              ///< L; infinity where it is beyond double
  TriangleFeature feature;      ///< that holds the closest point
  bool exact;                   ///< floating point left it to exact arithmetic
};

/// Closest point on triangle (a, b, c) to a vertex.
///
/// Shapes   p, a, b, c: one position each. Any winding, any finite doubles.
/// Returns  distance, difference and closest point within 8 ulp of the largest coordinate
///          difference among the four positions, the normal within that over the distance; the
///          feature as exact arithmetic decides it. At distance zero the normal is the triangle's
///          winding normal; of a triangle without area the coordinate axis along which it extends
///          least, x before y before z.
/// Laws     (1) permuting the corners, mirroring an axis and scaling by powers of two give the same
///          bits, mapped (where corners are mirror images of each other, weights may differ by
///          2^-53); a scale may neither take bits of positions and answers nor bring their
///          differences beyond double.
///          (2) a point held by an edge or corner has the same bits from every triangle that shares
///          it.
/// Errors   none. A triangle without area is answered for its longest edge, one without length for
///          its corner; NaN or infinity in gives NaN out.
/// Source   Gram-determinant signs certified by error bounds, else by integers; one compensated
///          Newton step in the feature's own coordinates. See Docs/Accuracy.md.
PALPATE_EXPORT VertexTriangleDistance vertexTriangleDistance(const Eigen::Vector3d& p,
                                                             const Eigen::Vector3d& a,
                                                             const Eigen::Vector3d& b,
                                                             const Eigen::Vector3d& c);

struct EdgeEdgeDistance {
  double weightA, weightB;     ///< closest points: p0 + weightA (p1 - p0), q0 + weightB (q1 - q0)
  Eigen::Vector3d difference;  ///< L, from the point on edge q to the point on edge p
  Eigen::Vector3d normal;      ///< unit, along the difference
  double distance;             ///< L; infinity where it is beyond double
  EdgeFeature featureA, featureB;
  bool parallel;  ///< exactly, or an edge has no length
  bool exact;     ///< floating point left it to exact arithmetic
};

/// Closest points of edges (p0, p1) and (q0, q1).
///
/// Shapes   one position each, any finite doubles.
/// Returns  as vertexTriangleDistance(). At distance zero the normal is the cross product of p1 -
///          p0 and q1 - q0; of parallel edges the coordinate axis along which both together extend
///          least, x before y before z. Parallel edges side by side are closest in the middle of
///          the stretch they share.
/// Laws     (1) swapping the ends of an edge turns its weight w into 1 - w, same bits otherwise.
///          (2) swapping the edges swaps the weights and turns difference and normal.
/// Errors   none; NaN or infinity in gives NaN out.
PALPATE_EXPORT EdgeEdgeDistance edgeEdgeDistance(const Eigen::Vector3d& p0,
                                                 const Eigen::Vector3d& p1,
                                                 const Eigen::Vector3d& q0,
                                                 const Eigen::Vector3d& q1);

}  // namespace palpate
