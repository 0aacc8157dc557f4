#include "C/Handles.h"

namespace palpate::c {

Pose poseOf(const palpate_pose* pose, const char* name) {
  given(pose, name);
  Pose result;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      result.rotation(row, column) = pose->rotation[row][column];
  result.translation = vector(pose->translation, name);
  return result;
}

palpate_pose fromPose(const Pose& pose) {
  palpate_pose result;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      result.rotation[row][column] = pose.rotation(row, column);
  fromVector(pose.translation, result.translation);
  return result;
}

RigidMotion motionOf(const palpate_motion* motion, const char* name) {
  given(motion, name);
  return {poseOf(&motion->before, name), poseOf(&motion->now, name)};
}

palpate_motion fromMotion(const RigidMotion& motion) {
  return {fromPose(motion.before), fromPose(motion.now)};
}

AnalyticalGeometry shapeOf(const palpate_shape* shape) {
  sized(shape, "the shape");
  const Eigen::Vector3d p0 = vector(shape->p0, "p0"), p1 = vector(shape->p1, "p1");
  switch (shape->kind) {
    case PALPATE_SPHERE:
      return Sphere{p0, shape->radius};
    case PALPATE_CAPSULE:
      return Capsule{p0, p1, shape->radius};
    case PALPATE_PLANE:
      return Plane{p0, p1, shape->two_sided != 0};
    case PALPATE_BOX:
      return Box{p0, p1};
    case PALPATE_CYLINDER:
      return Cylinder{p0, p1, shape->radius};
    case PALPATE_HULL: {
      const auto points = positions(shape->points, shape->point_count, "points");
      return ConvexHull{{points.begin(), points.end()}};
    }
    default:
      throw InvalidArgument("kind is " + std::to_string(shape->kind) + "; it must be in [0, " +
                            std::to_string(PALPATE_HULL) + "].");
  }
}

}  // namespace palpate::c
