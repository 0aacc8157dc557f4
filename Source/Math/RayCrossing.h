#pragma once

#include "Math/ExactClosestPoint.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <cstddef>
#include <cstdint>

namespace palpate {

enum class RayCrossing : std::int8_t {
  Entering = -1,  ///< from the triangle's front (its winding normal's side) to its back
  None = 0,
  Leaving = 1,  ///< from the back to the front
  OnTriangle    ///< the ray starts on it
};

/// Whether a triangle holds a point of its plane, which every point is of a triangle without area.
/// Exact for any finite doubles.
inline bool holdsPoint(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                       const Eigen::Vector3d& c, SignCounts& counts) {
  for (int axis = 0; axis < 3; ++axis) {
    const double x = p[axis];
    if ((x < a[axis] && x < b[axis] && x < c[axis]) || (x > a[axis] && x > b[axis] && x > c[axis]))
      return false;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const int turn = orient2d(axis, a, b, c, counts);
    if (turn == 0) continue;
    return turn * orient2d(axis, a, b, p, counts) >= 0 &&
           turn * orient2d(axis, b, c, p, counts) >= 0 &&
           turn * orient2d(axis, c, a, p, counts) >= 0;
  }
  return exact::compareDistance(p, {a, b, c, exact::closestFeature(p, a, b, c)}, 0.0) == 0;
}

/// How the ray from p along an axis (0, 1, 2), or against it, crosses triangle (a, b, c).
///
/// Exact for any finite doubles. The ray is moved aside by (e, e²) along the next two axes, in
/// cyclic order, for a vanishing e > 0, so that it meets no edge and no corner. Over a closed mesh,
/// the number of Leaving less that of Entering is therefore the winding number of p, whatever the
/// ray would have hit.
/// Source   Simulation of simplicity (Edelsbrunner, Mücke, 1990), for two coordinates of p.
inline RayCrossing crossRay(int axis, bool against, const Eigen::Vector3d& p,
                            const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            const Eigen::Vector3d& c, SignCounts& counts) {
  PALPATE_ASSERT(axis >= 0 && axis < 3);
  const int y = axis == 2 ? 0 : axis + 1, z = axis == 0 ? 2 : axis - 1;
  bool isOnEdge = false;  // p, seen along the axis, is on the line of an edge
  const auto turn = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    if (const int sign = orient2d(axis, from, to, p, counts)) return sign;
    isOnEdge = true;
    // The component along the axis of (to - from) x (p - from) falls with p[y] by to[z] - from[z]
    // and grows with p[z] by to[y] - from[y].
    if (to[z] != from[z]) return to[z] < from[z] ? 1 : -1;
    return (to[y] > from[y]) - (to[y] < from[y]);
  };
  const int facing = turn(a, b);
  const bool passes = facing != 0 && turn(b, c) == facing && turn(c, a) == facing;
  if (!passes && !isOnEdge) return RayCrossing::None;
  const int side = orient3d(a, b, c, p, counts);
  if (side == 0 && (!isOnEdge || holdsPoint(p, a, b, c, counts))) return RayCrossing::OnTriangle;
  if (!passes || (side == facing) != against) return RayCrossing::None;  // it is behind the start
  return (facing > 0) != against ? RayCrossing::Leaving : RayCrossing::Entering;
}

/// The winding number about p of a closed surface with the triangles cornersOf(0) to
/// cornersOf(count - 1), counted along the first axis; 0 if p is on a triangle.
template <class CornersOf>
int windingNumber(std::size_t count, CornersOf&& cornersOf, const Eigen::Vector3d& p,
                  SignCounts& counts) {
  int number = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [a, b, c] = cornersOf(i);
    const RayCrossing crossing = crossRay(0, false, p, a, b, c, counts);
    if (crossing == RayCrossing::OnTriangle) return 0;
    number += static_cast<int>(crossing);
  }
  return number;
}

}  // namespace palpate
