#pragma once

#include <gmpxx.h>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

/// A slow decision of continuous detection by other methods than the library's: rational
/// polynomials in the power basis, Sturm sequences, signs at roots by greatest common divisors and
/// bisection, and formulas of degree four. It shares no code with Source/.
namespace palpate::impact {

using Rational = mpq_class;
/// Coefficients of 1, t, t², …; no trailing zeros; zero is empty.
using Polynomial = std::vector<Rational>;

inline Polynomial trimmed(Polynomial p) {
  while (!p.empty() && p.back() == 0) p.pop_back();
  return p;
}
inline Polynomial operator+(const Polynomial& l, const Polynomial& r) {
  Polynomial sum(std::max(l.size(), r.size()));
  for (std::size_t i = 0; i < l.size(); ++i) sum[i] += l[i];
  for (std::size_t i = 0; i < r.size(); ++i) sum[i] += r[i];
  return trimmed(sum);
}
inline Polynomial operator*(const Polynomial& l, const Polynomial& r) {
  if (l.empty() || r.empty()) return {};
  Polynomial product(l.size() + r.size() - 1);
  for (std::size_t i = 0; i < l.size(); ++i)
    for (std::size_t j = 0; j < r.size(); ++j) product[i + j] += l[i] * r[j];
  return trimmed(product);
}
inline Polynomial operator-(const Polynomial& l, const Polynomial& r) {
  return l + Polynomial{Rational(-1)} * r;
}
inline Rational valueAt(const Polynomial& p, const Rational& t) {
  Rational value = 0;
  for (auto c = p.rbegin(); c != p.rend(); ++c) value = value * t + *c;
  return value;
}
inline Polynomial derivative(const Polynomial& p) {
  Polynomial d;
  for (std::size_t i = 1; i < p.size(); ++i) d.push_back(p[i] * static_cast<int>(i));
  return d;
}
struct Division {
  Polynomial quotient, remainder;
};
inline Division divide(Polynomial p, const Polynomial& by) {
  Polynomial quotient(p.size() >= by.size() ? p.size() - by.size() + 1 : 0);
  while (p.size() >= by.size()) {
    const std::size_t shift = p.size() - by.size();
    const Rational factor = p.back() / by.back();
    quotient[shift] = factor;
    for (std::size_t i = 0; i < by.size(); ++i) p[shift + i] -= factor * by[i];
    p = trimmed(p);
  }
  return {quotient, p};
}
/// Multiplies by a positive number, so that coefficients are integers without a common divisor,
/// which are faster.
inline Polynomial primitive(Polynomial p) {
  mpz_class denominator = 1, divisor = 0;
  for (const Rational& c : p) denominator = lcm(denominator, c.get_den());
  for (const Rational& c : p)
    divisor = gcd(divisor, mpz_class(c.get_num() * denominator / c.get_den()));
  for (Rational& c : p) c *= Rational(denominator) / divisor;
  return p;
}
inline Polynomial commonDivisor(Polynomial l, Polynomial r) {
  while (!r.empty()) l = std::exchange(r, primitive(divide(l, r).remainder));
  return l;
}

/// Counts the roots of a polynomial in (low, high], by Sturm's theorem.
class RootCounter {
 public:
  explicit RootCounter(const Polynomial& p) : m_sequence{p, derivative(p)} {
    while (!m_sequence.back().empty())
      m_sequence.push_back(
          primitive(Polynomial{Rational(-1)} *
                    divide(m_sequence[m_sequence.size() - 2], m_sequence.back()).remainder));
  }
  int operator()(const Rational& low, const Rational& high) const {
    return changes(low) - changes(high);
  }

 private:
  int changes(const Rational& t) const {
    int count = 0, last = 0;
    for (const Polynomial& q : m_sequence) {
      const int sign = sgn(valueAt(q, t));
      if (sign != 0 && last != 0 && sign != last) ++count;
      if (sign != 0) last = sign;
    }
    return count;
  }
  std::vector<Polynomial> m_sequence;
};
inline int rootCount(const Polynomial& p, const Rational& low, const Rational& high) {
  return RootCounter(p)(low, high);
}

/// A real number: the only root of `p`, which has no multiple ones, in (low, high]; or low where p
/// is empty.
struct Real {
  Polynomial p;
  Rational low, high;

