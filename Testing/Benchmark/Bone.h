#pragma once

#include "Common/RandomMeshes.h"

#include <Eigen/Core>

#include <cmath>
#include <cstdint>

namespace palpate::benchmark {

/// A large rigid body: closed, with bumps. 502,000 triangles by default.
inline testing::Mesh bone(std::uint32_t rings = 501, std::uint32_t segments = 502) {
  testing::Mesh body = testing::sphere(rings, segments, Eigen::Vector3d::Zero(), 0.4);
  for (Eigen::Vector3d& p : body.positions)
    p *= 0.95 + 0.05 * std::sin(19 * p[0]) * std::cos(23 * p[1] + 11 * p[2]);
  return body;
}

}  // namespace palpate::benchmark
