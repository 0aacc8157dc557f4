#include "Exact/AlgebraicTime.h"

#include "Exact/CubicRoot.h"
#include "Exact/ErrorBounds.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

/// The moment t in (0, 1), as x = t / (1 - t).
QuadraticTime momentAt(double t) {
  int exponent;
  const double mantissa = std::ldexp(std::frexp(t, &exponent), 53);
  QuadraticTime moment;
  moment.p = mantissa;
  moment.r = 1;
  moment.r <<= 53 - exponent;
  moment.r -= moment.p;
  return moment;
}

/// Coefficients divided by one power of two, so that the largest is about 1. Each has a relative
/// error of at most 2^-51.
template <std::size_t N>
std::array<double, N> toDoubles(const std::array<Integer, N>& form) {
  std::array<double, N> mantissas;
  std::array<long, N> exponents;
  long largest = 0;
  for (std::size_t i = 0; i < N; ++i) {
    mantissas[i] = mpz_get_d_2exp(&exponents[i], form[i].get_mpz_t());
    if (mantissas[i] != 0.0) largest = std::max(largest, exponents[i]);
  }
  for (std::size_t i = 0; i < N; ++i)
    mantissas[i] =
        std::ldexp(mantissas[i], static_cast<int>(std::max(exponents[i] - largest, -2000L)));
  return mantissas;
}

}  // namespace

double QuadraticTime::timeLowerBound() const {
  // floor(2^64 (p + q √d)), or one less.
  Integer numerator = d << 128;
  numerator = sqrt(numerator);
  if (q < 0) numerator = -numerator - 1;
  if (q == 0) numerator = 0;
  numerator += p << 64;
  if (numerator <= 0) return 0.0;
  const Integer time = (numerator << 60) / (numerator + (r << 64));
  return std::ldexp(time.get_d(), -60);  // get_d truncates
}

std::vector<QuadraticTime> rootsInside(const Form<1>& form) {
  PALPATE_ASSERT(form[0] != 0 || form[1] != 0);
  std::vector<QuadraticTime> roots;
  if (sgn(form[0]) * sgn(form[1]) < 0) roots.push_back({abs(form[0]), abs(form[1]), 0, 0});
  return roots;
}

std::vector<QuadraticTime> rootsInside(const Form<2>& form) {
  PALPATE_ASSERT(form[0] != 0 || form[1] != 0 || form[2] != 0);
  const int sign = sgn(form[2]);
  if (sign == 0) return rootsInside(Form<1>{form[0], form[1]});
  // sign · form has a positive leading coefficient. Its roots are (-b ± √(b² - 4 a c)) / 2 a.
  const int signB = sign * sgn(form[1]), signC = sign * sgn(form[0]);
  if (signC >= 0 && signB >= 0) return {};  // the signs do not change: there is no positive root
  if (signC == 0) return rootsInside(Form<1>{form[1], form[2]});
  std::vector<QuadraticTime> roots;
  QuadraticTime root;
  root.d = form[1] * form[1] - 4 * form[0] * form[2];
  if (sgn(root.d) < 0) return roots;
  root.p = -sign * form[1];
  root.r = 2 * sign * form[2];
  if (sgn(root.d) == 0) {
    roots.push_back(root);
    return roots;
  }
  root.q = -1;
  if (signC > 0) roots.push_back(root);  // both roots have one sign, positive as -b is
  root.q = 1;
  roots.push_back(std::move(root));
  return roots;
}

int signBeforeEnd(const Form<3>& form) {
  int i = 3;
  while (i > 0 && form[i] == 0) --i;
  return sgn(form[i]);
}

void removeRootsAtStart(Form<3>& form) {
  PALPATE_ASSERT(!isZero(form));
  while (form[0] == 0) form = {form[1], form[2], form[3], 0};
}

CriticalPoints criticalPoints(const Form<3>& form) {
  const Form<2> slope{form[1], 2 * form[2], 3 * form[3]};
  CriticalPoints result;
  if (form[3] == 0) {
    if (form[2] == 0) return result;
    result.inside = rootsInside(Form<1>{slope[0], slope[1]});
    result.before = 1 - static_cast<int>(result.inside.size());
    return result;
  }
  if (form[2] * form[2] <= 3 * form[1] * form[3]) return result;  // monotone
  result.inside = rootsInside(slope);
  result.before = 2 - static_cast<int>(result.inside.size());
  return result;
}

