#pragma once

#include <palpate/Types.h>

#include <cstddef>
#include <memory>
#include <span>

namespace palpate::benchmark {

/// A deforming mesh against a capsule in FCL.
class FclCapsule {
 public:
  struct Answer {
    double milliseconds;  ///< beyond the refit
    std::size_t contacts;
  };
  FclCapsule(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles);
  ~FclCapsule();
  Answer collide(std::span<const Eigen::Vector3d> positions, const Eigen::Vector3d& p0,
                 const Eigen::Vector3d& p1, double radius);

 private:
  struct Model;
  std::unique_ptr<Model> m_model;
};

}  // namespace palpate::benchmark
