#include "Queries/HullSeparation.h"

#include "Math/StableLength.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <array>
#include <span>

namespace palpate {

using Eigen::Vector3d;

namespace {

constexpr std::size_t kMaxPoints = 512;
/// Of points of about 1: above the roundings of heights. The direction to an origin that is as near
/// to a face is no more than rounding.
constexpr double kSameHeight = 0x1p-50;

class SupportDifference {
 public:
  SupportDifference(const Support& a, const Support& b) : m_a(a), m_b(b) {}

  Vector3d furthest(const Vector3d& direction) const { return m_a(direction) - m_b(-direction); }

  /// Four points with a volume. Returns false if there are none.
  bool start(std::array<Vector3d, 4>& p) const {
    p[0] = furthest(Vector3d::UnitX());
    const std::array<Vector3d, 3> axes{Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()};
    if (!extend(p[1], axes, [&](const Vector3d& q) { return stableLength(q - p[0]); }))
      return false;
    const Vector3d along = (p[1] - p[0]) / stableLength(p[1] - p[0]);
    const Vector3d across = along.unitOrthogonal();
    const std::array<Vector3d, 2> both{across, along.cross(across)};
    if (!extend(p[2], both, [&](const Vector3d& q) { return stableLength(along.cross(q - p[0])); }))
      return false;
    const std::array<Vector3d, 1> flat{along.cross(p[2] - p[0]).normalized()};
    SignCounts counts;
    return extend(p[3], flat, [&](const Vector3d& q) { return std::abs(flat[0].dot(q - p[0])); }) &&
           orient3d(p[0], p[1], p[2], p[3], counts) != 0;
  }

 private:
  template <class Measure>
  bool extend(Vector3d& best, std::span<const Vector3d> directions, Measure&& measure) const {
    double most = 0;
    for (const Vector3d& direction : directions)
      for (const double sign : {1.0, -1.0}) {
        const Vector3d p = furthest(sign * direction);
        if (!(measure(p) > most)) continue;
        most = measure(p);
        best = p;
      }
    return most > 0;
  }

  const Support &m_a, &m_b;
};

}  // namespace

HullSeparation separateHulls(const Support& a, const Support& b, double wanted,
                             Polytope& polytope) {
  PALPATE_ASSERT(wanted >= 0.0);
  const SupportDifference difference(a, b);
  std::array<Vector3d, 4> first;
  if (!difference.start(first)) return {Vector3d::Zero(), 0.0, 0.0};
  polytope.start(first);
  for (;;) {
    const PointShapeDistance origin = polytope.signedDistance(Vector3d::Zero(), kSameHeight);
    const Vector3d point = difference.furthest(origin.normal);
    const double height = origin.normal.dot(point), gap = height + origin.distance;
    if (!(gap > wanted) || polytope.points().size() >= kMaxPoints || !polytope.add(point))
      return {-origin.normal, height, gap};
  }
}

}  // namespace palpate