  /// Whether it is at most t, in (low, high]. p changes its sign at the root, unless it has a root
  /// at low, too.
  bool isAtMost(const Rational& t) const {
    const int start = sgn(valueAt(p, low)), there = sgn(valueAt(p, t));
    return start == 0 ? rootCount(p, low, t) == 1 : there != start;
  }
  void halve() {
    const Rational middle = (low + high) / 2;
    (isAtMost(middle) ? high : low) = middle;
  }
  int sign(const Polynomial& q) {
    if (p.empty()) return sgn(valueAt(q, low));
    if (q.empty()) return 0;
    const Polynomial common = commonDivisor(p, q);
    if (common.size() > 1 && rootCount(common, low, high) == 1) return 0;
    const RootCounter count(q);
    while (count(low, high) > 0 || valueAt(q, low) == 0) halve();
    return sgn(valueAt(q, high));
  }
  /// Sign of this root minus t.
  int compare(const Rational& t) {
    if (p.empty()) return cmp(low, t);
    if (t <= low) return 1;
    if (t > high) return -1;
    if (!isAtMost(t)) {
      low = t;
      return 1;
    }
    high = t;
    return valueAt(p, t) == 0 ? 0 : -1;
  }
};

/// The roots of a polynomial that is not zero, in [0, 1], ascending.
inline std::vector<Real> rootsInStep(const Polynomial& q) {
  std::vector<Real> roots;
  if (valueAt(q, 0) == 0) roots.push_back({{}, 0, 0});
  const Polynomial p = primitive(divide(q, commonDivisor(q, derivative(q))).quotient);
  std::vector<std::array<Rational, 2>> pieces{{0, 1}};
  while (!pieces.empty()) {
    const auto [low, high] = pieces.back();
    pieces.pop_back();
    const int count = rootCount(p, low, high);
    if (count == 1) roots.push_back({p, low, high});
    if (count < 2) continue;
    const Rational middle = (low + high) / 2;
    pieces.push_back({middle, high});
    pieces.push_back({low, middle});
  }
  return roots;
}

using Vector = std::array<Polynomial, 3>;
inline Vector operator-(const Vector& l, const Vector& r) {
  return {l[0] - r[0], l[1] - r[1], l[2] - r[2]};
}
inline Polynomial dot(const Vector& l, const Vector& r) {
  return l[0] * r[0] + l[1] * r[1] + l[2] * r[2];
}
inline Vector cross(const Vector& l, const Vector& r) {
  return {l[1] * r[2] - l[2] * r[1], l[2] * r[0] - l[0] * r[2], l[0] * r[1] - l[1] * r[0]};
}

/// (v, a, b, c) or (p0, p1, q0, q1), before and then now.
using Positions = std::array<Eigen::Vector3d, 8>;

class Query {
 public:
  Query(bool edges, const Positions& positions) : m_edges(edges) {
    // Whole numbers, times one power of two.
    mpz_class scale = 1;
    for (const Eigen::Vector3d& p : positions)
      for (const double x : p) scale = lcm(scale, Rational(x).get_den());
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k) {
        const Rational before = scale * Rational(positions[i][k]),
                       now = scale * Rational(positions[4 + i][k]);
        m_vertices[i][k] = trimmed({before, now - before});
      }
    const auto& [v, a, b, c] = m_vertices;
    m_coplanarity = dot(a - v, cross(b - v, c - v));
    if (m_edges) {
      const Vector normal = cross(a - v, c - b);
      m_normalSquared = dot(normal, normal);
      const Polynomial s = dot(cross(b - v, c - b), normal), r = dot(cross(b - v, a - v), normal);
      m_notNegative = {s, m_normalSquared - s, r, m_normalSquared - r};
      m_segments = {{v, b, c}, {a, b, c}, {b, v, a}, {c, v, a}};
    } else {
      const Vector normal = cross(b - a, c - a);
      m_normalSquared = dot(normal, normal);
      m_notNegative = {dot(cross(b - a, v - a), normal), dot(cross(c - b, v - b), normal),
                       dot(cross(a - c, v - c), normal)};
      m_segments = {{v, a, b}, {v, b, c}, {v, c, a}};
    }
  }

  /// The first time in [0, 1] at which the features touch.
  std::optional<Real> firstTouch() const {
    std::vector<Real> times;
    if (!m_coplanarity.empty()) {
      times = rootsInStep(m_coplanarity);
    } else {
      // Any polynomial that the test evaluates may change its sign at the first touch.
      times.push_back({{}, 0, 0});
      std::vector<Polynomial> all = m_notNegative;
      all.push_back(m_normalSquared);
      for (const auto& [p, q, r] : m_segments) {
        for (const Polynomial& component : cross(q - p, r - p)) all.push_back(component);
        all.push_back(dot(q - p, r - p));
      }
      for (const Polynomial& p : all)
        if (!p.empty())
          for (const Real& root : rootsInStep(p)) times.push_back(root);
    }
    std::optional<Real> first;
    for (Real& time : times)
      if ((!first || isBefore(time, *first)) && touchAt(time)) first = time;
    return first;
  }

  /// For (v, a, b, c): det(a - v, b - v, c - v).
  const Polynomial& coplanarity() const { return m_coplanarity; }

  bool touchAt(Real time) const {
    if (time.sign(m_coplanarity) != 0) return false;
    if (time.sign(m_normalSquared) != 0)
      return std::all_of(m_notNegative.begin(), m_notNegative.end(),
                         [&](const Polynomial& p) { return time.sign(p) >= 0; });
    return std::any_of(m_segments.begin(), m_segments.end(), [&](const auto& segment) {
      const auto& [p, q, r] = segment;
      for (const Polynomial& component : cross(q - p, r - p))
        if (time.sign(component) != 0) return false;
      return time.sign(dot(q - p, r - p)) <= 0;
    });
  }

 private:
  static bool isBefore(Real l, Real r) {
    if (r.p.empty()) return l.compare(r.low) < 0;
    if (l.p.empty()) return r.compare(l.low) > 0;
    // Roots are equal if a common factor has a root in both intervals. Otherwise bisection
    // separates them.
    const Polynomial common = commonDivisor(l.p, r.p);
    for (;;) {
      if (l.high <= r.low) return true;
      if (r.high <= l.low) return false;
      if (common.size() > 1) {
        const Rational low = std::max(l.low, r.low), high = std::min(l.high, r.high);
        if (low < high && rootCount(common, low, high) > 0) return false;
      }
      l.halve();
      r.halve();
    }
  }

  bool m_edges;
  std::array<Vector, 4> m_vertices;
  Polynomial m_coplanarity, m_normalSquared;
  std::vector<Polynomial> m_notNegative;          ///< of touching features that are not degenerate
  std::vector<std::array<Vector, 3>> m_segments;  ///< a point and a segment's ends
};

}  // namespace palpate::impact
