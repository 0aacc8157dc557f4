#pragma once

#include "Queries/BodyPair.h"

#include <Eigen/Core>

namespace palpate {

/// Coordinates of about 1 along three directions across each other.
struct SweepFrame {
  double unit;           ///< 1/L
  Eigen::Matrix3d axes;  ///< the directions as rows
  Eigen::Vector3d operator()(const Eigen::Vector3d& p) const { return axes * (unit * p); }
};

/// The frame along the normals that most of the area of two bodies has. Boxes along it are flat
/// where the bodies are, also where layers are turned.
SweepFrame frameOf(const BodyPair&);

}  // namespace palpate
