#include "Math/DistanceBounds.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Math/DistanceBounds.cpp"
#include "Core/Simd.h"
#include "Math/TriangleLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

/// q is a point of the triangle near the closest one, less p, however rounded. No point of the
/// triangle is nearer than its least corner along q, which gives the lower bound.
HWY_ATTR void distanceBoundsKernel(const double (&p)[3], const TriangleBatch& batch,
                                   std::size_t count, DistanceBounds& bounds) {
  const hn::CappedTag<double, TriangleBatch::kSize> d;
  using Triangles = TrianglesInLanes<hn::CappedTag<double, TriangleBatch::kSize>>;
  const Triangles::Vectors point{hn::Set(d, p[0]), hn::Set(d, p[1]), hn::Set(d, p[2])};
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    Triangles set = Triangles::load(batch.corners, i);
    set = {set.a - point, set.b - point, set.c - point};
    const auto q = set.nearest();
    const auto length = hn::Sqrt(dot(q, q));
    const auto error = hn::Set(d, kNearestSlack) * set.furthest(),
               lower = set.leastAlong(q) / length - error;
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

HWY_EXPORT(distanceBoundsKernel);

DistanceBounds::DistanceBounds(const Eigen::Vector3d& p, const TriangleBatch& triangles,
                               std::size_t count) {
  PALPATE_ASSERT(count <= TriangleBatch::kSize);
  const double coordinates[] = {p[0], p[1], p[2]};
  HWY_DYNAMIC_DISPATCH(distanceBoundsKernel)(coordinates, triangles, count, *this);
}

}  // namespace palpate
#endif
