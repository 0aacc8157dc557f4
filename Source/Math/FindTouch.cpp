// Part of Math/ImpactQuery.h: findTouch(), findPassages().
#include "Math/ImpactQuery.h"
#include "Math/RelativeMotion.h"
#include "Math/Tolerances.h"
#include "Exact/CubicRoot.h"
#include "Core/Assert.h"

#include <algorithm>
#include <optional>

namespace palpate {

namespace {

using Eigen::Vector3d;
using Kind = ImpactQuery::Kind;

/// The Bernstein coefficients of det(A, B, C), each within `error`. One bound serves all four,
/// because the permanent bounds all of them. Each takes 11 roundings.
struct Coplanarity {
  CubicBernstein coefficients;
  double error;
};

template <Kind kind>
Coplanarity coplanarity(const RelativeMotion<kind>& motion) {
  const auto found = motion.coplanarity();
  const auto& [f0, f1, f2, f3] = found.coefficients;
  return {{f0, f1, f2, f3}, kCoplanarityError * found.permanent + kImpactUnderflow};
}

/// 1 or -1 if all coefficients certainly have that sign, else 0.
template <std::size_t N>
int certainSign(const std::array<double, N>& coefficients, double error) {
  const auto [least, most] = std::minmax_element(coefficients.begin(), coefficients.end());
  return *least > error ? 1 : *most < -error ? -1 : 0;
}

template <std::size_t N>
double largestMagnitude(const std::array<double, N>& coefficients) {
  double largest = 0.0;
  for (const double c : coefficients) largest = std::max(largest, std::abs(c));
  return largest;
}

CubicBernstein restrict(const CubicBernstein& b, const Interval& t) {
  return {blossom(b, t.low, t.low, t.low), blossom(b, t.low, t.low, t.high),
          blossom(b, t.low, t.high, t.high), blossom(b, t.high, t.high, t.high)};
}

/// The sign after the only root if the coefficients certainly change sign exactly once, else 0.
/// There is then exactly one root, and it is simple (Descartes' rule). One uncertain coefficient
/// between two signs does not matter.
int signAfterOnlyRoot(const CubicBernstein& b, double error) {
  int signs[4];
  for (int i = 0; i < 4; ++i) signs[i] = b[i] > error ? 1 : b[i] < -error ? -1 : 0;
  if (signs[0] * signs[3] >= 0) return 0;
  const bool changesOnce = signs[1] == signs[0] || (signs[1] == 0 && signs[2] == signs[3]) ||
                           (signs[1] == signs[3] && signs[2] == signs[3]);
  return changesOnce ? signs[3] : 0;
}

template <Kind kind>
class ImpactSearch {
 public:
  ImpactSearch(const RelativeMotion<kind>& motion, double tolerance)
      : m_motion(motion), m_tolerance(tolerance), m_largest(motion.largestDifference()) {}

  /// None if floating point could not decide.
  std::optional<ImpactResult> run(double upTo);
  std::optional<Passages> passages();

 private:
  enum class Verdict { Inside, Outside, Unknown };

  std::optional<Interval> bracketRoot(const Interval& piece, int signAfter) const;
  Verdict classify(const Interval& bracket) const;
  Interval separatedAround(double t) const {
    return m_motion.separatedAround(t, m_largest, m_motion.bestSeparation(t), 0.0);
  }

  const RelativeMotion<kind>& m_motion;
  double m_tolerance;
  Vector3d m_largest;
  CubicBernstein m_cubic{};
  double m_error = 0.0;  ///< of m_cubic restricted to any part of the step
};

/// A narrow interval around the cubic's only root in the piece. At its ends the cubic certainly has
/// different signs.
template <Kind kind>
std::optional<Interval> ImpactSearch<kind>::bracketRoot(const Interval& piece,
                                                        int signAfter) const {
  const double t = approximateRoot(m_cubic, piece.low, piece.high, signAfter);
  // The width applies to both sides, so half of the tolerance is the widest that is not too early.
  for (double width = kNarrowestBracket; width <= 0.5 * m_tolerance; width *= kBracketGrowth) {
    const Interval bracket{std::max(t - width, piece.low), std::min(t + width, piece.high)};
    if (signAfter * blossom(m_cubic, bracket.low, bracket.low, bracket.low) < -m_error &&
        signAfter * blossom(m_cubic, bracket.high, bracket.high, bracket.high) > m_error)
      return bracket;
  }
  return {};
}

/// Component k of l x r over an interval, for its sign: a quadratic within 8 roundings of each
/// coefficient.
struct CrossComponent {
  QuadraticBernstein coefficients;
  double error;
  using Ends = std::array<Vector3d, 2>;

