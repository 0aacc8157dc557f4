#include "Math/ImpactFilter.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Math/ImpactFilter.cpp"
#include "Core/Simd.h"
#include "Math/ImpactFormulas.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace impact_filter {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, ImpactBlock::kLanes>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

using Point = Vector3<V>;
/// A point at the start and at the end of the step.
struct Ends {
  Point at[2];
};

HWY_INLINE V largest(V a, V b) { return hn::Max(hn::Abs(a), hn::Abs(b)); }
HWY_INLINE Point largest(const Point& a, const Point& b) {
  return {largest(a.x, b.x), largest(a.y, b.y), largest(a.z, b.z)};
}
HWY_INLINE Point largest(const Ends& ends) { return largest(ends.at[0], ends.at[1]); }
/// l / r clamped to [0, 1]. Any value in [0, 1] if the divisor is not positive.
HWY_INLINE V clampedQuotient(V l, V r) {
  const D d;
  const V quotient = hn::Div(l, hn::Max(r, hn::Set(d, kShortestDirection)));
  return hn::Min(hn::Max(quotient, hn::Zero(d)), hn::Set(d, 1.0));
}
HWY_INLINE Point awayFromSegment(const Point& point, const Point& segment) {
  return point - clampedQuotient(dot(point, segment), dot(segment, segment)) * segment;
}
HWY_INLINE Point nearer(const Point& l, const Point& r) {
  const M first = hn::Lt(dot(l, l), dot(r, r));
  return {hn::IfThenElse(first, l.x, r.x), hn::IfThenElse(first, l.y, r.y),
          hn::IfThenElse(first, l.z, r.z)};
}

/// As many queries as a vector has lanes.
template <ImpactQuery::Kind kind>
class FilterLanes {
 public:
  HWY_INLINE FilterLanes(const ImpactBlock& block, int lane) : m_block(block), m_lane(lane) {}

  /// Whether all corners are always further than the distance to one side along some coordinate, by
  /// the same criterion as in findTouch() and findApproach().
  HWY_INLINE M separatedByBoxes(double distance) const {
    const D d;
    constexpr auto kCorners = ImpactQuery::corners(kind);
    const V limit = hn::Set(d, distance),
            error = hn::Set(d, distance > 0.0 ? kApproachBoxError : 0.0);
    M separated = hn::Lt(limit, limit);  // none
    for (int k = 0; k < 3; ++k) {
      M above = hn::Eq(limit, limit), below = above;
      for (int i = 0; i < cornerCount(); ++i) {
        const V first = coordinate(kCorners[i], 0, k), last = coordinate(kCorners[i], 1, k);
        const V needed = limit + error * (largest(first, last) + limit);
        above = hn::And(above, hn::Gt(hn::Min(first, last), needed));
        below = hn::And(below, hn::Lt(hn::Max(first, last), hn::Neg(needed)));
      }
      separated = hn::Or(separated, hn::Or(above, below));
    }
    return separated;
  }

  /// Whether det(A, B, C) certainly has one sign throughout the step.
  HWY_INLINE M neverCoplanar() const {
    const D d;
    constexpr auto kAxes = ImpactQuery::axes(kind);
    const Ends a = difference(kAxes[0]), b = difference(kAxes[1]), c = difference(kAxes[2]);
    const Point p = largest(a), q = largest(b), r = largest(c);
    const auto [f, permanent] = coplanarityOf(a.at, b.at, c.at, p, q, r, hn::Set(d, 3.0));
    const V least = hn::Min(hn::Min(f[0], f[1]), hn::Min(f[2], f[3])),
            most = hn::Max(hn::Max(f[0], f[1]), hn::Max(f[2], f[3]));
    const V error = permanent * hn::Set(d, kCoplanarityError) + hn::Set(d, kImpactUnderflow);
    const V magnitude = hn::Max(hn::Max(hn::Max(p.x, p.y), hn::Max(p.z, q.x)),
                                hn::Max(hn::Max(q.y, q.z), hn::Max(r.x, hn::Max(r.y, r.z))));
    return hn::And(hn::Or(hn::Gt(least, error), hn::Lt(most, hn::Neg(error))),
                   hn::Le(magnitude, hn::Set(d, kLargestImpactDifference)));
  }

