#pragma once

#include <cstddef>

namespace palpate::testing {

/// Sanitizers make tests ten times slower. In such a build, a test with many random cases may run a
/// part of them. The ordinary builds run all.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr int kShareOfCases = 5;
#else
inline constexpr int kShareOfCases = 1;
#endif

/// Whether a test leaves out a case. Cases are counted from 0.
constexpr bool isLeftOut(std::size_t number) { return number % kShareOfCases != 0; }

constexpr int casesOf(int all) { return (all + kShareOfCases - 1) / kShareOfCases; }

/// The least number that a test of all cases must find; 0 if the build runs a part of them.
constexpr std::size_t leastOf(std::size_t all) { return kShareOfCases == 1 ? all : 0; }

}  // namespace palpate::testing
