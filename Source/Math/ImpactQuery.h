#pragma once

#include <palpate/TimeOfImpact.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>

namespace palpate {

/// Two moving features that may touch: which, and where their four vertices are before and after
/// the step.
///
/// Both kinds are one problem. With A, B, C moving linearly,
// clang-format off
///   VertexTriangle  (v, a, b, c):      A = b - a,    B = c - a,    C = v - a,    x, y >= 0, x + y <= 1
///   EdgeEdge        (p0, p1, q0, q1):  A = p1 - p0,  B = q0 - q1,  C = q0 - p0,  0 <= x, y <= 1
// clang-format on
/// the features touch where C = x A + y B for some (x, y) in that triangle or square.
struct ImpactQuery {
  enum class Kind { VertexTriangle, EdgeEdge };
  struct Step {
    Eigen::Vector3d before, now;
    const Eigen::Vector3d& at(int end) const { return end == 0 ? before : now; }
  };
  /// A difference of two vertices, by index into `vertices`: minuend, subtrahend.
  using Difference = std::array<int, 2>;

  Kind kind;
  std::array<Step, 4> vertices;

  static constexpr std::array<Difference, 3> axes(Kind kind) {
    if (kind == Kind::VertexTriangle) return {{{2, 1}, {3, 1}, {0, 1}}};
    return {{{1, 0}, {2, 3}, {2, 0}}};
  }
  /// C - x A - y B at the corners of the domain, C first; the features touch where these surround
  /// zero.
  static constexpr std::array<Difference, 4> corners(Kind kind) {
    if (kind == Kind::VertexTriangle) return {{{0, 1}, {0, 2}, {0, 3}}};  // only three
    return {{{2, 0}, {2, 1}, {3, 0}, {3, 1}}};
  }
};

/// What an impact test says, and what it took.
struct ImpactAnswer {
  bool impact = false;
  bool exact = false;  ///< floating point could not decide
  double time = 0.0;   ///< [0, 1] of the step; of an impact only
};

/// As vertexTriangleTimeOfImpact and edgeEdgeTimeOfImpact. An impact after upTo, in [0, 1], may be
/// left out; the time of one that is found does not depend on upTo.
ImpactAnswer findImpact(const ImpactQuery&, const TimeOfImpactSettings&, double upTo = 1.0);

/// Its parts; tolerance in [2^-50, 1]. Touching: floating point first, then exact arithmetic.
ImpactAnswer findTouch(const ImpactQuery&, double tolerance, double upTo = 1.0);
/// The same answer by exact arithmetic alone.
ImpactAnswer findTouchExactly(const ImpactQuery&, double tolerance);
/// Coming within a distance > 0.
ImpactAnswer findApproach(const ImpactQuery&, double distance, double tolerance, double upTo = 1.0);

/// The side of the contact plane on which the first feature was last before the time: 1 if that of
/// A x B, the triangle's winding normal or (p1 - p0) x (q0 - q1), towards which C points; else -1;
/// 0 if it was always in the plane. exactDecisions: counts up where floating point could not tell.
int sideBefore(const ImpactQuery&, double time, std::size_t* exactDecisions = nullptr);

/// The vertices at a time of the step, relative to the first one's way: differences stay sharp far
/// from the origin, where positions would be rounded. As they are where differences overflow.
std::array<Eigen::Vector3d, 4> positionsAt(const ImpactQuery&, double time);
/// From these, the normal where features touch, with no minimum distance.
Eigen::Vector3d normalOfTouch(const ImpactQuery&, double time,
                              const std::array<Eigen::Vector3d, 4>& positions,
                              std::size_t& exactDecisions);

}  // namespace palpate
