#include "Math/ImpactFilter.h"

#include "Math/Tolerances.h"

#include <algorithm>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Math/ImpactFilter.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, ImpactBlock::kLanes>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

struct Point {
  V x, y, z;
};
/// At the start of the step and at its end.
struct Ends {
  Point at[2];
};

HWY_INLINE V largest(V a, V b) { return hn::Max(hn::Abs(a), hn::Abs(b)); }
HWY_INLINE Point largest(const Ends& ends) {
  return {largest(ends.at[0].x, ends.at[1].x), largest(ends.at[0].y, ends.at[1].y),
          largest(ends.at[0].z, ends.at[1].z)};
}
HWY_INLINE Point cross(const Point& l, const Point& r) {
  return {hn::Sub(hn::Mul(l.y, r.z), hn::Mul(l.z, r.y)),
          hn::Sub(hn::Mul(l.z, r.x), hn::Mul(l.x, r.z)),
          hn::Sub(hn::Mul(l.x, r.y), hn::Mul(l.y, r.x))};
}
HWY_INLINE Point sum(const Point& l, const Point& r) {
  return {hn::Add(l.x, r.x), hn::Add(l.y, r.y), hn::Add(l.z, r.z)};
}
HWY_INLINE V dot(const Point& l, const Point& r) {
  return hn::Add(hn::Add(hn::Mul(l.x, r.x), hn::Mul(l.y, r.y)), hn::Mul(l.z, r.z));
}

/// One vector's worth of queries.
template <ImpactQuery::Kind kind>
class FilterLanes {
 public:
  HWY_INLINE FilterLanes(const ImpactBlock& block, int lane) : m_block(block), m_lane(lane) {}

  /// Along some coordinate all corners are always further than `distance` to one side.
  HWY_INLINE M separatedByBoxes(double distance) const {
    const D d;
    constexpr auto corners = ImpactQuery::corners(kind);
    V gap = hn::Set(d, 0.0);
    for (int k = 0; k < 3; ++k) {
      V least = hn::Set(d, std::numeric_limits<double>::infinity()), most = hn::Neg(least);
      for (int i = 0; i < cornerCount(); ++i)
        for (int end = 0; end < 2; ++end) {
          const V value = coordinate(corners[i], end, k);
          least = hn::Min(least, value);
          most = hn::Max(most, value);
        }
      gap = hn::Max(gap, hn::Max(least, hn::Neg(most)));
    }
    return hn::Gt(gap, hn::Set(d, distance));
  }

  /// det(A, B, C) has one sign throughout.
  HWY_INLINE M neverCoplanar() const {
    const D d;
    constexpr auto axes = ImpactQuery::axes(kind);
    const Ends a = difference(axes[0]), b = difference(axes[1]), c = difference(axes[2]);
    const Point first = cross(a.at[0], b.at[0]), last = cross(a.at[1], b.at[1]),
                middle = sum(cross(a.at[0], b.at[1]), cross(a.at[1], b.at[0]));
    const V third = hn::Set(d, 1.0 / 3.0);
    const V f0 = dot(first, c.at[0]), f3 = dot(last, c.at[1]),
            f1 = hn::Mul(third, hn::Add(dot(middle, c.at[0]), dot(first, c.at[1]))),
            f2 = hn::Mul(third, hn::Add(dot(last, c.at[0]), dot(middle, c.at[1])));
    const V least = hn::Min(hn::Min(f0, f1), hn::Min(f2, f3)),
            most = hn::Max(hn::Max(f0, f1), hn::Max(f2, f3));
    const Point p = largest(a), q = largest(b), r = largest(c);
    const V permanent =
        hn::Add(hn::Add(hn::Mul(r.x, hn::Add(hn::Mul(p.y, q.z), hn::Mul(p.z, q.y))),
                        hn::Mul(r.y, hn::Add(hn::Mul(p.z, q.x), hn::Mul(p.x, q.z)))),
                hn::Mul(r.z, hn::Add(hn::Mul(p.x, q.y), hn::Mul(p.y, q.x))));
    const V error =
        hn::Add(hn::Mul(permanent, hn::Set(d, kCoplanarityError)), hn::Set(d, kImpactUnderflow));
    const V magnitude = hn::Max(hn::Max(hn::Max(p.x, p.y), hn::Max(p.z, q.x)),
                                hn::Max(hn::Max(q.y, q.z), hn::Max(r.x, hn::Max(r.y, r.z))));
    return hn::And(hn::Or(hn::Gt(least, error), hn::Lt(most, hn::Neg(error))),
                   hn::Le(magnitude, hn::Set(d, kLargestImpactDifference)));
  }

