#include "Math/MeetingAfter.h"

#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <limits>

namespace palpate {

namespace {

using Eigen::Vector3d;
using Kind = ImpactQuery::Kind;

/// By how much a plane with this normal, which leads from the second feature to the first,
/// separates them at a time of the step, less rounding. L, times the normal's length.
double separation(const ImpactQuery& query, double time, const Vector3d& normal) {
  const int ofFirst = query.kind == Kind::VertexTriangle ? 1 : 2;
  const auto& last = query.vertices[3];
  double least = std::numeric_limits<double>::infinity(), most = 0.0, size = 0.0;
  for (int i = 0; i < 3; ++i) {
    const Vector3d before = query.vertices[i].before - last.before,
                   now = query.vertices[i].now - last.now;
    const double height = (1.0 - time) * normal.dot(before) + time * normal.dot(now);
    (i < ofFirst) ? least = std::min(least, height) : most = std::max(most, height);
    size = std::max(size, before.lpNorm<1>() + now.lpNorm<1>());
  }
  return least - most - 4.0 * kMotionError * size * normal.norm();
}

bool isSeparating(const ImpactQuery& query, double time, const Vector3d& normal, double distance) {
  return separation(query, time, normal) > distance * normal.norm();
}

/// From the second feature to the first, at their closest points at a time of the step.
Vector3d differenceAt(const ImpactQuery& query, double time) {
  const auto at = [&](int i) -> Vector3d {
    return (1.0 - time) * query.vertices[i].before + time * query.vertices[i].now;
  };
  if (query.kind == Kind::VertexTriangle)
    return finiteVertexTriangleDistance(at(0), at(1), at(2), at(3)).difference;
  return finiteEdgeEdgeDistance(at(0), at(1), at(2), at(3)).difference;
}

/// Whether features may come within their radii between two times of the step. They do not if one
/// plane separates them at both: the vertices move in straight lines. The interval is halved a few
/// times. first, last: unit, between the closest points at both times.
bool mayMeetBetween(const ImpactQuery& query, double begin, double end, const Vector3d& first,
                    const Vector3d& last, double radii, int halvings) {
  for (const Vector3d& normal : {Vector3d(first + last), last, first})
    if (isSeparating(query, end, normal, radii) && isSeparating(query, begin, normal, radii))
      return false;
  if (halvings == 0) return true;
  const double middle = 0.5 * (begin + end);
  const Vector3d between = stableUnit(differenceAt(query, middle));
  return mayMeetBetween(query, begin, middle, first, between, radii, halvings - 1) ||
         mayMeetBetween(query, middle, end, between, last, radii, halvings - 1);
}

}  // namespace

bool mayMeetAfter(const ImpactQuery& query, double time, const Vector3d& normal, double distance,
                  double radii) {
  // The plane across the normal separates features of this distance, up to rounding.
  if (!(distance > radii)) return true;
  if (separation(query, 1.0, normal) > radii) return !isSeparating(query, time, normal, radii);
  const Vector3d last = stableUnit(differenceAt(query, 1.0));
  constexpr int kHalvings = 3;
  return mayMeetBetween(query, time, 1.0, normal, last, radii, kHalvings);
}

}  // namespace palpate
