#include "DistanceField/ProxyPlane.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Of windows around footprints, in half edges of the node. They are tried one after another.
constexpr std::array kMargins{0.0, 0.125, 0.5, 1.0};
constexpr double kInfinite = std::numeric_limits<double>::infinity();

}  // namespace

ProxyPlanes::ProxyPlanes(const MeshTopology& topology, std::span<const Vector3d> positions,
                         double allowedError, double normalCone, double rounding)
    : m_topology(topology),
      m_positions(positions),
      m_allowedError(allowedError),
      m_cosine(std::cos(normalCone)),
      m_rounding(rounding) {
  for (const auto& [i, j, k] : m_topology.elements)
    m_normals.push_back((m_positions[j] - m_positions[i]).cross(m_positions[k] - m_positions[i]));
}

/// A triangle about a node's centre: two coordinates along a plane, and the height.
struct ProxyPlanes::Shadow {
  std::array<Vector3d, 3> corners;
  Vector3d low, high;
};

ProxyPlanes::Shadow ProxyPlanes::shadowOf(std::uint32_t triangle, const ProxyWindow& window) const {
  Shadow shadow;
  for (int i = 0; i < 3; ++i) {
    const Vector3d p = m_positions[m_topology.elements[triangle][i]] - window.cube.centre;
    shadow.corners[i] = {window.u.dot(p), window.v.dot(p), window.normal.dot(p)};
  }
  const auto& [a, b, c] = shadow.corners;
  shadow.low = a.cwiseMin(b).cwiseMin(c);
  shadow.high = a.cwiseMax(b).cwiseMax(c);
  return shadow;
}

namespace {

/// Extends [low, high] by the heights of the part of a triangle in the window. Returns whether
/// there is such a part.
bool addHeights(const std::array<Vector3d, 3>& corners, const Vector3d& least, const Vector3d& most,
                const std::array<double, 2>& window, double& low, double& high) {
  std::array<Vector3d, 8> polygon, next;
  std::copy(corners.begin(), corners.end(), polygon.begin());
  std::size_t size = 3;
  for (int k = 0; k < 2; ++k)
    for (const double sign : {1.0, -1.0}) {
      if (sign > 0 ? most[k] <= window[k] : least[k] >= -window[k]) continue;
      std::size_t count = 0;
      for (std::size_t i = 0; i < size; ++i) {
        const Vector3d &p = polygon[i], &q = polygon[(i + 1) % size];
        const double fromP = window[k] - sign * p[k], fromQ = window[k] - sign * q[k];
        if (fromP >= 0.0) next[count++] = p;
        if ((fromP < 0.0) != (fromQ < 0.0) && fromP != fromQ)
          next[count++] = p + fromP / (fromP - fromQ) * (q - p);
      }
      polygon = next;
      size = count;
      if (size == 0) return false;
    }
  for (std::size_t i = 0; i < size; ++i) {
    low = std::min(low, polygon[i][2]);
    high = std::max(high, polygon[i][2]);
  }
  return true;
}

}  // namespace

/// The mean normal near the nearest point; zero if the normals there are not within the cone.
Vector3d ProxyPlanes::normalNear(const Surroundings& around, Scratch& scratch) const {
  const std::size_t count =
      placesWithin(around.items, around.nearest, around.cube.halfDiagonal, scratch.places.data());
  const Vector3d* first = nullptr;
  const double widest = 2.0 * m_cosine * m_cosine - 1.0;  // of twice the angle
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d& normal = m_normals[around.items.triangleAt(scratch.places[i])];
    if (!first) first = &normal;
    const double along = first->dot(normal);
    if (widest > 0.0 &&
        !(along > 0.0 &&
          along * along >= 0.99 * widest * widest * first->squaredNorm() * normal.squaredNorm()))
      return Vector3d::Zero();
    sum += normal;
  }
  const double length = sum.norm();
  return length > 0.0 ? Vector3d(sum / length) : Vector3d::Zero();
}

bool ProxyPlanes::isInCone(std::uint32_t triangle, const Vector3d& normal) const {
  const Vector3d& of = m_normals[triangle];
  const double along = normal.dot(of), least = m_cosine * (1.0 + kProxySlack);
  return along > 0.0 && along * along >= least * least * of.squaredNorm() &&
         hasClosedStars(m_topology, triangle);
}

