#pragma once

#include <palpate/Types.h>

#include <cstddef>
#include <memory>
#include <span>

namespace palpate::benchmark {

/// A deforming mesh against a mesh that moves by its transform, in FCL.
class FclBody {
 public:
  struct Answer {
    double milliseconds;  ///< refit and collide()
    std::size_t contacts;
  };
  FclBody(std::span<const Eigen::Vector3d> organ, std::span<const Triangle> organTriangles,
          std::span<const Eigen::Vector3d> body, std::span<const Triangle> bodyTriangles);
  ~FclBody();
  Answer collide(std::span<const Eigen::Vector3d> organ, const Eigen::Matrix3d& rotation,
                 const Eigen::Vector3d& translation);

 private:
  struct Models;
  std::unique_ptr<Models> m_models;
};

}  // namespace palpate::benchmark
