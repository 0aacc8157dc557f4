#pragma once

#include "Common/RandomMeshes.h"

#include <Eigen/Core>

namespace palpate::testing {

inline Mesh moved(Mesh mesh, const Eigen::Vector3d& shift) {
  for (Eigen::Vector3d& p : mesh.positions) p += shift;
  return mesh;
}

inline Mesh turned(Mesh mesh, const Eigen::Matrix3d& rotation) {
  for (Eigen::Vector3d& p : mesh.positions) p = rotation * p;
  return mesh;
}

inline Mesh scaledBy(Mesh mesh, double factor) {
  for (Eigen::Vector3d& p : mesh.positions) p *= factor;
  return mesh;
}

}  // namespace palpate::testing
