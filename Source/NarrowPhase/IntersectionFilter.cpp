#include "NarrowPhase/IntersectionFilter.h"

#include "Math/Tolerances.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "NarrowPhase/IntersectionFilter.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kSize = 16;
using D = hn::CappedTag<double, kSize>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

/// Triangle pairs side by side: coordinates at 9 triangle + 3 corner + axis, and vertices' ids at 3
/// triangle + corner.
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

/// One of the triangles of as many pairs as V has lanes.
struct Lanes {
  Vector3<V> corner[3];
  M excluded[3];  ///< corners that are the other's too

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

/// All corners that are not the plane's too are certainly strictly to one side: by the volumes of
/// OrientedPlane::side() and its bound, which grows with each magnitude of d - a, so that one with
/// the largest of three corners is a bound for all. If all corners are the plane's: false.
HWY_INLINE M aside(const Lanes& triangle, const Lanes& plane) {
  const D d;
  const auto& [p, q, r] = plane.corner;
  const Vector3<V> u = q - p, v = r - p;
  const Vector3<V> forward{u.y * v.z, u.z * v.x, u.x * v.y},
      backward{u.z * v.y, u.x * v.z, u.y * v.x};
  const Vector3<V> normal = forward - backward;
  V volume[3];
  Vector3<V> largest{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  for (int i = 0; i < 3; ++i) {
    const Vector3<V> w = triangle.corner[i] - p;
    volume[i] = dot(normal, w);
    largest = {hn::Max(largest.x, hn::Abs(w.x)), hn::Max(largest.y, hn::Abs(w.y)),
               hn::Max(largest.z, hn::Abs(w.z))};
  }
  const V bound =
      hn::Set(d, kVolumeError) * dot(magnitudes(forward) + magnitudes(backward), largest) +
      hn::Set(d, kUnderflowGuard) * (hn::Set(d, 1.0) + largest.x + largest.y + largest.z);
  M above = hn::FirstN(d, kSize), below = above;
  for (int i = 0; i < 3; ++i) {
    above = hn::And(above, hn::Or(triangle.excluded[i], hn::Gt(volume[i], bound)));
    below = hn::And(below, hn::Or(triangle.excluded[i], hn::Lt(volume[i], hn::Neg(bound))));
  }
  return hn::Xor(above, below);
}

HWY_ATTR void keepPossiblyIntersectingKernel(const PlacedTriangles& a, const PlacedTriangles& b,
                                             bool self, std::span<const TrianglePair> pairs,
                                             Buffer<TrianglePair>& out) {
  const D d;
  std::size_t kept = out.size();
  out.resize(kept + pairs.size());
  Batch batch;
  for (std::size_t begin = 0; begin < pairs.size(); begin += kSize) {
    const auto some = pairs.subspan(begin, std::min(kSize, pairs.size() - begin));
    for (std::size_t lane = 0; lane < some.size(); ++lane) {
      batch.set(lane, 0, a, some[lane].a, self);
      batch.set(lane, 1, b, some[lane].b, self);
    }
    for (std::size_t first = 0; first < some.size(); first += hn::Lanes(d)) {
      Lanes ofA, ofB;
      ofA.set(batch, first, 0, self);
      ofB.set(batch, first, 1, self);
      M apart = boxesApart(ofA, ofB);
      if (!hn::AllTrue(d, apart)) apart = hn::Or(apart, hn::Or(aside(ofA, ofB), aside(ofB, ofA)));
      const std::uint32_t isApart = bitsOf(d, apart);
      for (std::size_t i = first; i < std::min(first + hn::Lanes(d), some.size()); ++i) {
        out[kept] = some[i];
        kept += ~isApart >> (i - first) & 1;
      }
    }
  }
  out.resize(kept);
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(keepPossiblyIntersectingKernel);

void keepPossiblyIntersecting(const PlacedTriangles& a, const PlacedTriangles& b, bool self,
                              std::span<const TrianglePair> pairs, Buffer<TrianglePair>& out) {
  HWY_DYNAMIC_DISPATCH(keepPossiblyIntersectingKernel)(a, b, self, pairs, out);
}

}  // namespace palpate
#endif
