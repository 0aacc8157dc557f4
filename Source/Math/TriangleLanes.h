// For files with SIMD code, after Core/Simd.h: included once for each instruction set.
#if defined(PALPATE_MATH_TRIANGLE_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef PALPATE_MATH_TRIANGLE_LANES
#undef PALPATE_MATH_TRIANGLE_LANES
#else
#define PALPATE_MATH_TRIANGLE_LANES
#endif

#include <cstddef>

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Triangles relative to a point, as many as D has lanes.
template <class D>
struct TrianglesInLanes {
  using V = hn::Vec<D>;
  using Vectors = Vector3<V>;

  Vectors a, b, c;

  /// corners: corner, axis, triangle.
  HWY_ATTR HWY_INLINE static TrianglesInLanes load(const double (&corners)[3][3][8],
                                                   std::size_t i) {
    const D d;
    const auto corner = [&](int k) HWY_ATTR {
      return Vectors{hn::Load(d, &corners[k][0][i]), hn::Load(d, &corners[k][1][i]),
                     hn::Load(d, &corners[k][2][i])};
    };
    return {corner(0), corner(1), corner(2)};
  }

  /// The largest and the least component along w.
  HWY_ATTR HWY_INLINE V along(const Vectors& w) const {
    return hn::Max(dot(w, a), hn::Max(dot(w, b), dot(w, c)));
  }
  HWY_ATTR HWY_INLINE V leastAlong(const Vectors& w) const {
    return hn::Min(dot(a, w), hn::Min(dot(b, w), dot(c, w)));
  }
  /// The distance of the furthest corner.
  HWY_ATTR HWY_INLINE V furthest() const {
    return hn::Sqrt(hn::Max(dot(a, a), hn::Max(dot(b, b), dot(c, c))));
  }
  /// A point of the triangle near the one closest to the point, however rounded.
  HWY_ATTR HWY_INLINE Vectors nearest() const {
    const D d;
    const V zero = hn::Zero(d), one = hn::Set(d, hn::TFromD<D>(1));
    const auto clamped = [&](V dividend, V divisor) HWY_ATTR {
      return hn::IfThenElseZero(hn::Gt(divisor, zero),
                                hn::Min(hn::Max(dividend / divisor, zero), one));
    };
    const Vectors ab = b - a, ac = c - a, bc = c - b;
    const V ba = hn::Neg(dot(a, ab)), ca = hn::Neg(dot(a, ac)), cb = hn::Neg(dot(b, bc));
    const V bb = dot(ab, ab), cc = dot(ac, ac), both = dot(ab, ac);
    // The nearest of the closest points of the three edges, and of the face if it is inside.
    Vectors q = a + clamped(ba, bb) * ab;
    V square = dot(q, q);
    const auto take = [&](const Vectors& other, const hn::Mask<D>& valid) HWY_ATTR {
      const V otherSquare = dot(other, other);
      const auto nearer = hn::And(valid, hn::Lt(otherSquare, square));
      square = hn::IfThenElse(nearer, otherSquare, square);
      q = {hn::IfThenElse(nearer, other.x, q.x), hn::IfThenElse(nearer, other.y, q.y),
           hn::IfThenElse(nearer, other.z, q.z)};
    };
    const auto all = hn::Ge(bb, zero);
    take(a + clamped(ca, cc) * ac, all);
    take(b + clamped(cb, dot(bc, bc)) * bc, all);
    const V determinant = bb * cc - both * both;
    const V s = cc * ba - both * ca, t = bb * ca - both * ba;
    const V inverse = one / determinant;
    take(a + (s * inverse) * ab + (t * inverse) * ac,
         hn::And(hn::And(hn::Gt(s, zero), hn::Gt(t, zero)), hn::Lt(s + t, determinant)));
    return q;
  }
};

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
