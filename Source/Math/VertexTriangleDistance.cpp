// Part of Math/ClosestPoint.h: the distance of a vertex and a triangle.
#include "Math/ClosestPoint.h"
#include "Math/ExactClosestPoint.h"
#include "Math/Foot.h"
#include "Math/Tolerances.h"
#include "Exact/FilteredSigns.h"
#include "Core/FloatingPoint.h"

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>

namespace palpate {

namespace {

using Eigen::Vector3d;

using CornerPointers = std::array<const Vector3d*, 3>;

struct FeatureDecision {
  TriangleFeature feature;
  bool exact;
};

FeatureDecision closestFeature(const Vector3d& p, const CornerPointers& corners) {
  std::array<Vector3d, 3> edge, from;
  for (int i = 0; i < 3; ++i) {
    edge[i] = *corners[(i + 1) % 3] - *corners[i];
    from[i] = p - *corners[i];
  }
  const auto exactly = [&] {
    return FeatureDecision{exact::closestFeature(p, *corners[0], *corners[1], *corners[2]), true};
  };
  const Vector3d normal = edge[0].cross(edge[1]);
  const double magnitude = sumOfMagnitudes(edge[0]) * sumOfMagnitudes(edge[1]);
  bool inside = true;
  for (int i = 0; i < 3; ++i) {
    const Sign side = signAside(edge[i], from[i], normal, magnitude);
    if (side == Sign::Positive) continue;
    inside = false;
    const Sign start = signAlong(from[i], edge[i]);
    const Sign end = signAlong(from[(i + 1) % 3], -edge[i]);
    if (start == Sign::NotPositive || end == Sign::NotPositive) continue;
    if (side == Sign::Unknown || start == Sign::Unknown || end == Sign::Unknown) return exactly();
    return {static_cast<TriangleFeature>(3 + i), false};
  }
  if (inside) return {TriangleFeature::Face, false};
  for (int i = 0; i < 3; ++i) {
    if (signAlong(from[i], edge[i]) == Sign::NotPositive &&
        signAlong(from[i], -edge[(i + 2) % 3]) == Sign::NotPositive)
      return {static_cast<TriangleFeature>(i), false};
  }
  return exactly();
}

/// Squared lengths in a common unit in which none overflows or vanishes.
std::array<double, 3> squares(const std::array<Vector3d, 3>& a) {
  const double extent = std::max({largest(a[0]), largest(a[1]), largest(a[2])});
  if (isModerate(extent)) return {dot(a[0], a[0]), dot(a[1], a[1]), dot(a[2], a[2])};
  std::array<double, 3> result;
  for (int i = 0; i < 3; ++i) {
    const Vector3d moderate = scaled(a[i], exponentTowardsOne(extent));
    result[i] = dot(moderate, moderate);
  }
  return result;
}

/// The corner opposite the longest edge, where the two shortest edges meet. If edges are equal, the
/// distance from p decides, then the coordinates, never the order of the corners.
int widestCorner(const Vector3d& p, const CornerPointers& corners) {
  const auto& [a, b, c] = corners;
  const std::array<double, 3> opposite = squares({*b - *c, *c - *a, *a - *b}),
                              from = squares({p - *a, p - *b, p - *c});
  const auto rank = [&](int i) {
    const Vector3d& at = *corners[i];
    return std::tuple(opposite[i], from[i], at[0], at[1], at[2]);
  };
  const auto first = rank(0), second = rank(1), third = rank(2);
  if (first >= second && first >= third) return 0;
  return second >= third ? 1 : 2;
}

Vector3d windingNormal(const Vector3d& p, const CornerPointers& corners) {
  const int i = widestCorner(p, corners);
  const Vector3d &a = *corners[i], &b = *corners[(i + 1) % 3], &c = *corners[(i + 2) % 3];
  const Vector3d normal = unitCross(a, b, a, c);
  if (normal != Vector3d::Zero()) return normal;
  // Halved, so that the extent of the largest doubles stays finite.
  return axisOfLeastComponent(0.5 * a.cwiseMax(b).cwiseMax(c) - 0.5 * a.cwiseMin(b).cwiseMin(c));
}

}  // namespace

Vector3d windingNormal(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return windingNormal(a, {&a, &b, &c});
}

TriangleFeature closestTriangleFeature(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                                       const Vector3d& c) {
  return closestFeature(p, {&a, &b, &c}).feature;
}

bool hasArea(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return unitCross(a, b, a, c) != Vector3d::Zero();
}

bool comesNearer(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Sign sign = signAlong(p - a, b - a);
  return sign == Sign::Unknown ? exact::along(p, a, b) > 0 : sign == Sign::Positive;
}

bool liesInwards(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a;
  const Sign sign = signAside(ab, p - a, ab.cross(ac), sumOfMagnitudes(ab) * sumOfMagnitudes(ac));
  return sign == Sign::Unknown ? exact::side(p, a, b, c) > 0 : sign == Sign::Positive;
}

VertexTriangleDistance finiteVertexTriangleDistance(const Vector3d& p, const Vector3d& a,
                                                    const Vector3d& b, const Vector3d& c) {
  const CornerPointers corners{&a, &b, &c};
  const FeatureDecision decision = closestFeature(p, corners);
  const int feature = static_cast<int>(decision.feature);
  Vector3d weights = Vector3d::Zero();
  Foot foot;
  if (feature < 3) {
    foot = footOnPoint(p, *corners[feature]);
    weights[feature] = 1.0;
  } else if (feature < 6) {
    const int i = feature - 3, j = (i + 1) % 3;
    foot = footOnLine(p, *corners[i], *corners[j]);
    weights[i] = 1.0 - foot.s;
    weights[j] = foot.s;
  } else {
    const int i = widestCorner(p, corners), j = (i + 1) % 3, k = (i + 2) % 3;
    foot = footOnFace(p, *corners[i], *corners[j], *corners[k]);
    weights[j] = foot.s;
    weights[k] = foot.t;
    // Rounding may push the sum past 1 by kWeightStep, which the sum itself would lose.
    weights[foot.s > foot.t ? j : k] -= std::max(0.0, foot.s - (1.0 - foot.t));
    weights[i] = (1.0 - weights[j]) - weights[k];
  }
  const Vector3d normal = foot.distance == 0.0 ? windingNormal(p, corners) : foot.direction;
  return {weights,       foot.difference,  normal,
          foot.distance, decision.feature, decision.exact || foot.exact};
}

VertexTriangleDistance vertexTriangleDistance(const Vector3d& p, const Vector3d& a,
                                              const Vector3d& b, const Vector3d& c) {
  const StandardFloatingPoint standard;
  if (areFinite(p, a, b, c)) return standard.evaluated(finiteVertexTriangleDistance(p, a, b, c));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Vector3d none = Vector3d::Constant(nan);
  return {none, none, none, nan, TriangleFeature::CornerA, false};
}

}  // namespace palpate
