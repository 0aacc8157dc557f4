#include "Math/RayTriangles.h"

#include "Exact/ErrorBounds.h"
#include "Math/Tolerances.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Math/RayTriangles.cpp"
#include "Core/Simd.h"
#include "Math/CompensatedLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace ray_triangles {

namespace hn = hwy::HWY_NAMESPACE;

// The arithmetic of RayTriangle.cpp, operation by operation, and thus with the same bits.

using PairTag = hn::CappedTag<double, RayTriangles::kSize>;
using V = hn::Vec<PairTag>;
using Vectors = Vector3<V>;

HWY_ATTR HWY_INLINE Vectors load(const double (&from)[3][RayTriangles::kSize], std::size_t i) {
  const PairTag d;
  return {hn::Load(d, from[0] + i), hn::Load(d, from[1] + i), hn::Load(d, from[2] + i)};
}
HWY_ATTR HWY_INLINE V set(double value) { return hn::Set(PairTag(), value); }

struct VolumeLanes {
  V value, error;

  HWY_ATTR HWY_INLINE hn::Mask<PairTag> isPositive() const { return hn::Gt(value, error); }
  HWY_ATTR HWY_INLINE hn::Mask<PairTag> isNegative() const { return hn::Lt(value, hn::Neg(error)); }
};

struct CrossLanes {
  Vectors value, magnitude;

  HWY_ATTR HWY_INLINE static void component(V aj, V bk, V ak, V bj, V& value, V& magnitude) {
    const V forward = aj * bk, backward = ak * bj;
    value = forward - backward;
    magnitude = hn::Abs(forward) + hn::Abs(backward);
  }
  HWY_ATTR HWY_INLINE CrossLanes(const Vectors& a, const Vectors& b) {
    component(a.y, b.z, a.z, b.y, value.x, magnitude.x);
    component(a.z, b.x, a.x, b.z, value.y, magnitude.y);
    component(a.x, b.y, a.y, b.x, value.z, magnitude.z);
  }
  HWY_ATTR HWY_INLINE VolumeLanes volume(const Vectors& c) const {
    const V size = dot(magnitude, Vectors{hn::Abs(c.x), hn::Abs(c.y), hn::Abs(c.z)});
    return {dot(value, c), set(kVolumeError) * size +
                               set(kUnderflowGuard) * (set(1.0) + sumOfMagnitudes(c) + size)};
  }
};

HWY_ATTR void intersectRaysKernel(const RayTriangles& pairs, RayTriangleHits& out) {
  const PairTag d;
  out.hits = out.fronts = out.undecided = 0;
  for (std::size_t i = 0; i < RayTriangles::kSize; i += hn::Lanes(d)) {
    const Vectors origin = load(pairs.origin, i), direction = load(pairs.direction, i),
                  a = load(pairs.corners[0], i), b = load(pairs.corners[1], i),
                  c = load(pairs.corners[2], i);
    const Vectors p = a - origin, q = b - origin, r = c - origin;
    const CrossLanes first(direction, p);
    const VolumeLanes ab = first.volume(q), ac = first.volume(r),
                      bc = CrossLanes(direction, q).volume(r);
    const auto hasPositive = hn::Or(ab.isPositive(), hn::Or(bc.isPositive(), ac.isNegative())),
               hasNegative = hn::Or(ab.isNegative(), hn::Or(bc.isNegative(), ac.isPositive()));
    const auto isLeft = hn::And(ab.isPositive(), hn::And(bc.isPositive(), ac.isNegative())),
               isRight = hn::And(ab.isNegative(), hn::And(bc.isNegative(), ac.isPositive()));
    const V facing = (ab.value - ac.value) + bc.value,
            facingError =
                (ab.error + ac.error + bc.error) * set(1.0 + 0x1p-40) +
                set(0x1p-51) * (hn::Abs(ab.value) + hn::Abs(ac.value) + hn::Abs(bc.value));
    const VolumeLanes height = CrossLanes(b - a, c - a).volume(p);
    const V t = height.value / facing;
    const V error =
        (height.error + hn::Abs(t) * facingError) / hn::Abs(facing) * set(1.0 + 0x1p-40) +
        hn::Abs(t) * set(0x1p-52);
    const V tMin = hn::Load(d, pairs.tMin + i), tMax = hn::Load(d, pairs.tMax + i);
    const auto meets = hn::And(hn::Or(isLeft, isRight), hn::Gt(hn::Abs(facing), facingError));
    const auto isOutside = hn::Or(hn::Lt(t + error, tMin), hn::Gt(t - error, tMax));
    const auto isInside = hn::And(hn::Ge(t - error, tMin), hn::Le(t + error, tMax));
    const auto hits = hn::And(meets, hn::AndNot(isOutside, isInside));
    // Different signs, or a certain place outside: it misses.
    const auto misses = hn::Or(hn::And(hasPositive, hasNegative), hn::And(meets, isOutside));
    hn::Store(t, d, out.t + i);
    hn::Store(error, d, out.error + i);
    out.hits |= bitsOf(d, hits) << i;
    out.fronts |= bitsOf(d, hn::And(hits, isRight)) << i;
    out.undecided |= bitsOf(d, hn::Not(hn::Or(hits, misses))) << i;
  }
  leaveLanes();
}

