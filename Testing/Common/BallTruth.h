#pragma once

#include <Eigen/Core>

#include <algorithm>

/// Segments whose radii differ between their ends: hulls of two balls, in long double.
namespace palpate::testing {

using Wide = Eigen::Matrix<long double, 3, 1>;

inline Wide wide(const Eigen::Vector3d& p) { return p.cast<long double>(); }

/// The weight of q at the nearest of the balls along a segment: the minimum of a convex function.
inline long double nearestBallOf(const Wide& x, const Wide& p, const Wide& q, long double radiusP,
                                 long double radiusQ) {
  const auto gap = [&](long double t) {
    return (x - p - t * (q - p)).norm() - (radiusP + t * (radiusQ - radiusP));
  };
  long double low = 0, high = 1;
  for (int i = 0; i < 90; ++i) {
    const long double l = low + (high - low) * 0.382L, r = low + (high - low) * 0.618L;
    (gap(l) < gap(r) ? high : low) = gap(l) < gap(r) ? r : l;
  }
  for (const long double end : {0.0L, 1.0L})
    if (gap(end) < gap(low)) low = end;
  return low;
}

/// The distance from that ball. Negative inside.
inline long double roundDistance(const Wide& x, const Wide& p, const Wide& q, long double radiusP,
                                 long double radiusQ) {
  const Wide along = q - p;
  const long double square = along.squaredNorm();
  const long double t = radiusP != radiusQ ? nearestBallOf(x, p, q, radiusP, radiusQ)
                        : square > 0       ? std::clamp((x - p).dot(along) / square, 0.0L, 1.0L)
                                           : 0.0L;
  return (x - p - t * along).norm() - (radiusP + t * (radiusQ - radiusP));
}

}  // namespace palpate::testing
