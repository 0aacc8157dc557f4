#include "Mesh/PointMotion.h"

#include <Eigen/Geometry>

namespace palpate {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

/// Solves matrix x = right.
Vector3d solve(const Matrix3d& matrix, const Vector3d& right) {
  const Vector3d u = matrix.col(0), v = matrix.col(1), w = matrix.col(2), normal = v.cross(w);
  return Vector3d(normal.dot(right), w.cross(u).dot(right), u.cross(v).dot(right)) / u.dot(normal);
}

}  // namespace

Vector3d displacementAt(const Pose& before, const Pose& now, const Vector3d& point, double time) {
  const Matrix3d rotation = (1 - time) * before.rotation + time * now.rotation;
  const Vector3d translation = (1 - time) * before.translation + time * now.translation;
  const Vector3d body = solve(rotation, point - translation);
  return (now.rotation - before.rotation) * body + (now.translation - before.translation);
}

}  // namespace palpate