HWY_ATTR HWY_INLINE V clamped(V value, V most) {
  const V zero = hn::Zero(PairTag());
  return hn::IfThenElse(hn::Lt(value, zero), zero,
                        hn::IfThenElse(hn::Lt(most, value), most, value));
}

HWY_ATTR void firstPointsKernel(const RayTriangles& pairs, const double (&t)[RayTriangles::kSize],
                                const double (&errors)[RayTriangles::kSize], RayPoints& out) {
  const PairTag d;
  const auto isModerate = [&](V extent) HWY_ATTR {
    return hn::And(hn::Gt(extent, set(kSmallestModerate)), hn::Lt(extent, set(kLargestModerate)));
  };
  out.decided = 0;
  for (std::size_t i = 0; i < RayTriangles::kSize; i += hn::Lanes(d)) {
    const Vectors origin = load(pairs.origin, i), direction = load(pairs.direction, i),
                  a = load(pairs.corners[0], i), b = load(pairs.corners[1], i),
                  c = load(pairs.corners[2], i);
    const V first = hn::Load(d, t + i);
    const DifferenceInLanes<V> p = difference(a, origin), u = difference(b, a),
                               v = difference(c, a);
    const V extent = hn::Max(largest(p.high), hn::Max(largest(b - origin), largest(c - origin)));
    const V most = set(kRayError) * extent / largest(direction);
    const DifferenceInLanes<V> normals = cross(u, v);
    const Vectors& normal = normals.high;
    const auto leftOf = [&](V along, V high, V low) HWY_ATTR {
      const auto product = exactProduct(along, first),
                 rest = exactSum(high, hn::Neg(product.value));
      return exactSum(rest.value, rest.error + (low - product.error));
    };
    const auto x = leftOf(direction.x, p.high.x, p.low.x),
               y = leftOf(direction.y, p.high.y, p.low.y),
               z = leftOf(direction.z, p.high.z, p.low.z);
    const DifferenceInLanes<V> left{{x.value, y.value, z.value}, {x.error, y.error, z.error}};
    const V slope = dot(normal, direction), step = accurateDot(normals, left) / slope;
    const V crossSize = sumOfMagnitudes(u.high) * sumOfMagnitudes(v.high);
    const V error =
        (set(kRefinedRayLoss) * crossSize * sumOfMagnitudes(left.high) +
         set(kRefinedRayError) * hn::Abs(step) * crossSize * sumOfMagnitudes(direction)) /
        hn::Abs(slope);
    auto decided = hn::And(hn::Gt(hn::Load(d, errors + i), hn::Zero(d)), isModerate(extent));
    decided = hn::And(decided, isModerate(largest(direction)));
    decided = hn::And(decided, hn::And(isModerate(largest(normal)), hn::Le(error, most)));
    const Vectors onPlane = step * direction - left.high;
    const V square = dot(normal, normal), one = set(1.0);
    const V ofB = clamped(dot(cross(onPlane, v.high), normal) / square, one);
    const V ofC = clamped(dot(cross(u.high, onPlane), normal) / square, one - ofB);
    hn::Store(first + step, d, out.t + i);
    hn::Store((one - ofB) - ofC, d, out.weights[0] + i);
    hn::Store(ofB, d, out.weights[1] + i);
    hn::Store(ofC, d, out.weights[2] + i);
    out.decided |= bitsOf(d, decided) << i;
  }
  leaveLanes();
}

}  // namespace ray_triangles

using ray_triangles::firstPointsKernel;
using ray_triangles::intersectRaysKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(intersectRaysKernel);
HWY_EXPORT(firstPointsKernel);

void intersectRays(const RayTriangles& pairs, RayTriangleHits& out) {
  HWY_DYNAMIC_DISPATCH(intersectRaysKernel)(pairs, out);
}

void firstPoints(const RayTriangles& pairs, const double (&t)[RayTriangles::kSize],
                 const double (&error)[RayTriangles::kSize], RayPoints& out) {
  HWY_DYNAMIC_DISPATCH(firstPointsKernel)(pairs, t, error, out);
}

}  // namespace palpate
#endif
