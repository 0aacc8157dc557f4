// The coplanarity polynomial of a feature pair over its step, det(A, B, C) (see ImpactQuery), for
// numbers and for SIMD vectors of numbers. A file with SIMD code includes this after "Core/Simd.h",
// which compiles it once for each instruction set; other files get it for double.
#if defined(PALPATE_MATH_IMPACT_FORMULAS) == defined(HWY_TARGET_TOGGLE)
#ifdef PALPATE_MATH_IMPACT_FORMULAS
#undef PALPATE_MATH_IMPACT_FORMULAS
#else
#define PALPATE_MATH_IMPACT_FORMULAS
#endif

#ifdef HWY_NAMESPACE
HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
#else
namespace palpate {
#endif

/// The Bernstein coefficients of the polynomial. Each takes 11 roundings. V: double or a SIMD
/// vector.
template <class V>
struct CoplanarityOf {
  V coefficients[4];
  V permanent;  ///< of the largest magnitudes over the step: no term of det(A, B, C) exceeds it
};

template <class P>
[[gnu::always_inline]] inline auto dotProduct(const P& u, const P& v) {
  return u.x * v.x + u.y * v.y + u.z * v.z;
}

template <class P>
[[gnu::always_inline]] inline P crossProduct(const P& u, const P& v) {
  return {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
}

/// P: three components x, y and z of type V. a, b, c: A, B, C at the start and the end of the step.
/// p, q, r: their largest magnitudes over the step. three: the number 3.
template <class P, class V>
[[gnu::always_inline]] inline CoplanarityOf<V> coplanarityOf(const P (&a)[2], const P (&b)[2],
                                                             const P (&c)[2], const P& p,
                                                             const P& q, const P& r, V three) {
  const P first = crossProduct(a[0], b[0]), last = crossProduct(a[1], b[1]),
          one = crossProduct(a[0], b[1]), other = crossProduct(a[1], b[0]);
  const P middle{one.x + other.x, one.y + other.y, one.z + other.z};
  return {{dotProduct(first, c[0]), (dotProduct(middle, c[0]) + dotProduct(first, c[1])) / three,
           (dotProduct(last, c[0]) + dotProduct(middle, c[1])) / three, dotProduct(last, c[1])},
          r.x * (p.y * q.z + p.z * q.y) + r.y * (p.z * q.x + p.x * q.z) +
              r.z * (p.x * q.y + p.y * q.x)};
}

}  // namespace palpate
#ifdef HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
#endif
