#include "Queries/OctreeRay.h"

#include "Bodies/OctreeFrame.h"

#include <cmath>
#include <limits>
#include <memory>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Moves `enter` and `leave` to where a ray enters a box that is grown by `slack`, and leaves it.
/// Where it does not enter, `leave` is then less.
void clipTo(const FloatBox& box, double slack, const Vector3d& origin, const Vector3d& direction,
            double& enter, double& leave) {
  for (int k = 0; k < 3; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const double lower = box.lower[at] - slack, upper = box.upper[at] + slack;
    if (direction[k] == 0.0) {
      if (origin[k] < lower || origin[k] > upper) leave = -std::numeric_limits<double>::infinity();
      continue;
    }
    const double s = (lower - origin[k]) / direction[k], t = (upper - origin[k]) / direction[k];
    const double margin = kNearestError * std::max(std::abs(s), std::abs(t));
    enter = std::max(enter, std::min(s, t) - margin);
    leave = std::min(leave, std::max(s, t) + margin);
  }
}

}  // namespace

bool OctreeRay::clip(const Body& body, const RaySegment& ray, double radius, FloatRay& clipped,
                     LineFilter& line) {
  std::construct_at(&line);  // in place here and below, as a copy would wait for each part
  const OctreeFrame frame(body);
  const FloatBox root = body.tree.octree().box(0);
  double extent = root.reach();
  const double error = frame.error() + (body.isPlaced() ? 4.0 * kOrthonormal * extent : 0.0);
  Vector3d origin = frame.toFrame(ray.origin), direction = frame.turned(ray.direction);
  Eigen::Index axis;
  const double length = direction.cwiseAbs().maxCoeff(&axis), scaled = length * frame.scale();
  direction /= length;
  extent += radius * frame.scale();
  // A ray from far away begins where it enters the grown root box.
  double enter = ray.tMin * scaled, leave = ray.tMax * scaled;
  const double far = origin.cwiseAbs().maxCoeff(), reach = far + std::abs(enter);
  const bool isNear = reach <= 4.0 * extent;
  // With S the extent and the reach, all coordinates are at most S, and t grows by at most three
  // times that. Its floats err by at most 2^-20 of it; kFloatRayError has a margin. The rest are
  // errors of the origin in double.
  const double doubleError =
      kPlacedPointError * far + error + radius * (1.0 + kNearestError) * frame.scale();
  const double slack =
      kFloatRayError * (extent + (isNear ? reach : 0.0)) + doubleError + OutwardRounding::kAbsolute;
  clipped.slack = OutwardRounding::up(slack);
  perT = scaled;
  if (!(extent < kLargestFloat) || !(perT >= 0x1p-900) || !(perT <= 0x1p900) ||
      !(slack < kLargestFloat)) {  // every box is entered at once
    clipped.origin = {};
    clipped.inverse = {1, 1, 1};
    clipped.slack = clipped.tMax = std::numeric_limits<float>::infinity();
    perT = start = 0.0;
    return true;
  }
  for (int k = 0; k < 3; ++k) {
    // A smaller component moves the ray by less than the slack.
    const double least = std::copysign(std::max(std::abs(direction[k]), 0x1p-100), direction[k]);
    clipped.inverse[static_cast<std::size_t>(k)] = 1.0f / static_cast<float>(least);
  }
  if (!isNear) clipTo(root, slack, origin, direction, enter, leave);
  if (!(enter <= leave)) return false;
  start = enter;
  clipped.tMax = OutwardRounding::up((leave - enter) * (1.0 + kNearestError));
  origin += enter * direction;
  for (int k = 0; k < 3; ++k)
    clipped.origin[static_cast<std::size_t>(k)] = static_cast<float>(origin[k]);
  if (radius == 0) {
    const double unit = frame.unit(), most = extent + origin.cwiseAbs().maxCoeff();
    const Vector3d& zero = body.tree.frame().origin;
    std::construct_at(&line, unit * origin + zero, direction, static_cast<int>(axis), unit * most,
                      unit * (doubleError + kPlacedPointError * most) +
                          kPlacedPointError * zero.cwiseAbs().maxCoeff());
  }
  return true;
}

}  // namespace palpate
