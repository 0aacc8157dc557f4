#pragma once

#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// A way for a vertex that moves the planes of all its triangles outward.
struct OutwardWay {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< unit, or 0 if there is none
  /// The length of a way that moves each plane by 1 or more; infinite if there is none.
  double lengthPerOffset = 0.0;
};

/// The ways of vertices, of which each is short, though not always the shortest.
/// sides: for each triangle 1 if its winding normal points outward, else -1.
std::vector<OutwardWay> outwardWays(std::span<const Eigen::Vector3d> positions,
                                    std::span<const Triangle> triangles,
                                    std::span<const std::int8_t> sides);

/// Unit, or 0 for a triangle without area.
Eigen::Vector3d unitNormal(std::span<const Eigen::Vector3d> positions, const Triangle&);

}  // namespace palpate
