#include "NarrowPhase/IntersectionFilter.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "NarrowPhase/IntersectionFilter.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace intersection_filter {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kSize = 16;
using D = hn::CappedTag<double, kSize>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

/// Triangle pairs side by side. With triangle 0 or 1: rows 9 triangle + 3 corner + axis hold
/// coordinates, rows 3 triangle + corner hold vertex ids.
struct Batch {
  alignas(64) double coordinates[18][kSize] = {};
  alignas(64) double ids[6][kSize] = {};

  HWY_ATTR HWY_INLINE void set(std::size_t lane, int side, const PlacedTriangles& from,
                               std::uint32_t triangle, bool withIds) {
    const Triangle& vertices = from.triangles[triangle];
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d position = from.positions[vertices[i]];
      for (int k = 0; k < 3; ++k) coordinates[9 * side + 3 * i + k][lane] = position[k];
      if (withIds) ids[3 * side + i][lane] = vertices[i];
    }
  }
};

/// One triangle of each pair, for as many pairs as V has lanes.
struct Lanes {
  Vector3<V> corner[3];
  M excluded[3];  ///< corners that are corners of the other triangle, too

  HWY_INLINE void set(const Batch& batch, std::size_t lane, int side, bool withIds) {
    const D d;
    for (int i = 0; i < 3; ++i) {
      const auto* const rows = batch.coordinates + 9 * side + 3 * i;
      corner[i] = {hn::Load(d, rows[0] + lane), hn::Load(d, rows[1] + lane),
                   hn::Load(d, rows[2] + lane)};
      excluded[i] = hn::FirstN(d, 0);
      if (!withIds) continue;
      const V id = hn::Load(d, batch.ids[3 * side + i] + lane);
      for (int j = 0; j < 3; ++j)
        excluded[i] =
            hn::Or(excluded[i], hn::Eq(id, hn::Load(d, batch.ids[3 * (1 - side) + j] + lane)));
    }
  }
};

HWY_INLINE M boxesApart(const Lanes& a, const Lanes& b) {
  const auto lower = [](V p, V q, V r) HWY_ATTR { return hn::Min(hn::Min(p, q), r); };
  const auto upper = [](V p, V q, V r) HWY_ATTR { return hn::Max(hn::Max(p, q), r); };
  M apart = hn::FirstN(D(), 0);
  for (const auto axis : {&Vector3<V>::x, &Vector3<V>::y, &Vector3<V>::z}) {
    const V a0 = a.corner[0].*axis, a1 = a.corner[1].*axis, a2 = a.corner[2].*axis,
            b0 = b.corner[0].*axis, b1 = b.corner[1].*axis, b2 = b.corner[2].*axis;
    apart = hn::Or(apart, hn::Or(hn::Gt(lower(a0, a1, a2), upper(b0, b1, b2)),
                                 hn::Gt(lower(b0, b1, b2), upper(a0, a1, a2))));
  }
  return apart;
}

HWY_INLINE Vector3<V> magnitudes(const Vector3<V>& a) {
  return {hn::Abs(a.x), hn::Abs(a.y), hn::Abs(a.z)};
}

/// Where a volume is certainly positive (above) or negative (below).
struct Sides {
  M above, below;
  HWY_INLINE M certain() const { return hn::Or(above, below); }
};

/// (q - p) x (r - p) of three points, and the magnitudes of its terms.
struct Normal {
  Vector3<V> normal, magnitude;

  HWY_INLINE Normal(const Vector3<V>& p, const Vector3<V>& q, const Vector3<V>& r) {
    const Vector3<V> u = q - p, v = r - p;
    const Vector3<V> forward{u.y * v.z, u.z * v.x, u.x * v.y},
        backward{u.z * v.y, u.x * v.z, u.y * v.x};
    normal = forward - backward;
    magnitude = magnitudes(forward) + magnitudes(backward);
  }
  /// Uses the error bound of OrientedPlane::side(). w: the vector from p. most: at least the
  /// magnitudes of w.
  HWY_INLINE Sides sidesOf(const Vector3<V>& w, const Vector3<V>& most) const {
    const D d;
    const V volume = dot(normal, w);
    const V bound = hn::Set(d, kVolumeError) * dot(magnitude, most) +
                    hn::Set(d, kUnderflowGuard) * (hn::Set(d, 1.0) + most.x + most.y + most.z);
    return {hn::Gt(volume, bound), hn::Lt(volume, hn::Neg(bound))};
  }
  HWY_INLINE Sides sidesOf(const Vector3<V>& w) const { return sidesOf(w, magnitudes(w)); }
};

