#include "CollisionDetection/ShapeQuery.h"

#include "Math/Tolerances.h"

namespace palpate {

void findPrimitivesNear(const Geometry& geometry, const Shape& shape, double reach,
                        PointQueryStack& stack, Buffer<std::uint32_t>& out) {
  const Octree& octree = geometry.octree;
  const double unit = 1.0 / geometry.frame.scale;
  const RigidTransform& placed = geometry.mesh.now.transform();
  const auto mayReach = [&](const FloatBox& box) {
    if (box.empty()) return false;
    Eigen::Vector3d lower, upper;
    for (int k = 0; k < 3; ++k) lower[k] = box.lower[k], upper[k] = box.upper[k];
    if (lower.minCoeff() <= -kLargestFloat || upper.maxCoeff() >= kLargestFloat) return true;
    Eigen::Vector3d centre = 0.5 * unit * (lower + upper) + geometry.frame.origin;
    const Eigen::Vector3d half = 0.5 * unit * (upper - lower);
    double size = centre.cwiseAbs().maxCoeff() + geometry.frame.origin.cwiseAbs().maxCoeff() +
                  half.sum() + shape.magnitude();
    if (geometry.isPlaced()) {
      centre = placed(centre);
      size += placed.translation.cwiseAbs().maxCoeff();
    }
    const SignedDistance at = shape.at(centre);
    const Eigen::Vector3d slope =
        geometry.isPlaced() ? placed.rotation.transpose() * at.normal : at.normal;
    return !(at.distance - slope.cwiseAbs().dot(half) >
             reach + kShapeBoundError * size);  // NaN: it may
  };
  out.clear();
  forEachOverlapping(octree, mayReach, stack, [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i)
      if (mayReach(octree.boxes()[i])) out.push_back(octree.order()[i]);
  });
}

}  // namespace palpate
