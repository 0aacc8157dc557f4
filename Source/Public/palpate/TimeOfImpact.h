#pragma once

#include <palpate/Export.h>

#include <Eigen/Core>

#include <optional>

namespace palpate {

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
///
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
