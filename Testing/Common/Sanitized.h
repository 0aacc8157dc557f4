#pragma once

namespace palpate::testing {

/// Sanitizers make tests ten times slower. A test that compares many random cases may take a part
/// of them in such a build; the ordinary builds take all.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr int kShareOfCases = 5;
#else
inline constexpr int kShareOfCases = 1;
#endif

constexpr int casesOf(int all) { return (all + kShareOfCases - 1) / kShareOfCases; }

}  // namespace palpate::testing
