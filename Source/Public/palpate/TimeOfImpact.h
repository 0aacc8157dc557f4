#pragma once

#include <palpate/Export.h>

#include <Eigen/Core>

#include <optional>

namespace palpate {

struct TimeOfImpactSettings {
  /// L, finite. Not positive: touching counts, and whether there is an impact is decided exactly.
  double minimumDistance = 0.0;
  /// Of the step, [2^-50, 1] (taken as the nearer end outside it). Larger: slightly cheaper.
  double timeTolerance = 1e-6;
};

/// When a moving vertex first touches a moving triangle, its border included.
///
/// Shapes   positions before the step, then now: of the vertex v and the triangle's corners a, b,
///          c. Every one moves along p(t) = (1 - t) before + t now, in real arithmetic, t in [0,
///          1].
/// Units    the positions' length unit L; the result is a fraction of the step.
/// Needs    finite positions; any finite doubles will do.
/// Returns  a time not after the first impact and at most `timeTolerance` before it; none if there
///          is no impact. With minimumDistance 0, impact or none is a true statement about the
///          given doubles, whatever they are: a triangle without area or extent, motion in a plane,
///          no motion, contact only at 0 or at 1. With a minimum distance d > 0 an impact is a time
///          at which the distance is at most d. One may be reported, and then at such a time, where
///          the distance comes within e of d, e = timeTolerance * (largest displacement of a vertex
///          of one feature relative to one of the other) + 2^-35 * (largest difference of their
///          coordinates + d).
/// Laws     (1) permuting the corners does not change impact or none, nor does swapping before and
///          now.
///          (2) scaling all positions by a power of two, where exact, does not either.
/// Cost     bounded: 0.1 µs for most misses, microseconds where floating point cannot decide. With
///          a minimum distance at most 1 / timeTolerance steps of 0.1 µs; few where features do not
///          pass each other at nearly that distance.
PALPATE_EXPORT std::optional<double> vertexTriangleTimeOfImpact(
    const Eigen::Vector3d& vBefore, const Eigen::Vector3d& aBefore, const Eigen::Vector3d& bBefore,
    const Eigen::Vector3d& cBefore, const Eigen::Vector3d& vNow, const Eigen::Vector3d& aNow,
    const Eigen::Vector3d& bNow, const Eigen::Vector3d& cNow, const TimeOfImpactSettings& = {});

/// When two moving edges first touch, their ends included: as vertexTriangleTimeOfImpact, for the
/// edges p0 p1 and q0 q1. Edges may be parallel, collinear, of no length.
/// Laws     (3) swapping the edges, or the ends of either, does not change impact or none.
PALPATE_EXPORT std::optional<double> edgeEdgeTimeOfImpact(
    const Eigen::Vector3d& p0Before, const Eigen::Vector3d& p1Before,
    const Eigen::Vector3d& q0Before, const Eigen::Vector3d& q1Before, const Eigen::Vector3d& p0Now,
    const Eigen::Vector3d& p1Now, const Eigen::Vector3d& q0Now, const Eigen::Vector3d& q1Now,
    const TimeOfImpactSettings& = {});

}  // namespace palpate
