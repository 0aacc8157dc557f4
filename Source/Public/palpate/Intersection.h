#pragma once

#include <palpate/Export.h>

#include <Eigen/Core>

namespace palpate {

/// Whether two triangles have a point in common. Touching counts. Decided exactly for all finite
/// doubles.
///
/// Shapes   three corners each, any winding. A triangle without area is the segment or the point
///          that it covers.
/// Errors   none. If a position is NaN or infinite, the result has no meaning.
/// Floating point  the caller's rounding mode, traps and treatment of denormals change no result.
/// Cost     bounded: least where floating point decides, most where only exact sums do.
PALPATE_EXPORT bool trianglesIntersect(const Eigen::Vector3d& a0, const Eigen::Vector3d& a1,
                                       const Eigen::Vector3d& a2, const Eigen::Vector3d& b0,
                                       const Eigen::Vector3d& b1, const Eigen::Vector3d& b2);

}  // namespace palpate
