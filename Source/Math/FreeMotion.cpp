#include "Math/FreeMotion.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

using Eigen::Vector3d;

RoundBox::RoundBox(const RoundPoints& points)
    : lower(points.positions[0].array() - points.radii[0]),
      upper(points.positions[0].array() + points.radii[0]) {
  for (int i = 1; i < points.count; ++i) {
    lower = lower.cwiseMin((points.positions[i].array() - points.radii[i]).matrix());
    upper = upper.cwiseMax((points.positions[i].array() + points.radii[i]).matrix());
  }
}

SharedGap gapAlong(const RoundPoints& p, const RoundPoints& q, const Vector3d& direction,
                   bool withRadii) {
  PALPATE_ASSERT(p.count > 0 && q.count > 0);
  const double factor = withRadii ? 1.0 : 0.0;
  SharedGap result{};
  for (int i = 0; i < p.count; ++i)
    result.beyondP[i] = direction.dot(p.positions[i] - q.positions[0]) - factor * p.radii[i];
  for (int j = 0; j < q.count; ++j)
    result.beyondQ[j] = direction.dot(q.positions[j] - q.positions[0]) + factor * q.radii[j];
  // A direction of NaN makes all heights NaN, and so the gap.
  const double lowest = *std::min_element(result.beyondP.begin(), result.beyondP.begin() + p.count),
               highest =
                   *std::max_element(result.beyondQ.begin(), result.beyondQ.begin() + q.count);
  result.gap = lowest - highest;
  for (int i = 0; i < p.count; ++i) result.beyondP[i] -= lowest;
  for (int j = 0; j < q.count; ++j) result.beyondQ[j] = highest - result.beyondQ[j];
  return result;
}

BoxGap gapOfBoxes(const RoundBox& p, const RoundBox& q, double thickness) {
  const Vector3d above = p.lower - q.upper, below = q.lower - p.upper,
                 lower = p.lower.cwiseMin(q.lower), upper = p.upper.cwiseMax(q.upper);
  Eigen::Index axis = 0;
  const double gap = above.cwiseMax(below).maxCoeff(&axis);
  return {gap,
          (above[axis] >= below[axis] ? 1.0 : -1.0) * Vector3d::Unit(axis),
          {std::max(thickness, upper.cwiseMax(-lower).maxCoeff()), (upper - lower).maxCoeff()}};
}

FreeMotionRange::FreeMotionRange(const PairSettings& settings, double radii)
    : m_thickness(settings.thickness),
      m_contactDistance(settings.thickness + radii),
      m_reach(settings.freeMotionReach),
      m_isEarly(m_contactDistance > 0.0 &&
                (settings.method == Method::Continuous || settings.method == Method::Auto)),
      m_early(settings.continuous.timeTolerance * m_reach) {}

double FreeMotionRange::slack(const GapSize& size) const {
  const double rounding = kFreeMotionError * size.largest;
  if (!m_isEarly) return rounding;
  return rounding + kFreeMotionApproach * (size.extent + m_contactDistance) + m_early;
}

double FreeMotionRange::freeGap(double gap, const GapSize& size) const {
  const double free = gap - m_thickness - slack(size);
  return free > 0.0 ? free : 0.0;  // also for NaN
}

double FreeMotionRange::gapOfContact(double gap, const GapSize& size) {
  const double free = gap - kFreeMotionError * size.largest;
  return free > 0.0 ? free : 0.0;
}

double FreeMotionRange::searchDistance(double largest) const {
  return m_contactDistance + m_reach + 2.0 * slack({largest + m_contactDistance, 2.0 * largest});
}

}  // namespace palpate
