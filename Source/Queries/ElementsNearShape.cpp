#include "Queries/ElementsNearShape.h"

#include "Shapes/ShapeStep.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

namespace palpate {

void findElementsNear(const Body& geometry, const Shape& before, const Shape& now,
                      double maxDistance, Buffer<std::uint32_t>& out) {
  using Eigen::Vector3d;
  const bool wholeStep = &before != &now;
  const Vector3d origin = worldOrigin(geometry);
  const BoxMap map = worldMap(geometry, origin, 0.0, wholeStep);
  const double unit = 1.0 / geometry.tree.frame().scale;
  const double error = kShapeBoundError * (before.magnitude() + now.magnitude() + maxDistance +
                                           2.0 * origin.cwiseAbs().maxCoeff());
  Eigen::AlignedBox3d swept;
  for (const Shape* shape : {&before, &now})
    for (const Vector3d& corner : shape->corners()) swept.extend(corner - origin);
  const ShapeStep step(before, now);
  const Vector3d grown = Vector3d::Constant(maxDistance + now.radius() + error);
  swept = {swept.min() - grown, swept.max() + grown};
  const auto mayBeNear = [&](const FloatBox& stored) {
    if (stored.empty()) return false;
    const FloatBox floats = map(stored);
    if (floats.mayBeClamped()) return true;
    Eigen::AlignedBox3d box;
    for (int k = 0; k < 3; ++k) box.min()[k] = floats.lower[k], box.max()[k] = floats.upper[k];
    box = {unit * box.min(), unit * box.max()};
    if (wholeStep && now.isPlane())
      return step.mayComeNear({box.min() + origin, box.max() + origin}, maxDistance);
    if (!now.isPlane() && !swept.intersects(box)) return false;  // costs less than a distance
    if (wholeStep) return true;
    const Vector3d centre = box.center() + origin;
    const PointShapeDistance at = now.signedDistance(centre);
    const double size = centre.cwiseAbs().maxCoeff() + box.sizes().sum();
    return !(at.distance - 0.5 * at.normal.cwiseAbs().dot(box.sizes()) >
             maxDistance + error + kShapeBoundError * size);  // NaN: it may
  };
  out.clear();
  forEachOverlapping(geometry.tree.octree(), mayBeNear,
                     [&](std::uint32_t begin, std::uint32_t end) {
                       for (std::uint32_t i = begin; i < end; ++i)
                         if (mayBeNear(geometry.tree.octree().boxes()[i]))
                           out.push_back(geometry.tree.octree().order()[i]);
                     });
}

void findElementsNear(const Body& geometry, const Eigen::AlignedBox3d& box, bool wholeStep,
                      Buffer<std::uint32_t>& out) {
  const Eigen::Vector3d origin = worldOrigin(geometry);
  const BoxMap map = worldMap(geometry, origin, 0.0, wholeStep);
  const double unit = 1.0 / geometry.tree.frame().scale,
               error = kShapeBoundError *
                       (box.min().cwiseAbs().maxCoeff() + box.max().cwiseAbs().maxCoeff() +
                        2.0 * origin.cwiseAbs().maxCoeff());
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(error),
                        lower = box.min() - origin - margin, upper = box.max() - origin + margin;
  const auto mayBeNear = [&](const FloatBox& stored) {
    if (stored.empty()) return false;
    const FloatBox floats = map(stored);
    if (floats.mayBeClamped()) return true;
    for (int k = 0; k < 3; ++k)
      if (unit * double{floats.lower[k]} > upper[k] || unit * double{floats.upper[k]} < lower[k])
        return false;
    return true;
  };
  out.clear();
  if (geometry.tree.octree().size() == 0) return;
  forEachOverlapping(geometry.tree.octree(), mayBeNear,
                     [&](std::uint32_t begin, std::uint32_t end) {
                       for (std::uint32_t i = begin; i < end; ++i)
                         if (mayBeNear(geometry.tree.octree().boxes()[i]))
                           out.push_back(geometry.tree.octree().order()[i]);
                     });
}

}  // namespace palpate
