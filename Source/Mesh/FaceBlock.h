#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>

namespace palpate {

/// Eight triangles, each as seen from one of its corners, side by side.
struct FaceBlock {
  static constexpr std::size_t kLanes = 8;
  alignas(64) double edges[2][3][kLanes];  ///< L: from the corner to the next ones, coordinates

  void set(std::size_t lane, const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
    for (int k = 0; k < 3; ++k) {
      edges[0][k][lane] = u[k];
      edges[1][k][lane] = v[k];
    }
  }
};

/// What FaceAtCorner says of the triangles, with the same bits.
struct FaceBlockNormals {
  std::uint8_t isPlain;                               ///< bit i is for lane i
  alignas(64) double weighted[3][FaceBlock::kLanes];  ///< weightedNormal() where isPlain
};
FaceBlockNormals weightedNormals(const FaceBlock&);

}  // namespace palpate
