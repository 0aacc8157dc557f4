#pragma once

// The error bounds and ranges of the filters before exact arithmetic. u = 2^-53 is the rounding
// unit. All other tolerances are in Math/Tolerances.h.
namespace palpate {

// ---- Signs of polynomials in coordinate differences (FilteredSigns.h) ----
// The differences are rounded once each, so each factor carries (1 + u).

/// Of x . y, relative to the sum of |x_i y_i|: 2 u from the factors, u from each product, 2 u from
/// the sums, and second-order terms.
constexpr double kDotError = 6 * 0x1p-53;
/// Of (x x y) . (z x w), relative to |x| |y| |z| |w| in sums of magnitudes: each cross product 4 u
/// (two factors, product, difference), the dot product 3 u, second-order terms and the bound's own
/// rounding.
constexpr double kTripleError = 12 * 0x1p-53;
/// Sums below this did not overflow in a term.
constexpr double kOverflowGuard = 0x1p1000;
/// Two factors below this multiply without overflow.
constexpr double kSquareOverflowGuard = 0x1p400;
/// More than a few products lose to underflow (2^-1074 each).
constexpr double kUnderflowGuard = 0x1p-1000;

// ---- The range of expansions (Compensated.h) ----

/// L. Coordinate differences between these have products of degree eight within the range of
/// double; others are left to integers.
constexpr double kSmallestModerate = 0x1p-100;
constexpr double kLargestModerate = 0x1p100;

// ---- Volumes and areas (Predicates.h, which has the derivations) ----

/// Of (b - a) x (c - a) . (d - a), relative to the sum of its six products' magnitudes: 8 u and the
/// sum's own rounding.
constexpr double kVolumeError = 10 * 0x1p-53;
/// Of one component of (b - a) x (c - a), relative to the sum of its products' magnitudes: 4 u and
/// the sum's own rounding.
constexpr double kAreaError = 6 * 0x1p-53;

// ---- Roots of cubic polynomials (CubicRoot.h, AlgebraicTime.cpp) ----

/// Of the step: Newton's iteration of a root ends with steps this short; two units in the last
/// place of a time.
constexpr double kRootStep = 0x1p-53;
/// Of the step: brackets of roots start this wide to either side.
constexpr double kNarrowestBracket = 0x1p-50;
/// Of the step: and at most this wide; a root that is not inside is bisected for.
constexpr double kWidestBracket = 0x1p-32;
/// Of a form's Bernstein coefficient converted to double and restricted, relative to the largest
/// coefficient (CubicTime::sign()): 2^-51 and kBlossomError.
constexpr double kFormError = 0x1p-46;

}  // namespace palpate