/// The least and the greatest height of the surface in the window. Returns false if their
/// difference or a normal allows no plane.
bool ProxyPlanes::findHeights(const Surroundings& around, const ProxyWindow& window, double& low,
                              double& high, Scratch& scratch) const {
  const std::size_t count =
      boundHeights(around.items, window, m_cosine * (1.0 + kProxySlack) + kProxyNormalError,
                   m_rounding, scratch.places.data(), scratch.low.data(), scratch.high.data());
  low = kInfinite, high = -kInfinite;
  const auto add = [&](std::size_t i) {
    if (scratch.low[i] >= low && scratch.high[i] <= high) return true;
    const std::uint32_t triangle = around.items.triangleAt(scratch.places[i]);
    const Shadow shadow = shadowOf(triangle, window);
    for (int k = 0; k < 2; ++k)
      if (shadow.high[k] < -window.half[k] || shadow.low[k] > window.half[k]) return true;
    if (!addHeights(shadow.corners, shadow.low, shadow.high, window.half, low, high)) return true;
    return isInCone(triangle, window.normal) && high - low <= 2.0 * m_allowedError;
  };
  if (count == 0) return false;
  // The extremes come first. They let most others be left out.
  const auto end = static_cast<std::ptrdiff_t>(count);
  const auto lowest = std::min_element(scratch.low.begin(), scratch.low.begin() + end),
             highest = std::max_element(scratch.high.begin(), scratch.high.begin() + end);
  if (!add(static_cast<std::size_t>(lowest - scratch.low.begin())) ||
      !add(static_cast<std::size_t>(highest - scratch.high.begin())))
    return false;
  for (std::size_t i = 0; i < count; ++i)
    if (!add(i)) return false;
  return low <= high;
}

bool ProxyPlanes::find(const Surroundings& around, Plane& plane, Scratch& scratch) const {
  PALPATE_ASSERT((around.nearest - around.cube.centre).norm() + 2.0 * around.cube.halfDiagonal <=
                 around.reach);
  for (Buffer<double>* each : {&scratch.low, &scratch.high})
    if (each->size() < around.items.size) each->resize(around.items.size);
  if (scratch.places.size() < around.items.size) scratch.places.resize(around.items.size);
  const Vector3d normal = normalNear(around, scratch);
  if (normal.isZero(0.0)) return false;
  int least = 0;
  normal.cwiseAbs().minCoeff(&least);
  ProxyWindow window{
      around.cube, normal.cross(Vector3d::Unit(least)).normalized(), {}, normal, {}, 0, {}};
  window.v = normal.cross(window.u);
  const auto extentAlong = [&](const Vector3d& axis) {
    return around.cube.half * axis.cwiseAbs().sum() * (1.0 + kProxySlack) + m_rounding;
  };
  window.footprint = {extentAlong(window.u), extentAlong(window.v), extentAlong(normal)};
  const Vector3d toNearest = around.nearest - around.cube.centre;
  const std::array<double, 2> nearest{window.u.dot(toNearest), window.v.dot(toNearest)};
  for (const double margin : kMargins) {
    window.more = margin * around.cube.half;
    window.half = {window.footprint[0] + window.more, window.footprint[1] + window.more};
    double low, high;
    if (!findHeights(around, window, low, high, scratch)) return false;
    const double middle = 0.5 * low + 0.5 * high;
    double error = (0.5 * high - 0.5 * low) * (1.0 + kProxySlack) + m_rounding;
    if (!(error <= m_allowedError)) return false;
    if (!(std::abs(nearest[0]) + m_rounding <= window.half[0] &&
          std::abs(nearest[1]) + m_rounding <= window.half[1]))
      continue;
    if (!isNearestInside(around, window, middle, error, scratch)) continue;
    const double height = std::abs(middle) + error,
                 corner = std::sqrt(height * height + window.half[0] * window.half[0] +
                                    window.half[1] * window.half[1]);
    if (!(corner * (1.0 + kProxySlack) + m_rounding <= around.reach)) return false;
    plane = {normal, normal.dot(around.cube.centre) + middle, error};
    return true;
  }
  return false;
}

/// Whether points of the node have no surface outside the window that is nearer to them than the
/// plane less the error. Raises the error if this is needed. middle: the plane's height above the
/// centre.
bool ProxyPlanes::isNearestInside(const Surroundings& around, const ProxyWindow& window,
                                  double middle, double& error, Scratch& scratch) const {
  const std::size_t count = raiseError(around.items, window, middle, m_allowedError, m_rounding,
                                       error, scratch.places.data());
  return std::all_of(
      scratch.places.begin(), scratch.places.begin() + static_cast<std::ptrdiff_t>(count),
      [&](std::uint32_t place) {
        return isFarEnough(shadowOf(around.items.triangleAt(place), window), window, middle, error);
      });
}

/// The same of one triangle, by its corners.
bool ProxyPlanes::isFarEnough(const Shadow& shadow, const ProxyWindow& window, double middle,
                              double error) const {
  const Vector3d& footprint = window.footprint;
  const double high = shadow.high[2] - middle + m_rounding,
               low = shadow.low[2] - middle - m_rounding;
  if (!(high > error || low < -error)) return true;
  double square = 0;
  for (int k = 0; k < 2; ++k) {
    const double gap =
        std::max({0.0, shadow.low[k] - footprint[k], -footprint[k] - shadow.high[k]});
    square += gap * gap;
  }
  const double lateral =
      std::max(window.more, std::sqrt(square)) * (1.0 - kProxySlack) - m_rounding;
  if (!(lateral > 0.0)) return false;
  const auto isFar = [&](double side, double height) {
    if (!(side > error && height > error)) return true;
    const double most = std::min(height, side);
    const double limit = (most - error) * (2.0 * side - most - error);
    return lateral * lateral >= limit * (1.0 + kProxySlack);
  };
  return isFar(footprint[2] - middle, high) && isFar(footprint[2] + middle, -low);
}

}  // namespace palpate
