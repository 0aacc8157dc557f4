#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdlib>

namespace palpate::testing {

#if defined(__has_feature)  // clang
#if __has_feature(address_sanitizer)
#define PALPATE_ADDRESS_SANITIZER
#endif
#if __has_feature(thread_sanitizer)
#define PALPATE_THREAD_SANITIZER
#endif
#endif
#ifdef __SANITIZE_ADDRESS__
#define PALPATE_ADDRESS_SANITIZER
#endif
#ifdef __SANITIZE_THREAD__
#define PALPATE_THREAD_SANITIZER
#endif

#ifdef PALPATE_ADDRESS_SANITIZER
inline constexpr bool kAddressSanitizer = true;
#else
inline constexpr bool kAddressSanitizer = false;
#endif
#ifdef PALPATE_THREAD_SANITIZER
inline constexpr bool kThreadSanitizer = true;
#else
inline constexpr bool kThreadSanitizer = false;
#endif
inline constexpr bool kSanitized = kAddressSanitizer || kThreadSanitizer;

/// Sanitizers make tests ten times slower. In such a build, a test with many random cases may run a
/// part of them: one of a prime number, so that loops over few kinds of case keep all kinds. The
/// ordinary builds run all, but those that isLongRun() leaves out. -DPALPATE_SHARE_OF_CASES=1 makes
/// a sanitizer run all, too.
#ifdef PALPATE_SHARE_OF_CASES
inline constexpr int kShareOfCases = PALPATE_SHARE_OF_CASES;
#else
inline constexpr int kShareOfCases = kSanitized ? 13 : 1;
#endif

/// Whether a test leaves out a case. Cases are counted from 0.
constexpr bool isLeftOut(std::size_t number) { return number % kShareOfCases != 0; }

constexpr int casesOf(int all) { return (all + kShareOfCases - 1) / kShareOfCases; }

/// The least number that a test of all cases must find; 0 if the build runs a part of them.
constexpr std::size_t leastOf(std::size_t all) { return kShareOfCases == 1 ? all : 0; }

// Of some tests, an ordinary run takes a part of the cases. A long run takes all: `ctest -L long`
// sets PALPATE_LONG for the suites that call one of these functions.

inline bool isLongRun() {
  static const bool isLong = std::getenv("PALPATE_LONG") != nullptr;
  return isLong;
}

/// One case of so many runs: of `ordinary` in an ordinary run, which should be a prime number.
inline std::size_t shareOfCases(int ordinary) {
  const int share = kShareOfCases > 1 ? std::max(kShareOfCases, ordinary)
                    : isLongRun()     ? 1
                                      : ordinary;
  return static_cast<std::size_t>(share);
}
inline bool isLeftOut(std::size_t number, int share) { return number % shareOfCases(share) != 0; }
inline int casesOf(int all, int few) {
  return kShareOfCases > 1 ? std::min(casesOf(all), few) : isLongRun() ? all : few;
}
inline std::size_t leastOf(std::size_t all, std::size_t ofFew) {
  return isLongRun() ? leastOf(all) : leastOf(ofFew);
}

}  // namespace palpate::testing
