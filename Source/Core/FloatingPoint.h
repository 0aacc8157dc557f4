#pragma once

#include <cfenv>
#include <cstdint>

namespace palpate {

/// Puts this thread into the default floating-point environment for as long as the object lives:
/// rounding to nearest, denormals kept, no traps. Error bounds and exact decisions rely on it.
///
/// The destructor restores the caller's environment, including its exception flags. Exceptions that
/// the library's own arithmetic raises are neither reported nor trapped, because setting flags by
/// fesetenv() traps nothing.
///
/// x86-64   the library computes with SSE only, so that MXCSR alone decides. The x87 control word
///          is not checked: its rounding, precision and traps change no result here. If MXCSR is
///          not standard, feenableexcept() may have enabled x87 traps too, and both are set.
/// aarch64  FPCR decides; FPSR has the flags.
/// Others   the environment is always set.
/// Cost     3 nanoseconds; 0.5 microseconds if the caller's environment is not the default.
///          Nested objects cost as much as one in the default environment.
class StandardFloatingPoint {
 public:
  StandardFloatingPoint() : m_control(readControl()), m_changed(!isStandard(m_control)) {
    if (m_changed) {
      std::fegetenv(&m_callersEnvironment);
      std::fesetenv(FE_DFL_ENV);
    }
    compilerBarrier();
  }
  ~StandardFloatingPoint() {
    compilerBarrier();
    if (m_changed)
      std::fesetenv(&m_callersEnvironment);
    else
      restoreFlags(m_control);
  }
  /// Forces the result to be computed while the object lives. Compilers do not know that arithmetic
  /// depends on the environment. Without this, they may compute a function's result after the
  /// destructor if it is returned in registers.
  template <class Result>
  static Result evaluated(Result result) {
    asm volatile("" : "+m"(result));
    return result;
  }

  StandardFloatingPoint(const StandardFloatingPoint&) = delete;
  StandardFloatingPoint& operator=(const StandardFloatingPoint&) = delete;

 private:
  /// Compilers do not move loads and stores across this.
  static void compilerBarrier() { asm volatile("" ::: "memory"); }

#if defined(__x86_64__)
  static constexpr std::uint64_t kFlags = 0x3f, kDefault = 0x1f80;  // all exceptions masked
  static std::uint64_t readControl() { return __builtin_ia32_stmxcsr(); }
  static bool isStandard(std::uint64_t control) { return (control & ~kFlags) == kDefault; }
  static void restoreFlags(std::uint64_t control) {
    if (readControl() != control) __builtin_ia32_ldmxcsr(static_cast<unsigned>(control));
  }
#elif defined(__aarch64__)
  static std::uint64_t readStatus() {
    std::uint64_t status;
    asm volatile("mrs %0, fpsr" : "=r"(status));
    return status;
  }
  /// FPCR above, FPSR below: each has 32 bits.
  static std::uint64_t readControl() {
    std::uint64_t control;
    asm volatile("mrs %0, fpcr" : "=r"(control));
    return control << 32 | readStatus();
  }
  static bool isStandard(std::uint64_t control) { return control >> 32 == 0; }
  static void restoreFlags(std::uint64_t control) {
    const std::uint64_t status = control & 0xffffffff;
    if (readStatus() != status) asm volatile("msr fpsr, %0" : : "r"(status));
  }
#else
  static std::uint64_t readControl() { return 0; }
  static bool isStandard(std::uint64_t) { return false; }
  static void restoreFlags(std::uint64_t) {}
#endif

  std::uint64_t m_control;
  bool m_changed;
  std::fenv_t m_callersEnvironment;
};

/// The float nearest to a value. g++ 12 takes `double(float(x))` for x where it vectorises two of
/// them. Take this where an error bound is computed from the rounded value.
inline float roundedToFloat(double x) {
  auto rounded = static_cast<float>(x);
  asm("" : "+m"(rounded));
  return rounded;
}

}  // namespace palpate
