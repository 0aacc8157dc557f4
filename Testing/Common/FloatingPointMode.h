#pragma once

#include <cstdint>

#ifdef __x86_64__
#include <xmmintrin.h>
#endif

namespace palpate::testing {

// Control and status of this thread's floating point, by the processor's own bits.

#ifdef __x86_64__
constexpr std::uint64_t kFlushResults = 0x8000, kFlushOperands = 0x0040, kRaisedExceptions = 0x3f;

inline std::uint64_t floatingPointState() { return _mm_getcsr(); }
inline void addFloatingPointMode(std::uint64_t flags) {
  _mm_setcsr(_mm_getcsr() | static_cast<unsigned>(flags));
}
#elif defined(__aarch64__)
/// FPCR above, FPSR below. One bit flushes both results and operands.
constexpr std::uint64_t kFlushResults = 0, kFlushOperands = std::uint64_t{1} << (32 + 24),
                        kRaisedExceptions = 0x9f;

inline std::uint64_t floatingPointState() {
  std::uint64_t control, status;
  asm volatile("mrs %0, fpcr" : "=r"(control));
  asm volatile("mrs %0, fpsr" : "=r"(status));
  return control << 32 | status;
}
inline void addFloatingPointMode(std::uint64_t flags) {
  const std::uint64_t control = (floatingPointState() | flags) >> 32;
  asm volatile("msr fpcr, %0" : : "r"(control));
}
#endif

}  // namespace palpate::testing