  CrossComponent(const Ends& l, const Ends& r, int k, const Interval& t) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const auto cross = [&](int m, int n) { return l[m][i] * r[n][j] - l[m][j] * r[n][i]; };
    const auto largest = [](const Ends& ends, int n) {
      return std::max(std::abs(ends[0][n]), std::abs(ends[1][n]));
    };
    const QuadraticBernstein whole{cross(0, 0), 0.5 * (cross(0, 1) + cross(1, 0)), cross(1, 1)};
    coefficients = {blossom(whole, t.low, t.low), blossom(whole, t.low, t.high),
                    blossom(whole, t.high, t.high)};
    error = kCrossError * (largest(l, i) * largest(r, j) + largest(l, j) * largest(r, i)) +
            kImpactUnderflow;
  }
  CrossComponent operator-(const CrossComponent& other) const {
    CrossComponent difference = *this;
    for (int i = 0; i < 3; ++i) difference.coefficients[i] -= other.coefficients[i];
    difference.error += other.error;
    return difference;
  }
  int sign() const { return certainSign(coefficients, error); }
};

/// Whether C = x A + y B is in the domain at the time within the bracket at which A, B and C are in
/// one plane. Uses Cramer's rule in the coordinates that separate A and B best.
template <Kind kind>
typename ImpactSearch<kind>::Verdict ImpactSearch<kind>::classify(const Interval& bracket) const {
  const double t = 0.5 * (bracket.low + bracket.high);
  int k;
  at(t, m_motion.a).cross(at(t, m_motion.b)).cwiseAbs().maxCoeff(&k);
  const CrossComponent normal(m_motion.a, m_motion.b, k, bracket);
  const int side = normal.sign();
  if (side == 0) return Verdict::Unknown;
  const CrossComponent x(m_motion.c, m_motion.b, k, bracket), y(m_motion.a, m_motion.c, k, bracket);
  const int signX = side * x.sign(), signY = side * y.sign();
  if (signX < 0 || signY < 0) return Verdict::Outside;
  if constexpr (RelativeMotion<kind>::kSquare) {
    const int restX = side * (normal - x).sign(), restY = side * (normal - y).sign();
    if (restX < 0 || restY < 0) return Verdict::Outside;
    return signX > 0 && signY > 0 && restX > 0 && restY > 0 ? Verdict::Inside : Verdict::Unknown;
  } else {
    const int rest = side * (normal - x - y).sign();
    if (rest < 0) return Verdict::Outside;
    return signX > 0 && signY > 0 && rest > 0 ? Verdict::Inside : Verdict::Unknown;
  }
}

/// Passages where the volume certainly changes its sign once at most. None if floating point cannot
/// decide them.
template <Kind kind>
std::optional<Passages> ImpactSearch<kind>::passages() {
  if (!(m_largest.maxCoeff() <= kLargestImpactDifference)) return {};
  const Coplanarity cubic = coplanarity(m_motion);
  if (certainSign(cubic.coefficients, cubic.error) != 0) return Passages{};
  m_cubic = cubic.coefficients;
  m_error = cubic.error + kBlossomError * largestMagnitude(m_cubic);
  const int signAfter = signAfterOnlyRoot(m_cubic, m_error);
  if (signAfter == 0) return {};
  const std::optional<Interval> bracket = bracketRoot({0.0, 1.0}, signAfter);
  if (!bracket) return {};
  const Verdict verdict = classify(*bracket);
  if (verdict == Verdict::Unknown) return {};
  Passages found;
  if (verdict == Verdict::Inside) found.all[found.count++] = {bracket->low, signAfter > 0};
  return found;
}

template <Kind kind>
std::optional<ImpactResult> ImpactSearch<kind>::run(double upTo) {
  if (!(m_largest.maxCoeff() <= kLargestImpactDifference)) return {};
  const Coplanarity cubic = coplanarity(m_motion);
  if (certainSign(cubic.coefficients, cubic.error) != 0) return ImpactResult{};
  m_cubic = cubic.coefficients;
  const double largest = largestMagnitude(m_cubic);
  m_error = cubic.error + kBlossomError * largest;
  const bool alwaysCoplanar = largest <= cubic.error;

  // The pieces of the step that remain, later pieces first.
  constexpr int kMaxPieces = 16, kMaxSteps = 32;
  std::array<Interval, kMaxPieces> pieces;
  int count = 0;
  pieces[count++] = {0.0, upTo};
  for (int step = 0; count > 0; ++step) {
    if (step == kMaxSteps || count + 2 > kMaxPieces) return {};
    const Interval piece = pieces[--count];
    const CubicBernstein part = restrict(m_cubic, piece);
    if (certainSign(part, m_error) != 0) continue;
    double t = 0.5 * (piece.low + piece.high);
    const int signAfter = signAfterOnlyRoot(part, m_error);
    if (signAfter != 0) {
      const std::optional<Interval> bracket = bracketRoot(piece, signAfter);
      if (!bracket) return {};
      const Verdict verdict = classify(*bracket);
      if (verdict == Verdict::Inside) return ImpactResult{true, false, bracket->low};
      if (verdict == Verdict::Outside) continue;
      t = 0.5 * (bracket->low + bracket->high);
      const Interval separated = separatedAround(t);
      if (separated.low <= bracket->low && separated.high >= bracket->high) continue;
      return {};
    }
    const Interval separated = separatedAround(t);
    if (!separated.empty()) {
      if (separated.high < piece.high) pieces[count++] = {separated.high, piece.high};
      if (separated.low > piece.low) pieces[count++] = {piece.low, separated.low};
    } else {
      if (alwaysCoplanar) return {};
      pieces[count++] = {t, piece.high};
      pieces[count++] = {piece.low, t};
    }
  }
  return ImpactResult{};
}

template <Kind kind>
ImpactResult find(const ImpactQuery& query, double tolerance, double upTo) {
  const RelativeMotion<kind> motion(query);
  if (motion.boxesSeparate()) return {};
  ImpactSearch<kind> search(motion, tolerance);
  std::optional<ImpactResult> result = search.run(upTo);
  // The search is repeated over the whole step, as that may decide what a part cannot: the time
  // must not depend on upTo.
  if (upTo < 1.0 && (!result || result->impact)) result = search.run(1.0);
  return result ? *result : findTouchExactly(query, tolerance);
}

template <Kind kind>
Passages findPassagesOf(const ImpactQuery& query, double tolerance, const Surroundings* around) {
  const RelativeMotion<kind> motion(query);
  if (motion.boxesSeparate()) return {};
  if (const auto found = ImpactSearch<kind>(motion, tolerance).passages()) return *found;
  // Only features that touch can pass.
  const ImpactResult touch = find<kind>(query, tolerance, 1.0);
  if (touch.impact) return findPassagesExactly(query, tolerance, around);
  return {{}, 0, touch.exact};
}

}  // namespace

Passages findPassages(const ImpactQuery& query, double tolerance, const Surroundings* around) {
  PALPATE_ASSERT(tolerance >= kSmallestTimeTolerance && tolerance <= 1.0);
  return query.kind == Kind::VertexTriangle
             ? findPassagesOf<Kind::VertexTriangle>(query, tolerance, around)
             : findPassagesOf<Kind::EdgeEdge>(query, tolerance, around);
}

ImpactResult findTouch(const ImpactQuery& query, double tolerance, double upTo) {
  PALPATE_ASSERT(tolerance >= kSmallestTimeTolerance && tolerance <= 1.0);
  return query.kind == Kind::VertexTriangle ? find<Kind::VertexTriangle>(query, tolerance, upTo)
                                            : find<Kind::EdgeEdge>(query, tolerance, upTo);
}

}  // namespace palpate
