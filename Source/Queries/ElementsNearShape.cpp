#include "Queries/ElementsNearShape.h"

#include "Bodies/OctreeFrame.h"
#include "Shapes/ShapeStep.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

namespace palpate {

namespace {

/// Finds the elements whose boxes `mayBeNear` accepts, in L relative to the frame's origin, and
/// those whose boxes may hold anything.
template <class MayBeNear>
void findBoxes(const Body& geometry, const OctreeFrame& frame, bool wholeStep,
               Buffer<std::uint32_t>& out, MayBeNear&& mayBeNear) {
  const Octree& octree = geometry.tree.octree();
  const BoxMap map = frame.toWorld(wholeStep);
  const auto isWanted = [&](const FloatBox& stored) {
    if (stored.empty()) return false;
    const auto box = frame.lengthsOf(map(stored));
    return !box || mayBeNear(*box);
  };
  out.clear();
  if (octree.size() == 0) return;
  forEachOverlapping(octree, isWanted, [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i)
      if (isWanted(octree.boxes()[i])) out.push_back(octree.order()[i]);
  });
}

}  // namespace

void findElementsNear(const Body& geometry, const Shape& before, const Shape& now,
                      double maxDistance, Buffer<std::uint32_t>& out) {
  using Eigen::Vector3d;
  const bool wholeStep = &before != &now;
  const OctreeFrame frame(geometry);
  const Vector3d& origin = frame.origin();
  const double error =
      2.0 * kShapeBoundError *
      (before.magnitude() + now.magnitude() + maxDistance + 2.0 * origin.cwiseAbs().maxCoeff());
  Eigen::AlignedBox3d swept;
  for (const Shape* shape : {&before, &now})
    for (const Vector3d& corner : shape->corners()) swept.extend(corner - origin);
  const ShapeStep step(before, now);
  const Vector3d grown = Vector3d::Constant(maxDistance + now.radius() + error);
  swept = {swept.min() - grown, swept.max() + grown};
  findBoxes(geometry, frame, wholeStep, out, [&](const Eigen::AlignedBox3d& box) {
    if (wholeStep && now.isPlane())
      return step.mayComeNear({box.min() + origin, box.max() + origin}, maxDistance);
    if (wholeStep) {
      // What ShapeStep::firstTimeWithin() allows features of this size, and the roundings here.
      const Vector3d margin = Vector3d::Constant(
          4.0 * kShapeBoundError * box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff());
      return swept.intersects({box.min() - margin, box.max() + margin});
    }
    if (!now.isPlane() && !swept.intersects(box)) return false;  // costs less than a distance
    const Vector3d centre = box.center() + origin;
    const PointShapeDistance at = now.signedDistance(centre);
    const double size = centre.cwiseAbs().maxCoeff() + box.sizes().sum();
    return !(at.distance - 0.5 * at.normal.cwiseAbs().dot(box.sizes()) >
             maxDistance + error + kShapeBoundError * size);  // NaN: it may
  });
}

void findElementsNear(const Body& geometry, const Eigen::AlignedBox3d& box, bool wholeStep,
                      Buffer<std::uint32_t>& out) {
  const OctreeFrame frame(geometry);
  const Eigen::Vector3d& origin = frame.origin();
  const double error =
      kShapeBoundError * (box.min().cwiseAbs().maxCoeff() + box.max().cwiseAbs().maxCoeff() +
                          2.0 * origin.cwiseAbs().maxCoeff());
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(error);
  const Eigen::AlignedBox3d grown(box.min() - origin - margin, box.max() - origin + margin);
  findBoxes(geometry, frame, wholeStep, out,
            [&](const Eigen::AlignedBox3d& element) { return grown.intersects(element); });
}

}  // namespace palpate
