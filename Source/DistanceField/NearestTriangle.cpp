#include "DistanceField/NearestTriangle.h"

#include "Math/Tolerances.h"
#include "Queries/NearestElements.h"
#include "Queries/PointDistances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "DistanceField/NearestTriangle.cpp"
#include "Core/Simd.h"
#include "DistanceField/TriangleLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

/// q is a point of the triangle near the closest one, less p, however rounded. No point of the
/// triangle is nearer than its least corner along q, which gives the lower bound.
HWY_ATTR void distanceBoundsKernel(const double (&p)[3], const TriangleBatch& batch,
                                   std::size_t count, DistanceBounds& bounds) {
  const SetTag d;
  const Vectors point{hn::Set(d, p[0]), hn::Set(d, p[1]), hn::Set(d, p[2])};
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    TrianglesInLanes set = TrianglesInLanes::load(batch.corners, i);
    set = {set.a - point, set.b - point, set.c - point};
    const Vectors q = set.nearest();
    const V length = hn::Sqrt(dot(q, q));
    const V least = hn::Min(dot(set.a, q), hn::Min(dot(set.b, q), dot(set.c, q))) / length;
    const V furthest =
        hn::Sqrt(hn::Max(dot(set.a, set.a), hn::Max(dot(set.b, set.b), dot(set.c, set.c))));
    const V error = hn::Set(d, kNearestSlack) * furthest;
    const V lower = least - error;
    hn::Store(length, d, &bounds.distance[i]);
    // Comparisons with NaN are false: the lower bound is then 0.
    hn::Store(hn::IfThenElseZero(hn::Gt(lower, hn::Zero(d)), lower), d, &bounds.lower[i]);
    hn::Store(error, d, &bounds.error[i]);
  }
  leaveLanes();
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

using Eigen::Vector3d;

HWY_EXPORT(distanceBoundsKernel);

DistanceBounds::DistanceBounds(const Vector3d& p, const TriangleBatch& triangles,
                               std::size_t count) {
  PALPATE_ASSERT(count <= TriangleBatch::kSize);
  const double coordinates[] = {p[0], p[1], p[2]};
  HWY_DYNAMIC_DISPATCH(distanceBoundsKernel)(coordinates, triangles, count, *this);
}

NearestTriangle::NearestTriangle(const Body& geometry, double tolerance)
    : m_geometry(geometry), m_tolerance(tolerance), m_largest(0) {
  PALPATE_ASSERT(geometry.tree.octree().isBuilt() && !geometry.isPlaced());
  PALPATE_ASSERT(geometry.mesh.largestRadius == 0.0 && tolerance >= 0.0);
  const FloatBox root = geometry.tree.octree().box(0);
  for (int k = 0; k < 3; ++k)
    m_largest = std::max({m_largest, std::abs(root.lower[k]), std::abs(root.upper[k])});
}

NearestTriangle::Near NearestTriangle::at(const Vector3d& point,
                                          std::span<const std::uint32_t> likely) const {
  const Positions& now = m_geometry.mesh.now;
  const FloatFrame& frame = m_geometry.tree.frame();
  Near best{kInfinity, 0};
  PALPATE_ASSERT(likely.size() <= TriangleBatch::kSize);
  double lower = kInfinity, upper = kInfinity;
  const auto test = [&](const TriangleBatch& batch, std::span<const std::uint32_t> places) {
    const DistanceBounds bounds(point, batch, places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
      lower = std::min(lower, bounds.lower[i]);
      if (!(bounds.distance[i] < best.distance)) continue;
      best = {bounds.distance[i], places[i]};
      upper = bounds.distance[i] + bounds.error[i];
    }
  };
  TriangleBatch batch;
  const auto set = [&](std::size_t i, std::uint32_t place) {
    const Triangle& corners = m_geometry.tree.ordered()[place];
    batch.set(i, now[corners[0]], now[corners[1]], now[corners[2]]);
  };
  for (std::size_t i = 0; i < likely.size(); ++i) set(i, likely[i]);
  test(batch, likely);

  const FloatPoint p = frame(point);
  const float largest = std::max({m_largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  const float slack = largest >= kLargestFloat
                          ? std::numeric_limits<float>::infinity()
                          : largest * kFloatPointError + OutwardRounding::kAbsolute;
  const auto bound = [&] {
    return OutwardRounding::up(static_cast<float>(upper * frame.scale * (1 + kNearestError)));
  };
  const NearestSearch search{m_geometry.tree.octree(), m_geometry.tree.floats(),
                             m_geometry.tree.ordered().data(), p, slack};
  forNearCandidates(search, bound(), 1, [&](const NearCandidate* all, std::size_t size) {
    std::array<std::uint32_t, TriangleBatch::kSize> places;
    for (std::size_t i = 0; i < size;) {
      const float most = bound();
      std::size_t some = 0;
      for (; i < size && some < places.size(); ++i)
        if (!(all[i].lower > most)) {
          set(some, all[i].place);
          places[some++] = all[i].place;
        }
      if (some > 0) test(batch, std::span(places).first(some));
    }
    return bound();
  });
  if (best.distance - lower <= m_tolerance) return best;
  const auto exact = PointDistances(m_geometry, point, false).nearest(kInfinity, best.place);
  PALPATE_ASSERT(exact.has_value());
  return {exact->distance, exact->place};
}

}  // namespace palpate
#endif
