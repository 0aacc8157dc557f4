// The one place that names the SIMD library (Highway). Its include guard is one for each
// instruction set: a file with SIMD code is compiled once for each set by including itself. Such a
// file starts with
//
//   #undef HWY_TARGET_INCLUDE
//   #define HWY_TARGET_INCLUDE "Module/File.cpp"
//   #include "Core/Simd.h"
//
// puts its kernels in namespace palpate::HWY_NAMESPACE between HWY_BEFORE_NAMESPACE() and
// HWY_AFTER_NAMESPACE(), and its exports and dispatch under #if HWY_ONCE. Every path gives the same
// bits: no fused multiply-add, no approximate reciprocal, no sum whose order depends on the width.
#if defined(PALPATE_SCALAR) && !defined(HWY_COMPILE_ONLY_SCALAR)
#define HWY_COMPILE_ONLY_SCALAR
#elif !defined(HWY_DISABLED_TARGETS)
// Paths: scalar, SSE4, AVX2, AVX-512. SSSE3 and the later AVX-512 sets would not differ here.
#ifndef PALPATE_SIMD_PATHS_LEFT_OUT
#define PALPATE_SIMD_PATHS_LEFT_OUT 0
#endif
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL | PALPATE_SIMD_PATHS_LEFT_OUT)
#endif
#if defined(__aarch64__) && !defined(TOOLCHAIN_MISS_SYS_AUXV_H)
// The path is NEON, which every processor has. Without a choice at run time Highway does not ask
// for the instructions for AES. Vectors of SVE have no size, so that Vector3 cannot hold them.
#define TOOLCHAIN_MISS_SYS_AUXV_H
#endif
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
#include <hwy/cache_control.h>

#include <cstdint>
#include <cstring>

#if defined(PALPATE_CORE_SIMD) == defined(HWY_TARGET_TOGGLE)
#ifdef PALPATE_CORE_SIMD
#undef PALPATE_CORE_SIMD
#else
#define PALPATE_CORE_SIMD
#endif

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

/// A mask of at most 16 lanes as bits, with the first lane in the lowest bit.
template <class D, class M>
HWY_ATTR HWY_INLINE std::uint32_t bitsOf(D d, M mask) {
  std::uint8_t bytes[8] = {};
  hwy::HWY_NAMESPACE::StoreMaskBits(d, mask, bytes);
  std::uint32_t bits;
  std::memcpy(&bits, bytes, sizeof bits);
  return bits;
}

/// Clears the upper halves of the AVX registers. A kernel calls this before it calls code outside
/// its namespace and before it returns. g++ 12 does so on most paths only, and each change between
/// AVX and SSE code then costs some 70 ns.
HWY_ATTR HWY_INLINE void leaveLanes() {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
  _mm256_zeroupper();
#endif
}

/// As many positions as V has lanes.
template <class V>
struct Vector3 {
  V x, y, z;

  friend HWY_ATTR HWY_INLINE Vector3 operator+(const Vector3& a, const Vector3& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend HWY_ATTR HWY_INLINE Vector3 operator-(const Vector3& a, const Vector3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend HWY_ATTR HWY_INLINE Vector3 operator*(const V& factor, const Vector3& a) {
    return {factor * a.x, factor * a.y, factor * a.z};
  }
  friend HWY_ATTR HWY_INLINE V dot(const Vector3& a, const Vector3& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
  }
  friend HWY_ATTR HWY_INLINE Vector3 cross(const Vector3& a, const Vector3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  }
};

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
