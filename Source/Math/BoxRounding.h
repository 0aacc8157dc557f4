// For files with SIMD code, after Core/Simd.h: included once for each instruction set.
#if defined(PALPATE_MATH_BOX_ROUNDING) == defined(HWY_TARGET_TOGGLE)
#ifdef PALPATE_MATH_BOX_ROUNDING
#undef PALPATE_MATH_BOX_ROUNDING
#else
#define PALPATE_MATH_BOX_ROUNDING
#endif

#include "Math/Box.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <class V>
HWY_INLINE V outwardMargin(V v) {
  const hn::DFromV<V> d;
  return hn::Abs(v) * hn::Set(d, OutwardRounding::kRelative) +
         hn::Set(d, OutwardRounding::kAbsolute);
}
/// OutwardRounding in each lane.
template <class V>
HWY_INLINE V roundedDown(V v) {
  return v - outwardMargin(v);
}
template <class V>
HWY_INLINE V roundedUp(V v) {
  return v + outwardMargin(v);
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
