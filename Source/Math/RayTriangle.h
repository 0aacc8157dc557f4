#pragma once

#include <Eigen/Core>

#include <cstdint>
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
std::optional<RayInterval> intersectRay(const RaySegment&, const Eigen::Vector3d& a,
                                        const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// The point where a ray meets a triangle.
struct RayPoint {
  double t;                 ///< within kRayError
  Eigen::Vector3d weights;  ///< of the triangle's corners; at least 0
};
/// The first point of an interval that intersectRay() returned for this triangle.
RayPoint firstPoint(const RaySegment&, const RayInterval&, const Eigen::Vector3d& a,
                    const Eigen::Vector3d& b, const Eigen::Vector3d& c);

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