CubicTime::CubicTime(const Form<3>& cubic, int cell, int rising, double lower, double upper)
    : m_cubic(cubic), m_cell(cell), m_rising(rising) {
  PALPATE_ASSERT(cell >= 0 && cell <= 2 && (rising == 1 || rising == -1));
  bracket(lower, upper);
}

/// The place of the other moment among the critical points: twice the index of the interval that
/// contains it, or an odd number if it is the critical point between two intervals. If there are no
/// critical points, m_cell's own value.
int CubicTime::cellOf(const QuadraticTime& other) const {
  const Form<2> slope{m_cubic[1], 2 * m_cubic[2], 3 * m_cubic[3]};
  if (m_cubic[3] == 0) {
    if (m_cubic[2] == 0) return 2 * m_cell;
    return 1 + other.sign(Form<1>{slope[0], slope[1]}) * sgn(m_cubic[2]);
  }
  if (m_cubic[2] * m_cubic[2] <= 3 * m_cubic[1] * m_cubic[3]) return 2 * m_cell;
  const int outside = other.sign(slope) * sgn(m_cubic[3]);
  if (outside < 0) return 2;
  const int side = other.sign(Form<1>{m_cubic[2], 3 * m_cubic[3]}) * sgn(m_cubic[3]);
  return 2 + side * (1 + outside);
}

int CubicTime::compare(const QuadraticTime& other) const {
  const int difference = 2 * m_cell - cellOf(other);
  if (difference > 1) return 1;
  if (difference < -1) return -1;
  return -m_rising * other.sign(m_cubic);
}

int CubicTime::compare(double t) const {
  if (t <= 0.0) return 1;
  if (t >= 1.0) return -1;
  return compare(momentAt(t));
}

void CubicTime::bracket(double lower, double upper) {
  CubicBernstein b = toDoubles(m_cubic);
  b[1] /= 3.0;
  b[2] /= 3.0;
  const double t = approximateRoot(b, lower, std::max(lower, upper), m_rising);
  for (double width = kNarrowestBracket; width <= kWidestBracket; width *= 0x1p9) {
    const double low = std::max(t - width, 0.0), high = std::min(t + width, 1.0);
    if (compare(low) >= 0 && compare(high) <= 0) {
      m_low = low;
      m_high = high;
      return;
    }
  }
}

double CubicTime::timeLowerBound(double tolerance) const {
  PALPATE_ASSERT(tolerance > 0.0 && m_low <= m_high);
  double low = m_low, high = m_high;
  while (high - low > tolerance) {
    const double middle = 0.5 * (low + high);
    (compare(middle) >= 0 ? low : high) = middle;
  }
  return low;
}

int CubicTime::sign(const Form<2>& form) const {
  const int signs[3] = {sgn(form[0]), sgn(form[1]), sgn(form[2])};
  const auto [least, most] = std::minmax({signs[0], signs[1], signs[2]});
  if (least >= 0) return most;
  if (most <= 0) return least;

  QuadraticBernstein b = toDoubles(form);
  b[1] *= 0.5;
  const double error = kFormError;
  const double low = blossom(b, m_low, m_low), middle = blossom(b, m_low, m_high),
               high = blossom(b, m_high, m_high);
  if (std::min({low, middle, high}) > error) return 1;
  if (std::max({low, middle, high}) < -error) return -1;

  int result = signs[2] != 0 ? signs[2] : signs[1];  // the sign beyond the last root
  const std::vector<QuadraticTime> roots = rootsInside(form);
  for (auto root = roots.rbegin(); root != roots.rend(); ++root) {
    const int order = compare(*root);
    if (order == 0) return 0;
    if (order > 0) return result;
    if (root->q != 0 || signs[2] == 0 || signs[0] == 0) result = -result;  // a double root keeps it
  }
  return result;
}

}  // namespace palpate
