// For files with SIMD code, after Core/Simd.h: included once for each instruction set. The
// arithmetic of Exact/Compensated.h, operation by operation, and thus with the same bits.
#if defined(PALPATE_MATH_COMPENSATED_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef PALPATE_MATH_COMPENSATED_LANES
#undef PALPATE_MATH_COMPENSATED_LANES
#else
#define PALPATE_MATH_COMPENSATED_LANES
#endif

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <class V>
struct SumInLanes {
  V value, error;
};
template <class V>
HWY_INLINE SumInLanes<V> exactSum(V a, V b) {
  const V sum = a + b, bRounded = sum - a;
  return {sum, (a - (sum - bRounded)) + (b - bRounded)};
}
template <class V>
HWY_INLINE SumInLanes<V> splitInHalves(V a) {
  const V scaled = hn::Set(hn::DFromV<V>(), 134217729.0) * a;
  const V high = scaled - (scaled - a);
  return {high, a - high};
}
template <class V>
HWY_INLINE SumInLanes<V> exactProduct(V a, V b) {
  const SumInLanes<V> bHalves = splitInHalves(b);
  const V product = a * b;
  const auto [high, low] = splitInHalves(a);
  return {product, ((high * bHalves.value - product) + high * bHalves.error + low * bHalves.value) +
                       low * bHalves.error};
}

template <class V>
HWY_INLINE V sumOfMagnitudes(const Vector3<V>& a) {
  return (hn::Abs(a.x) + hn::Abs(a.y)) + hn::Abs(a.z);
}
template <class V>
HWY_INLINE V largest(const Vector3<V>& a) {
  return hn::Max(hn::Abs(a.x), hn::Max(hn::Abs(a.y), hn::Abs(a.z)));
}
template <class V>
struct DifferenceInLanes {
  Vector3<V> high, low;
};
template <class V>
HWY_INLINE DifferenceInLanes<V> exactSum(const Vector3<V>& a, const Vector3<V>& b) {
  const auto x = exactSum(a.x, b.x), y = exactSum(a.y, b.y), z = exactSum(a.z, b.z);
  return {{x.value, y.value, z.value}, {x.error, y.error, z.error}};
}
template <class V>
HWY_INLINE Vector3<V> operator-(const Vector3<V>& a) {
  return {hn::Neg(a.x), hn::Neg(a.y), hn::Neg(a.z)};
}
template <class V>
HWY_INLINE DifferenceInLanes<V> difference(const Vector3<V>& a, const Vector3<V>& b) {
  return exactSum(a, -b);
}
template <class V>
HWY_INLINE DifferenceInLanes<V> sum(const DifferenceInLanes<V>& a, const DifferenceInLanes<V>& b) {
  const DifferenceInLanes<V> high = exactSum(a.high, b.high);
  return exactSum(high.high, high.low + (a.low + b.low));
}
template <class V>
HWY_INLINE SumInLanes<V> crossComponent(V uj, V ujLow, V uk, V ukLow, V vj, V vjLow, V vk,
                                        V vkLow) {
  const auto plus = exactProduct(uj, vk), minus = exactProduct(uk, vj);
  const auto high = exactSum(plus.value, hn::Neg(minus.value));
  const V mixed = (uj * vkLow + ujLow * vk) - (uk * vjLow + ukLow * vj);
  return exactSum(high.value, high.error + ((plus.error - minus.error) + mixed));
}
template <class V>
HWY_INLINE DifferenceInLanes<V> cross(const DifferenceInLanes<V>& u,
                                      const DifferenceInLanes<V>& v) {
  const Vector3<V>&p = u.high, &pLow = u.low, &q = v.high, &qLow = v.low;
  const auto x = crossComponent(p.y, pLow.y, p.z, pLow.z, q.y, qLow.y, q.z, qLow.z),
             y = crossComponent(p.z, pLow.z, p.x, pLow.x, q.z, qLow.z, q.x, qLow.x),
             z = crossComponent(p.x, pLow.x, p.y, pLow.y, q.x, qLow.x, q.y, qLow.y);
  return {{x.value, y.value, z.value}, {x.error, y.error, z.error}};
}
template <class V>
HWY_INLINE SumInLanes<V> plusProduct(const SumInLanes<V>& all, V u, V uLow, V v, V vLow) {
  const auto product = exactProduct(u, v), sum = exactSum(all.value, product.value);
  return {sum.value, all.error + (sum.error + (product.error + (u * vLow + uLow * v)))};
}
template <class V>
HWY_INLINE V accurateDot(const DifferenceInLanes<V>& u, const DifferenceInLanes<V>& v) {
  const V zero = hn::Zero(hn::DFromV<V>());
  SumInLanes<V> all{zero, zero};
  all = plusProduct(all, u.high.x, u.low.x, v.high.x, v.low.x);
  all = plusProduct(all, u.high.y, u.low.y, v.high.y, v.low.y);
  all = plusProduct(all, u.high.z, u.low.z, v.high.z, v.low.z);
  return all.value + all.error;
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
