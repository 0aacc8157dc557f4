#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <span>

namespace palpate::scenes {

/// Pairs of a polyline's segments without a common vertex that touch within a step. Exact, every
/// segment against every other, without an octree.
std::size_t countSelfImpacts(std::span<const Eigen::Vector3d> before,
                             std::span<const Eigen::Vector3d> now);

}  // namespace palpate::scenes