  /// All corners are always further than `distance` along A x B as it is halfway.
  HWY_INLINE M separatedAlongNormal(double distance) const {
    const D d;
    constexpr auto axes = ImpactQuery::axes(kind);
    constexpr auto corners = ImpactQuery::corners(kind);
    const Ends a = difference(axes[0]), b = difference(axes[1]);
    const Point normal = cross(sum(a.at[0], a.at[1]), sum(b.at[0], b.at[1]));
    V least = hn::Set(d, std::numeric_limits<double>::infinity()), most = hn::Neg(least);
    Point reach{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    for (int i = 0; i < cornerCount(); ++i) {
      const Ends corner = difference(corners[i]);
      const V first = dot(normal, corner.at[0]), last = dot(normal, corner.at[1]);
      least = hn::Min(least, hn::Min(first, last));
      most = hn::Max(most, hn::Max(first, last));
      const Point size = largest(corner);
      reach = {hn::Max(reach.x, size.x), hn::Max(reach.y, size.y), hn::Max(reach.z, size.z)};
    }
    const V lengthSquared = dot(normal, normal);
    const V needed = hn::Mul(hn::Set(d, distance), hn::Sqrt(lengthSquared));
    const Point size{hn::Abs(normal.x), hn::Abs(normal.y), hn::Abs(normal.z)};
    const V limit = hn::Add(hn::Mul(hn::Add(dot(size, reach), needed), hn::Set(d, kAlongError)),
                            hn::Add(needed, hn::Set(d, kImpactUnderflow)));
    const V magnitude = hn::Max(hn::Max(reach.x, hn::Max(reach.y, reach.z)),
                                hn::Max(size.x, hn::Max(size.y, size.z)));
    const M inRange =
        hn::And(hn::Le(magnitude, hn::Set(d, kLargestImpactDifference)),
                hn::Gt(lengthSquared, hn::Set(d, kShortestDirection * kShortestDirection)));
    return hn::And(hn::Or(hn::Gt(least, limit), hn::Lt(most, hn::Neg(limit))), inRange);
  }

 private:
  static constexpr int cornerCount() { return kind == ImpactQuery::Kind::EdgeEdge ? 4 : 3; }
  HWY_INLINE V coordinate(const ImpactQuery::Difference& vertices, int end, int k) const {
    const D d;
    return hn::Sub(hn::Load(d, &m_block.positions[vertices[0]][end][k][m_lane]),
                   hn::Load(d, &m_block.positions[vertices[1]][end][k][m_lane]));
  }
  HWY_INLINE Ends difference(const ImpactQuery::Difference& v) const {
    return {{{coordinate(v, 0, 0), coordinate(v, 0, 1), coordinate(v, 0, 2)},
             {coordinate(v, 1, 0), coordinate(v, 1, 1), coordinate(v, 1, 2)}}};
  }

  const ImpactBlock& m_block;
  int m_lane;
};

/// Box tests are exact; with a distance they are if `limit` is at least the distance and an ulp.
template <ImpactQuery::Kind kind>
HWY_INLINE unsigned mayImpactOf(const ImpactBlock& block, double distance, double limit) {
  const D d;
  unsigned bits = 0;
  for (int lane = 0; lane < ImpactBlock::kLanes; lane += static_cast<int>(hn::Lanes(d))) {
    const FilterLanes<kind> lanes(block, lane);
    M impossible = lanes.separatedByBoxes(limit);
    if (!hn::AllTrue(d, impossible))
      impossible = hn::Or(impossible, distance > 0.0 ? lanes.separatedAlongNormal(distance)
                                                     : lanes.neverCoplanar());
    std::uint8_t mask[8] = {};
    hn::StoreMaskBits(d, hn::Not(impossible), mask);
    bits |= static_cast<unsigned>(mask[0]) << lane;
  }
  return bits;
}

HWY_ATTR unsigned mayImpactKernel(ImpactQuery::Kind kind, const ImpactBlock& block, double distance,
                                  double limit) {
  return kind == ImpactQuery::Kind::VertexTriangle
             ? mayImpactOf<ImpactQuery::Kind::VertexTriangle>(block, distance, limit)
             : mayImpactOf<ImpactQuery::Kind::EdgeEdge>(block, distance, limit);
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(mayImpactKernel);

std::uint8_t mayImpact(ImpactQuery::Kind kind, const ImpactBlock& block, double distance) {
  // A rounded difference above this comes from one above the distance.
  const double limit = distance > 0.0 ? std::nextafter(distance * (1.0 + 0x1p-51),
                                                       std::numeric_limits<double>::infinity())
                                      : 0.0;
  return static_cast<std::uint8_t>(
      HWY_DYNAMIC_DISPATCH(mayImpactKernel)(kind, block, std::max(distance, 0.0), limit));
}

}  // namespace palpate
#endif
