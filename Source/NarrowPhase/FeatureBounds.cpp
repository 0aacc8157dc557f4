#include "NarrowPhase/FeatureBounds.h"

#include "NarrowPhase/FeatureTests.h"
#include "Core/Assert.h"

#include <algorithm>
#include <limits>

// The bounds are those at which ProximityFilter drops a test, solved for the distance: a test that
// is dropped where value > distance factor + (1 + distance) error has the bound (value - error) /
// (factor + error). ProximityFilter.cpp has the errors, for coordinates relative to the corner a0,
// below 2, that are off by e = 2^-22. Here they are below 1, and off by e = 2^-22 +
// FloatMeshes::error in the same scale.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "NarrowPhase/FeatureBounds.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace feature_bounds {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;
constexpr std::size_t kMostLanes = 16;

/// Up to kMostLanes pairs: indices of the corners' floats, and the owned tests.
struct PairLanes {
  alignas(64) std::int32_t corner[2][3][kMostLanes];
  alignas(64) std::uint32_t tests[kMostLanes];
};

struct TriangleLanes {
  Vector3<V> corner[3], edge[3];
  V edgeLength[3], length;  // length: of the longest edge
  Vector3<V> normal, inward[3];
  V normalLength;

  HWY_ATTR HWY_INLINE void set() {
    for (int i = 0; i < 3; ++i) {
      edge[i] = corner[(i + 1) % 3] - corner[i];
      edgeLength[i] = hn::Sqrt(dot(edge[i], edge[i]));
    }
    length = hn::Max(hn::Max(edgeLength[0], edgeLength[1]), edgeLength[2]);
    normal = cross(edge[0], edge[1]);
    normalLength = hn::Sqrt(dot(normal, normal));
    for (int i = 0; i < 3; ++i) inward[i] = cross(normal, edge[i]);
  }
};

HWY_ATTR HWY_INLINE V bound(V value, V factor, V error) {
  return (value - error) / (factor + error);
}

/// Of a vertex and a triangle. sign: of the vectors from the triangle's corners to the vertex.
HWY_ATTR HWY_INLINE V vertexBound(const TriangleLanes& triangle, V e, V sign,
                                  const Vector3<V>& from0, const Vector3<V>& from1,
                                  const Vector3<V>& from2) {
  const D d;
  V most = bound(hn::Abs(dot(triangle.normal, from0)), triangle.normalLength,
                 hn::Set(d, 128.0f) * e * triangle.length);
  const V error = hn::Set(d, 192.0f) * e * triangle.length * triangle.length;
  const Vector3<V>* const from[3] = {&from0, &from1, &from2};
  for (int i = 0; i < 3; ++i)
    most = hn::Max(most, bound(sign * dot(triangle.inward[i], *from[i]),
                               triangle.normalLength * triangle.edgeLength[i], error));
  return most;
}

/// Of edges that are nearly parallel, from the interval of each along the part of r that is
/// perpendicular to v. For any axis, differences that are off by e change the gap by 3 sqrt(3) e of
/// the axis' length, and roundings by less than 12 e.
HWY_ATTR HWY_INLINE V parallelBound(const Vector3<V>& u, const Vector3<V>& v, const Vector3<V>& r,
                                    V e) {
  const D d;
  const V zero = hn::Zero(d), vv = dot(v, v), vr = dot(v, r);
  const Vector3<V> axis = {vv * r.x - vr * v.x, vv * r.y - vr * v.y, vv * r.z - vr * v.z};
  const V square = dot(axis, axis),
          gap = dot(axis, r) + hn::Min(dot(axis, u), zero) - hn::Max(dot(axis, v), zero),
          bound = gap / hn::Sqrt(square) - hn::Set(d, 32.0f) * e;
  // The products of a shorter axis underflow.
  return hn::IfThenElse(hn::Gt(square, hn::Set(d, 0x1p-80f)), bound, zero);
}

HWY_ATTR HWY_INLINE V edgeBound(const TriangleLanes& a, int i, const TriangleLanes& b, int j, V e,
                                const Vector3<V>& r) {
  const D d;
  const Vector3<V>&u = a.edge[i], &v = b.edge[j];
  const Vector3<V> n = cross(u, v);
  const V square = dot(n, n), normal = hn::Sqrt(square), longest = hn::Max(a.length, b.length) * e;
  V most = bound(hn::Abs(dot(n, r)), normal, hn::Set(d, 128.0f) * longest);
  const V uv = dot(u, v), ur = dot(u, r), vr = dot(v, r);
  const V s = uv * vr - dot(v, v) * ur, t = dot(u, u) * vr - uv * ur;
  const auto beyond = [&](V along, V otherLength, V length) HWY_ATTR {
    return bound(hn::Max(hn::Neg(along), along - square), normal * otherLength,
                 hn::Set(d, 640.0f) * longest * length);
  };
  most = hn::Max(most, beyond(s, b.edgeLength[j], b.length));
  most = hn::Max(most, beyond(t, a.edgeLength[i], a.length));
  return hn::Max(most, parallelBound(u, v, r, e));
}

