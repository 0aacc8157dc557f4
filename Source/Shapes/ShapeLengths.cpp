#include "Shapes/ShapeLengths.h"

#include <algorithm>

namespace palpate {

using Eigen::Vector3d;

LengthAndDirection polarOfAnyLength(const Vector3d& v) {
  const double extent = largest(v);
  if (extent == 0.0) return {0.0, Vector3d::Zero()};
  const int exponent = exponentTowardsOne(extent);
  const Vector3d moderate = scaled(v, exponent);
  const double length = moderate.norm();
  return {std::ldexp(length, -exponent), moderate / length};
}

double signedDotOfAnyLength(const Vector3d& a, const Vector3d& b) {
  const double ofA = largest(a), ofB = largest(b);
  if (ofA == 0.0 || ofB == 0.0) return 0.0;
  return scaled(a, exponentTowardsOne(ofA)).dot(scaled(b, exponentTowardsOne(ofB)));
}

double weightOnAnyAxis(const Vector3d& from, const Vector3d& along) {
  const int exponent = exponentTowardsOne(std::max(largest(from), largest(along)));
  const Vector3d moderateAlong = scaled(along, exponent);
  const double square = moderateAlong.squaredNorm();
  if (!(square > 0.0)) return 0.0;  // compared to the distance, the axis is a point
  return std::clamp(scaled(from, exponent).dot(moderateAlong) / square, 0.0, 1.0);
}

}  // namespace palpate