/// The sides of a plane that a triangle's corners are on.
struct CornerSides {
  Sides corner[3];

  /// The error bound grows with each magnitude. The bound for the largest magnitudes of the three
  /// corners therefore holds for all of them.
  HWY_INLINE CornerSides(const Lanes& triangle, const Lanes& plane) {
    const auto& [p, q, r] = plane.corner;
    const Normal normal(p, q, r);
    const Vector3<V> w[3] = {triangle.corner[0] - p, triangle.corner[1] - p,
                             triangle.corner[2] - p};
    Vector3<V> most = magnitudes(w[0]);
    for (int i = 1; i < 3; ++i) {
      const Vector3<V> other = magnitudes(w[i]);
      most = {hn::Max(most.x, other.x), hn::Max(most.y, other.y), hn::Max(most.z, other.z)};
    }
    for (int i = 0; i < 3; ++i) corner[i] = normal.sidesOf(w[i], most);
  }
  /// Whether all corners that are not excluded are strictly on one side of the plane. False if all
  /// are excluded.
  HWY_INLINE M isOnOneSide(const M (&excluded)[3]) const {
    M above = hn::FirstN(D(), kSize), below = above;
    for (int i = 0; i < 3; ++i) {
      above = hn::And(above, hn::Or(excluded[i], corner[i].above));
      below = hn::And(below, hn::Or(excluded[i], corner[i].below));
    }
    return hn::Xor(above, below);
  }
  HWY_INLINE M certain() const {
    return hn::And(hn::And(corner[0].certain(), corner[1].certain()), corner[2].certain());
  }
};

/// The corners of a triangle that crosses a plane, beginning with the corner that is alone on its
/// side.
struct FromIsolatedCorner {
  M isLast, isMiddle;
  Vector3<V> isolated, ends[2];  ///< the corners after it, in their order

  HWY_INLINE FromIsolatedCorner(const Lanes& triangle, const CornerSides& sides) {
    const auto& [c0, c1, c2] = triangle.corner;
    const auto* const s = sides.corner;
    isLast = hn::Not(hn::Xor(s[0].above, s[1].above));
    isMiddle = hn::AndNot(isLast, hn::Not(hn::Xor(s[0].above, s[2].above)));
    isolated = choose(c2, c1, c0);
    ends[0] = choose(c0, c2, c1);
    ends[1] = choose(c1, c0, c2);
  }
  HWY_INLINE Vector3<V> choose(const Vector3<V>& last, const Vector3<V>& middle,
                               const Vector3<V>& first) const {
    const auto among = [this](V l, V m, V f) HWY_ATTR {
      return hn::IfThenElse(isLast, l, hn::IfThenElse(isMiddle, m, f));
    };
    return {among(last.x, middle.x, first.x), among(last.y, middle.y, first.y),
            among(last.z, middle.z, first.z)};
  }
};

/// The SIMD form of intersectCrossing() in Math/TriangleIntersection. Results are one bit per lane.
struct Crossings {
  struct OneTriangle {
    std::uint32_t isLast, isMiddle, through[2];

    std::uint8_t edges(std::size_t lane) const {
      const int isolated = isLast >> lane & 1 ? 2 : static_cast<int>(isMiddle >> lane & 1);
      const unsigned found = (through[0] >> lane & 1) << isolated |
                             (through[1] >> lane & 1) << (isolated == 0 ? 2 : isolated - 1);
      return static_cast<std::uint8_t>(found);
    }
  } a, b;
  std::uint32_t known;  ///< certainly no features touch, and the crossing edges are certain