  /// Whether all corners are always further along a fixed direction than the distance, and than
  /// findApproach() may report. Any direction is valid.
  HWY_INLINE M separatedAlong(const Point& direction, double distance, double tolerance) const {
    const D d;
    constexpr auto kCorners = ImpactQuery::corners(kind);
    V least = hn::Set(d, std::numeric_limits<double>::infinity()), most = hn::Neg(least);
    Point largestCorner{hn::Zero(d), hn::Zero(d), hn::Zero(d)}, displacement = largestCorner;
    for (int i = 0; i < cornerCount(); ++i) {
      const Ends corner = difference(kCorners[i]);
      const V first = dot(direction, corner.at[0]), last = dot(direction, corner.at[1]);
      least = hn::Min(least, hn::Min(first, last));
      most = hn::Max(most, hn::Max(first, last));
      largestCorner = largest(largestCorner, largest(corner));
      displacement = largest(displacement, corner.at[1] - corner.at[0]);
    }
    const V lengthSquared = dot(direction, direction);
    const V farthest = hn::Max(largestCorner.x, hn::Max(largestCorner.y, largestCorner.z));
    const V approach = hn::Sqrt(dot(displacement, displacement)) * hn::Set(d, tolerance) +
                       (farthest + hn::Set(d, distance)) * hn::Set(d, kApproachError);
    const V needed = (hn::Set(d, distance) + approach) * hn::Sqrt(lengthSquared);
    const Point size{hn::Abs(direction.x), hn::Abs(direction.y), hn::Abs(direction.z)};
    const V limit = (dot(size, largestCorner) + needed) * hn::Set(d, kAlongError) +
                    (needed + hn::Set(d, kImpactUnderflow));
    const V magnitude = hn::Max(farthest, hn::Max(size.x, hn::Max(size.y, size.z)));
    const M inRange =
        hn::And(hn::Le(magnitude, hn::Set(d, kLargestImpactDifference)),
                hn::Gt(lengthSquared, hn::Set(d, kShortestDirection * kShortestDirection)));
    return hn::And(hn::Or(hn::Gt(least, limit), hn::Lt(most, hn::Neg(limit))), inRange);
  }

  /// A x B at half time.
  HWY_INLINE Point normalHalfway() const {
    constexpr auto kAxes = ImpactQuery::axes(kind);
    return cross(halfway(kAxes[0]), halfway(kAxes[1]));
  }

  /// Approximately the vector between the features' closest points at half time, if these are on
  /// the features' borders.
  HWY_INLINE Point gapHalfway() const {
    constexpr auto kAxes = ImpactQuery::axes(kind);
    const Point a = halfway(kAxes[0]), b = halfway(kAxes[1]), c = halfway(kAxes[2]);
    if constexpr (kind == ImpactQuery::Kind::EdgeEdge) {
      const V aa = dot(a, a), bb = dot(b, b), ab = dot(a, b), ac = dot(a, c), bc = dot(b, c);
      const V x = clampedQuotient(ac * bb - bc * ab, aa * bb - ab * ab);
      const V y = clampedQuotient(bc - x * ab, bb);
      return awayFromSegment(c - y * b, a);
    } else {
      const Point p = nearer(awayFromSegment(c, a), awayFromSegment(c, b));
      return nearer(p, awayFromSegment(c - a, b - a));
    }
  }

 private:
  static constexpr int cornerCount() { return kind == ImpactQuery::Kind::EdgeEdge ? 4 : 3; }
  HWY_INLINE V coordinate(const ImpactQuery::Difference& vertices, int end, int k) const {
    const D d;
    return hn::Load(d, &m_block.positions[vertices[0]][end][k][m_lane]) -
           hn::Load(d, &m_block.positions[vertices[1]][end][k][m_lane]);
  }
  HWY_INLINE Point halfway(const ImpactQuery::Difference& v) const {
    const Ends ends = difference(v);
    return hn::Set(D(), 0.5) * (ends.at[0] + ends.at[1]);
  }
  HWY_INLINE Ends difference(const ImpactQuery::Difference& v) const {
    return {{{coordinate(v, 0, 0), coordinate(v, 0, 1), coordinate(v, 0, 2)},
             {coordinate(v, 1, 0), coordinate(v, 1, 1), coordinate(v, 1, 2)}}};
  }

  const ImpactBlock& m_block;
  int m_lane;
};

template <ImpactQuery::Kind kind>
HWY_INLINE unsigned mayImpactOf(const ImpactBlock& block, double distance, double tolerance) {
  const D d;
  unsigned bits = 0;
  for (int lane = 0; lane < ImpactBlock::kLanes; lane += static_cast<int>(hn::Lanes(d))) {
    const FilterLanes<kind> lanes(block, lane);
    M impossible = lanes.separatedByBoxes(distance);
    if (!hn::AllTrue(d, impossible))
      impossible = hn::Or(impossible, distance > 0.0 ? lanes.separatedAlong(lanes.normalHalfway(),
                                                                            distance, tolerance)
                                                     : lanes.neverCoplanar());
    if (!hn::AllTrue(d, impossible))
      impossible =
          hn::Or(impossible, lanes.separatedAlong(lanes.gapHalfway(), distance, tolerance));
    bits |= bitsOf(d, hn::Not(impossible)) << lane;
  }
  return bits;
}

HWY_ATTR unsigned mayImpactKernel(ImpactQuery::Kind kind, const ImpactBlock& block, double distance,
                                  double tolerance) {
  return kind == ImpactQuery::Kind::VertexTriangle
             ? mayImpactOf<ImpactQuery::Kind::VertexTriangle>(block, distance, tolerance)
             : mayImpactOf<ImpactQuery::Kind::EdgeEdge>(block, distance, tolerance);
}

}  // namespace impact_filter

using impact_filter::mayImpactKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(mayImpactKernel);

std::uint8_t mayImpact(ImpactQuery::Kind kind, const ImpactBlock& block,
                       const TimeOfImpactSettings& settings) {
  PALPATE_ASSERT(settings.timeTolerance >= kSmallestTimeTolerance && settings.timeTolerance <= 1.0);
  return static_cast<std::uint8_t>(HWY_DYNAMIC_DISPATCH(mayImpactKernel)(
      kind, block, std::max(settings.minimumDistance, 0.0), settings.timeTolerance));
}

}  // namespace palpate
#endif
