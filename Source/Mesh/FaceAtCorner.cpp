#include "Mesh/FaceAtCorner.h"

#include "Mesh/AngleSeries.h"
#include "Math/Foot.h"
#include "Math/StableLength.h"

#include <cmath>
#include <numbers>

namespace palpate {

using Eigen::Vector3d;

/// The angle in [0, pi] with this sine and cosine, both times `length`, within 2^-40 of itself.
/// std::atan2() has other bits on other processors.
static double angleOf(double sine, double cosine, double length) {
  if (cosine < 0.0) return std::numbers::pi - angleOf(sine, -cosine, length);
  double tangent = sine / (length + cosine);  // of the half
  for (int i = 0; i < 2; ++i) tangent /= 1.0 + std::sqrt(1.0 + tangent * tangent);
  const double square = tangent * tangent;
  double series = 0.0;
  for (const double inverse : kAngleSeries) series = inverse - square * series;
  return 8.0 * tangent * (1.0 - square * series);
}

Vector3d FaceAtCorner::normal() const {
  if (isPlain()) return m_across / std::sqrt(m_square);
  return unitCross(m_corners[0], m_corners[1], m_corners[0], m_corners[2]);
}

Vector3d FaceAtCorner::weightedNormal() const {
  if (isPlain()) {
    const double length = std::sqrt(m_square);
    return angleOf(length, m_u.dot(m_v), std::sqrt(m_ofU * m_ofV)) / length * m_across;
  }
  const Vector3d u = stableUnit(m_u), v = stableUnit(m_v);
  return angleOf(stableLength(u.cross(v)), u.dot(v), 1.0) * normal();
}

}  // namespace palpate