  HWY_INLINE Crossings(const Lanes& ofA, const CornerSides& sidesOfA, const Lanes& ofB,
                       const CornerSides& sidesOfB) {
    const D d;
    const FromIsolatedCorner fromA(ofA, sidesOfA), fromB(ofB, sidesOfB);
    const Vector3<V> towards[2] = {fromB.ends[0] - fromA.isolated, fromB.ends[1] - fromA.isolated};
    M certain = hn::And(sidesOfA.certain(), sidesOfB.certain()), above[2][2];
    for (int i = 0; i < 2; ++i) {
      const Normal normal(fromA.isolated, fromA.ends[i], fromB.isolated);
      for (int j = 0; j < 2; ++j) {
        const Sides sides = normal.sidesOf(towards[j]);
        certain = hn::And(certain, sides.certain());
        above[i][j] = sides.above;
      }
    }
    known = bitsOf(d, certain);
    a = {bitsOf(d, fromA.isLast), bitsOf(d, fromA.isMiddle), {}};
    b = {bitsOf(d, fromB.isLast), bitsOf(d, fromB.isMiddle), {}};
    for (int i = 0; i < 2; ++i) {
      a.through[i] = bitsOf(d, hn::Xor(above[i][0], above[i][1]));
      b.through[i] = bitsOf(d, hn::Xor(above[0][i], above[1][i]));
    }
  }
  bool isKnown(std::size_t lane) const { return known >> lane & 1; }
  TriangleIntersection intersection(std::size_t lane) const {
    TriangleIntersection found;
    found.edgesOfAThroughB = a.edges(lane);
    found.edgesOfBThroughA = b.edges(lane);
    return found;
  }
};

/// Appends those of the first `size` lanes that may intersect.
HWY_INLINE void keepLanes(const Lanes& ofA, const Lanes& ofB, const ElementPair* pairs,
                          std::size_t size, PossibleIntersection*& out) {
  const D d;
  M apart = boxesApart(ofA, ofB);
  if (hn::AllTrue(d, apart)) return;
  const CornerSides sidesOfA(ofA, ofB), sidesOfB(ofB, ofA);
  apart =
      hn::Or(apart, hn::Or(sidesOfA.isOnOneSide(ofA.excluded), sidesOfB.isOnOneSide(ofB.excluded)));
  if (hn::AllTrue(d, apart)) return;
  const std::uint32_t isApart = bitsOf(d, apart);
  const Crossings crossings(ofA, sidesOfA, ofB, sidesOfB);
  for (std::size_t lane = 0; lane < size; ++lane) {
    if (isApart >> lane & 1) continue;
    *out = {pairs[lane],
            crossings.isKnown(lane) ? crossings.intersection(lane) : TriangleIntersection()};
    out += out->isKnown() || !crossings.isKnown(lane);
  }
}

HWY_ATTR void keepPossiblyIntersectingKernel(const PlacedTriangles& a, const PlacedTriangles& b,
                                             bool self, std::span<const ElementPair> pairs,
                                             Buffer<PossibleIntersection>& out) {
  const D d;
  out.resize(pairs.size());
  PossibleIntersection* end = out.data();
  Batch batch;
  ElementPair batchPairs[kSize];
  for (std::size_t begin = 0; begin < pairs.size(); begin += kSize) {
    const std::size_t size = std::min(kSize, pairs.size() - begin);
    for (std::size_t lane = 0; lane < size; ++lane) {
      ElementPair& pair = batchPairs[lane] = pairs[begin + lane];
      if (self && pair.b < pair.a) std::swap(pair.a, pair.b);
      batch.set(lane, 0, a, pair.a, self);
      batch.set(lane, 1, b, pair.b, self);
    }
    for (std::size_t first = 0; first < size; first += hn::Lanes(d)) {
      Lanes ofA, ofB;
      ofA.set(batch, first, 0, self);
      ofB.set(batch, first, 1, self);
      keepLanes(ofA, ofB, batchPairs + first, std::min(hn::Lanes(d), size - first), end);
    }
  }
  PALPATE_ASSERT(end <= out.data() + out.size());
  out.resize(static_cast<std::size_t>(end - out.data()));
}

}  // namespace intersection_filter

using intersection_filter::keepPossiblyIntersectingKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(keepPossiblyIntersectingKernel);

void keepPossiblyIntersecting(const PlacedTriangles& a, const PlacedTriangles& b, bool self,
                              std::span<const ElementPair> pairs,
                              Buffer<PossibleIntersection>& out) {
  HWY_DYNAMIC_DISPATCH(keepPossiblyIntersectingKernel)(a, b, self, pairs, out);
}

}  // namespace palpate
#endif
