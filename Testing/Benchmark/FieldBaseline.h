#pragma once

#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace palpate::benchmark {

/// The distance field of another library.
class FieldBaseline {
 public:
  virtual ~FieldBaseline() = default;
  virtual std::size_t bytes() const = 0;
  /// Interpolated distances of points, one after the other.
  virtual void values(std::span<const Eigen::Vector3d> points, std::span<double> out) const = 0;
};

/// OpenVDB: a narrow-band level set. voxel, band: L.
std::unique_ptr<FieldBaseline> buildOpenVdb(const std::vector<Eigen::Vector3d>& positions,
                                            const std::vector<Triangle>& triangles, double voxel,
                                            double band, int threads);

}  // namespace palpate::benchmark
