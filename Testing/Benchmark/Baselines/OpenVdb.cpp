// OpenVDB 10: meshToVolume() into a grid of floats, trilinear lookups by an accessor, which keeps
// the last leaf.
#include "FieldBaseline.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/global_control.h>

namespace palpate::benchmark {
namespace {

class OpenVdbField : public FieldBaseline {
 public:
  explicit OpenVdbField(openvdb::FloatGrid::Ptr grid) : m_grid(std::move(grid)) {}

  std::size_t bytes() const override { return m_grid->memUsage(); }
  void values(std::span<const Eigen::Vector3d> points, std::span<double> out) const override {
    using Accessor = openvdb::FloatGrid::ConstAccessor;
    const Accessor accessor = m_grid->getConstAccessor();
    const openvdb::tools::GridSampler<Accessor, openvdb::tools::BoxSampler> sampler(
        accessor, m_grid->transform());
    for (std::size_t i = 0; i < points.size(); ++i)
      out[i] = sampler.wsSample({points[i][0], points[i][1], points[i][2]});
  }

 private:
  openvdb::FloatGrid::Ptr m_grid;
};

}  // namespace

std::unique_ptr<FieldBaseline> buildOpenVdb(const std::vector<Eigen::Vector3d>& positions,
                                            const std::vector<Triangle>& triangles, double voxel,
                                            double band, int threads) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
  std::vector<openvdb::Vec3s> points;
  points.reserve(positions.size());
  for (const Eigen::Vector3d& p : positions)
    points.emplace_back(transform->worldToIndex(openvdb::Vec3d(p[0], p[1], p[2])));
  std::vector<openvdb::Vec3I> corners;
  corners.reserve(triangles.size());
  for (const auto& [a, b, c] : triangles) corners.emplace_back(a, b, c);
  const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> mesh(points,
                                                                                        corners);
  const auto width = static_cast<float>(band / voxel);
  return std::make_unique<OpenVdbField>(
      openvdb::tools::meshToVolume<openvdb::FloatGrid>(mesh, *transform, width, width));
}

}  // namespace palpate::benchmark
