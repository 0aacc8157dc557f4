#pragma once

#include <cfenv>

namespace palpate {

/// While it lives, this thread rounds to nearest and keeps denormals: error bounds and exact
/// decisions count on it. What a caller had set otherwise comes back.
/// Cost     a few nanoseconds; 0.25 µs where the caller had set otherwise.
class StandardFloatingPoint {
 public:
  StandardFloatingPoint() : m_changed(!isStandard()) {
    if (!m_changed) return;
    std::fegetenv(&m_callers);
    std::fesetenv(FE_DFL_ENV);
  }
  ~StandardFloatingPoint() {
    if (m_changed) std::fesetenv(&m_callers);
  }
  StandardFloatingPoint(const StandardFloatingPoint&) = delete;
  StandardFloatingPoint& operator=(const StandardFloatingPoint&) = delete;

 private:
  static bool isStandard() {
#if defined(__x86_64__)
    constexpr unsigned kRounding = 0x6000, kFlushToZero = 0x8000, kDenormalsAreZero = 0x0040;
    return (__builtin_ia32_stmxcsr() & (kRounding | kFlushToZero | kDenormalsAreZero)) == 0;
#else
    // Volatile, so that it is computed here and not by the compiler.
    const volatile double one = 1.0, least = 0x1p-1022, denormal = 0x1p-1074;
    return one + 0x1p-54 == 1.0 && one + 0x1.8p-53 > 1.0 && least * 0.5 > 0.0 &&
           denormal * 0x1p100 > 0.0;
#endif
  }

  bool m_changed;
  std::fenv_t m_callers;
};

}  // namespace palpate
