#pragma once

#include "Exact/ErrorBounds.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace palpate {

/// Counts how often the floating-point filter did not decide.
struct SignCounts {
  std::size_t undecided = 0;  ///< trivial zeros are not counted
};

// orient2d() and orient3d() are named as in Shewchuk, Adaptive precision floating-point arithmetic
// and fast robust geometric predicates, Discrete & Computational Geometry 18 (1997). Difference:
// one filter in floating point, then integers of fixed width or ExactSum.

/// The signs of orient3d() and orient2d() without rounding. Slow.
int orient3dExactly(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                    const Eigen::Vector3d& d, SignCounts&);
int orient2dExactly(int axis, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                    const Eigen::Vector3d& c, SignCounts&);

/// The plane of a triangle, its normal computed once for several points.
class OrientedPlane {
 public:
  OrientedPlane(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c)
      : m_a(a), m_b(b), m_c(c) {
    const Eigen::Vector3d u = b - a, v = c - a;
    const Eigen::Array3d forward(u.y() * v.z(), u.z() * v.x(), u.x() * v.y());
    const Eigen::Array3d backward(u.z() * v.y(), u.x() * v.z(), u.y() * v.x());
    m_normal = forward - backward;
    m_magnitude = forward.abs() + backward.abs();
  }

  /// Sign of (b - a) × (c - a) · (d - a): 1 on the side to which the winding normal points, -1 on
  /// the other side, 0 on the plane. 0 everywhere if the triangle has no area. Exact for any finite
  /// doubles.
  ///
  /// The filter: with e = 2^-53 each of the six products of three differences takes at most eight
  /// roundings (three differences, two products, three sums). The error is therefore at most ((1 +
  /// e)^8 - 1) P, P the sum of their exact magnitudes. The computed P is at least (1 - e)^8 of
  /// that, so kVolumeError P covers both and its own rounding. An inner product that underflows
  /// errs by at most 2^-1075 more and is then multiplied by a component of d - a. Six of those,
  /// three outer products and the roundings after them stay under 2^-1000 (1 + |d - a|₁). An
  /// overflow makes the bound infinite or NaN, and neither comparison is then true.
  int side(const Eigen::Vector3d& d, SignCounts& counts) const {
    const Eigen::Array3d w = d - m_a;
    const Eigen::Array3d wMagnitude = w.abs();
    const double determinant = (m_normal * w).sum();
    const double bound =
        kVolumeError * (m_magnitude * wMagnitude).sum() + kUnderflowGuard * (1 + wMagnitude.sum());
    if (determinant > bound) return 1;
    if (determinant < -bound) return -1;
    return orient3dExactly(m_a, m_b, m_c, d, counts);
  }

 private:
  const Eigen::Vector3d &m_a, &m_b, &m_c;
  Eigen::Array3d m_normal, m_magnitude;
};

/// Sign of the volume of a, b, c, d: see OrientedPlane::side.
inline int orient3d(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                    const Eigen::Vector3d& d, SignCounts& counts) {
  return OrientedPlane(a, b, c).side(d, counts);
}

/// Sign of the component along an axis (0, 1, 2) of (b - a) × (c - a): the turn of a, b, c as
/// viewed from the axis' positive end. Exact for any finite doubles. The filter is as above: four
/// roundings a product.
inline int orient2d(int axis, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                    const Eigen::Vector3d& c, SignCounts& counts) {
  const int x = axis == 2 ? 0 : axis + 1, y = axis == 0 ? 2 : axis - 1;
  const double forward = (b[x] - a[x]) * (c[y] - a[y]), backward = (b[y] - a[y]) * (c[x] - a[x]);
  const double determinant = forward - backward;
  const double bound = kAreaError * (std::abs(forward) + std::abs(backward)) + kUnderflowGuard;
  if (determinant > bound) return 1;
  if (determinant < -bound) return -1;
  return orient2dExactly(axis, a, b, c, counts);
}

}  // namespace palpate