/// The bounds of the pairs in some lanes, in units of the floats.
HWY_ATTR V boundsOf(const FloatMeshes& meshes, const PairLanes& pairs, std::size_t lane) {
  const D d;
  const hn::RebindToSigned<D> di;
  const hn::RebindToUnsigned<D> du;
  TriangleLanes a, b;
  V largest = hn::Zero(d);
  const float* const floats[2] = {&meshes.floatsA->x, &meshes.floatsB->x};
  const auto load = [&](int mesh, int i) HWY_ATTR {
    const auto at = hn::Load(di, pairs.corner[mesh][i] + lane);
    return Vector3<V>{hn::GatherIndex(d, floats[mesh], at),
                      hn::GatherIndex(d, floats[mesh] + 1, at),
                      hn::GatherIndex(d, floats[mesh] + 2, at)};
  };
  const Vector3<V> origin = load(0, 0),
                   offset = {hn::Set(d, meshes.offset[0]), hn::Set(d, meshes.offset[1]),
                             hn::Set(d, meshes.offset[2])};
  const auto size = [](const Vector3<V>& p) HWY_ATTR {
    return hn::Max(hn::Max(hn::Abs(p.x), hn::Abs(p.y)), hn::Abs(p.z));
  };
  for (int i = 0; i < 3; ++i) {
    if (i > 0) a.corner[i] = load(0, i) - origin;
    b.corner[i] = (load(1, i) - offset) - origin;
    if (i > 0) largest = hn::Max(largest, size(a.corner[i]));
    largest = hn::Max(largest, size(b.corner[i]));
  }
  const V scale = hn::Set(d, 1.0f) / largest;
  a.corner[0] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  for (int i = 0; i < 3; ++i) {
    if (i > 0) a.corner[i] = scale * a.corner[i];
    b.corner[i] = scale * b.corner[i];
  }
  const V e = hn::Set(d, 0x1p-22f) + hn::Set(d, meshes.error) * scale;
  a.set();
  b.set();
  const auto tests = hn::Load(du, pairs.tests + lane);
  V least = hn::Set(d, std::numeric_limits<float>::infinity());
  const auto add = [&](int test, V bound) HWY_ATTR {
    const auto isOwned = hn::RebindMask(d, hn::TestBit(tests, hn::Set(du, 1u << test)));
    // NaN, where floats overflow or features have no size, is no bound.
    const V known = hn::IfThenElse(hn::Gt(bound, hn::Zero(d)), bound, hn::Zero(d));
    least = hn::Min(least, hn::IfThenElse(isOwned, known, least));
  };
  const V one = hn::Set(d, 1.0f), minusOne = hn::Set(d, -1.0f);
  Vector3<V> from[3][3];  // from b's corner j to a's corner i
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) from[i][j] = a.corner[i] - b.corner[j];
  for (int i = 0; i < 3; ++i) {
    add(cornerTestOfA(i), vertexBound(b, e, minusOne, from[i][0], from[i][1], from[i][2]));
    add(cornerTestOfB(i), vertexBound(a, e, one, from[0][i], from[1][i], from[2][i]));
    for (int j = 0; j < 3; ++j) add(edgeTest(i, j), edgeBound(a, i, b, j, e, from[i][j]));
  }
  // The rounding of the products, of which the errors have none for the distance itself.
  return least * largest * hn::Set(d, 1.0f - 0x1p-20f);
}

HWY_ATTR void featureBoundsKernel(const FloatMeshes& meshes, std::span<const ElementPair> pairs,
                                  float* bounds) {
  const D d;
  const unsigned allowed = allowedTests(meshes.a, meshes.b);
  const bool self = &meshes.a == &meshes.b;
  PairLanes lanes;
  for (std::size_t begin = 0; begin < pairs.size(); begin += kMostLanes) {
    const std::size_t size = std::min(kMostLanes, pairs.size() - begin);
    for (std::size_t i = 0; i < kMostLanes; ++i) {
      const ElementPair& pair = pairs[begin + std::min(i, size - 1)];
      const Triangle &s = meshes.a.elements[pair.a], &t = meshes.b.elements[pair.b];
      for (int c = 0; c < 3; ++c) {
        lanes.corner[0][c][i] = static_cast<std::int32_t>(4 * s[c]);
        lanes.corner[1][c][i] = static_cast<std::int32_t>(4 * t[c]);
      }
      lanes.tests[i] =
          kOwnedByA[meshes.a.owned[pair.a]] & kOwnedByB[meshes.b.owned[pair.b]] & allowed;
      if (self) lanes.tests[i] &= ~static_cast<std::uint32_t>(kSharingTests[sameCorners(s, t)]);
    }
    alignas(64) float found[kMostLanes];
    for (std::size_t lane = 0; lane < size; lane += hn::Lanes(d))
      hn::Store(boundsOf(meshes, lanes, lane), d, found + lane);
    std::copy_n(found, size, bounds + begin);
  }
}

}  // namespace feature_bounds

using feature_bounds::featureBoundsKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(featureBoundsKernel);

void featureBounds(const FloatMeshes& meshes, std::span<const ElementPair> pairs, float* bounds) {
  PALPATE_ASSERT(meshes.error >= 0.0f);
  HWY_DYNAMIC_DISPATCH(featureBoundsKernel)(meshes, pairs, bounds);
}

}  // namespace palpate
#endif
