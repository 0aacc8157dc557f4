#pragma once

#include <palpate/Types.h>

#include <Eigen/Geometry>

#include <memory>
#include <span>
#include <vector>

namespace palpate::benchmark {

/// The least distance of two deforming meshes with the same triangles, in FCL.
class FclDistance {
 public:
  FclDistance(std::span<const Triangle> triangles, std::span<const Eigen::Vector3d> a,
              std::span<const Eigen::Vector3d> b);
  ~FclDistance();
  void update(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b);
  /// L, with the closest points, of the meshes at two poses.
  double distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) const;

 private:
  struct Models;
  std::unique_ptr<Models> m_models;
};

}  // namespace palpate::benchmark
