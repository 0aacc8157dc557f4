#pragma once

#include "Exact/ErrorBounds.h"
#include "Core/Assert.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

// What a ray shares with a triangle. Every decision is exact for the given doubles.
namespace palpate {

/// The points origin + t direction with t in [tMin, tMax]. The direction must not be zero.
struct RaySegment {
  Eigen::Vector3d origin, direction;
  double tMin, tMax;
};

/// The parameters of a ray that lie on a triangle: a point of the ray, or an interval where the ray
/// lies in the triangle's plane. A triangle without area is a segment or a point.
struct RayInterval {
  double first, last;  ///< each within `error` of the exact parameter
  double error;        ///< 0 if an end is exactly that double, as where it is tMin or tMax
  /// 1: from the back of the triangle, with respect to its winding normal, to the front. -1: from
  /// the front to the back. 0: it stays on one side.
  ///
  /// The ray is moved aside by (e, e², e³) for a vanishing e > 0, so that it meets no edge and no
  /// corner. Over a closed mesh the crossings of a ray therefore sum to the change of the winding
  /// number, whatever the ray meets.
  /// Source   Simulation of simplicity (Edelsbrunner, Mücke, 1990), for the ray's origin.
  std::int8_t crossing;
  bool frontFace;  ///< direction . normal < 0
};

/// None if the ray misses the triangle. The ends' errors may be some 2^-47 of the largest
/// coordinate difference, divided by the sine of the angle between ray and triangle.
/// exactDecisions: counts how often exact arithmetic decides, here and in firstPoint().
std::optional<RayInterval> intersectRay(const RaySegment&, const Eigen::Vector3d& a,
                                        const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                        std::size_t* exactDecisions = nullptr);

/// Finds quickly that a line misses a triangle.
///
/// Corners are projected along the line onto the plane of two axes, with the line at 0. The line
/// misses the triangle if 0 is to the left of one edge and to the right of another.
///
/// Let each coordinate of a corner less the origin be at most m, with an error of at most e. The
/// direction's largest component is 1 or -1. A projected coordinate is then at most 2 m, with an
/// error of 2 e and of 5 roundings, together at most 3 e as e is at least 2^-46 m. The cross
/// product of two such corners errs by at most 4 (2 m) (3 e) + 2 (3 e)² for that, and by 6 (2 m)²
/// 2^-53 < e m for its own roundings: together by less than 32 e m if e is at most m / 4. Otherwise
/// no product is that large.
class LineFilter {
 public:
  /// A filter that finds nothing.
  LineFilter() = default;
  /// extent, error: L, bounds m and e.
  LineFilter(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, int largestComponent,
             double extent, double error)
      : m_axes{(largestComponent + 1) % 3, (largestComponent + 2) % 3, largestComponent} {
    PALPATE_ASSERT(std::abs(direction[largestComponent]) == 1.0 && extent >= 0.0 && error >= 0.0);
    for (int k = 0; k < 3; ++k) m_origin[k] = origin[m_axes[k]];
    for (int k = 0; k < 2; ++k) m_slope[k] = direction[m_axes[k]] * direction[largestComponent];
    // Products of larger coordinates might overflow.
    if (extent < kLargestModerate) m_error = 32.0 * extent * error + kUnderflowGuard;
  }

  /// Whether the line certainly misses the triangle.
  bool misses(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) const {
    const Eigen::Vector3d* const corners[3] = {&a, &b, &c};
    double x[3], y[3];
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d& at = *corners[i];
      const double z = at[m_axes[2]] - m_origin[2];
      x[i] = (at[m_axes[0]] - m_origin[0]) - m_slope[0] * z;
      y[i] = (at[m_axes[1]] - m_origin[1]) - m_slope[1] * z;
    }
    const double ab = x[0] * y[1] - x[1] * y[0], bc = x[1] * y[2] - x[2] * y[1],
                 ca = x[2] * y[0] - x[0] * y[2];
    return std::min(std::max(ab, std::max(bc, ca)), -std::min(ab, std::min(bc, ca))) > m_error;
  }

 private:
  int m_axes[3] = {0, 1, 2};
  double m_origin[3] = {}, m_slope[2] = {}, m_error = std::numeric_limits<double>::infinity();
};

/// The point where a ray meets a triangle.
struct RayPoint {
  double t;                 ///< within kRayError
  Eigen::Vector3d weights;  ///< of the triangle's corners; at least 0
};
/// The first point of an interval that intersectRay() returned for this triangle.
RayPoint firstPoint(const RaySegment&, const RayInterval&, const Eigen::Vector3d& a,
                    const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                    std::size_t* exactDecisions = nullptr);

namespace exact {

/// One end of the interval of a triangle that the ray meets.
struct RayEnd {
  const Eigen::Vector3d &a, &b, &c;
  bool last;
};
/// Sign of one end's parameter less another's. Allocates.
int compareRayEnds(const RaySegment&, const RayEnd&, const RayEnd&);

}  // namespace exact
}  // namespace palpate
