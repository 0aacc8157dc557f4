#pragma once

// The error bounds and ranges of the filters that precede exact arithmetic. u = 2^-53 is the
// rounding unit. All other tolerances are in Math/Tolerances.h.
namespace palpate {

// ---- Signs of polynomials in coordinate differences (FilteredSigns.h) ----
// The differences are rounded once each, so each factor carries (1 + u).

/// Error of x . y, relative to the sum of |x_i y_i|: 2 u from the factors, u from each product, 2 u
/// from the sums, and second-order terms.
constexpr double kDotError = 6 * 0x1p-53;
/// Error of (x x y) . (z x w), relative to |x| |y| |z| |w| in sums of magnitudes: each cross
/// product 4 u (two factors, product, difference), the dot product 3 u, second-order terms and the
/// bound's own rounding.
constexpr double kTripleError = 12 * 0x1p-53;
/// If a sum is below this, none of its terms overflowed.
constexpr double kOverflowGuard = 0x1p1000;
/// Two factors below this multiply without overflow.
constexpr double kSquareOverflowGuard = 0x1p400;
/// A bound on what a few products lose to underflow (2^-1074 each).
constexpr double kUnderflowGuard = 0x1p-1000;

// ---- The range of expansions (Compensated.h) ----

/// L. Products of eight coordinate differences between these stay within the range of double. Other
/// differences are handled in integers.
constexpr double kSmallestModerate = 0x1p-100;
constexpr double kLargestModerate = 0x1p100;

// ---- Volumes and areas (Predicates.h, which has the derivations) ----

/// Error of (b - a) x (c - a) . (d - a), relative to the sum of its six products' magnitudes: 8 u
/// and the sum's own rounding.
constexpr double kVolumeError = 10 * 0x1p-53;
/// Error of one component of (b - a) x (c - a), relative to the sum of its products' magnitudes: 4
/// u and the sum's own rounding.
constexpr double kAreaError = 6 * 0x1p-53;

// ---- Roots of cubic polynomials (CubicRoot.h, AlgebraicTime.cpp) ----

/// Share of the step: Newton's iteration for a root ends with steps this short, four units in the
/// last place of a time.
constexpr double kRootStep = 0x1p-51;
/// Share of the step: brackets of roots start this wide to either side.
constexpr double kNarrowestBracket = 0x1p-50;
/// If a root is not in a bracket, the next one of findPassages() is wider by this factor.
constexpr double kBracketGrowth = 64.0;
/// Share of the step: brackets grow to at most this width. If a root is in none of them, it is
/// found by bisection.
constexpr double kWidestBracket = 0x1p-32;
/// Error of a form's Bernstein coefficient converted to double and restricted, relative to the
/// largest coefficient (CubicTime::sign()): 2^-51 and kBlossomError.
constexpr double kFormError = 0x1p-46;

}  // namespace palpate
