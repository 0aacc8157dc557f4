#include "Mesh/Rotation.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <cmath>

namespace palpate {

using Eigen::Matrix3d;

namespace {

/// Sums in a fixed order, so that every machine gets the same bits.
Matrix3d product(const Matrix3d& a, const Matrix3d& b) {
  Matrix3d c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c(i, j) = (a(i, 0) * b(0, j) + a(i, 1) * b(1, j)) + a(i, 2) * b(2, j);
  return c;
}

}  // namespace

double deviationFromRotation(const Matrix3d& r) {
  const Matrix3d difference = product(r.transpose(), r) - Matrix3d::Identity();
  double most = 0.0;
  for (const double entry : difference.reshaped())
    most = std::abs(entry) <= most ? most : std::abs(entry);  // also takes NaN, and keeps it
  return most;
}

Pose withExactRotation(const Pose& pose) {
  const double deviation = deviationFromRotation(pose.rotation);
  if (!(deviation > kOrthonormal && deviation <= kRoughRotation)) return pose;
  Pose exact = pose;
  for (int round = 0; round < 3; ++round) {
    const Matrix3d square = product(exact.rotation.transpose(), exact.rotation);
    exact.rotation = 0.5 * product(exact.rotation, 3.0 * Matrix3d::Identity() - square);
  }
  PALPATE_ASSERT(deviationFromRotation(exact.rotation) <= kOrthonormal);
  return exact;
}

}  // namespace palpate
