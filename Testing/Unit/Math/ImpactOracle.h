#pragma once

#include <gmpxx.h>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

/// A slow decision of continuous detection by other methods than the library's: polynomials with
/// whole coefficients in the power basis, roots by Descartes' rule of signs and Sturm sequences,
/// signs at roots by greatest common divisors and quadratic interval refinement, and formulas of
/// degree four. It shares no code with Source/.
namespace palpate::impact {

using Integer = mpz_class;
using Rational = mpq_class;
/// Coefficients of 1, t, t², …; no trailing zeros; zero is empty.
using Polynomial = std::vector<Integer>;

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
  return l + Polynomial{Integer(-1)} * r;
}
inline Rational valueAt(const Polynomial& p, const Rational& t) {
  Rational value = 0;
  for (auto c = p.rbegin(); c != p.rend(); ++c) value = value * t + *c;
  return value;
}
/// Of the value at t, without fractions.
inline int signAt(const Polynomial& p, const Rational& t) {
  Integer value = 0, power = 1;
  for (auto c = p.rbegin(); c != p.rend(); ++c) {
    value = value * t.get_num() + *c * power;
    power *= t.get_den();
  }
  return sgn(value);
}
inline Polynomial derivative(const Polynomial& p) {
  Polynomial d;
  for (std::size_t i = 1; i < p.size(); ++i) d.push_back(p[i] * static_cast<int>(i));
  return d;
}
struct Division {
  Polynomial quotient, remainder;
};
/// Of a positive multiple of p.
inline Division divide(Polynomial p, const Polynomial& by) {
  Polynomial quotient(p.size() >= by.size() ? p.size() - by.size() + 1 : 0);
  const Integer scale = abs(by.back());
  while (p.size() >= by.size()) {
    const std::size_t shift = p.size() - by.size();
    const Integer factor = p.back() * sgn(by.back());
    for (Integer& c : p) c *= scale;
    for (Integer& c : quotient) c *= scale;
    quotient[shift] += factor;
    for (std::size_t i = 0; i < by.size(); ++i) p[shift + i] -= factor * by[i];
    p = trimmed(p);
  }
  return {quotient, p};
}
/// Divides by the coefficients' greatest common divisor.
inline Polynomial primitive(Polynomial p) {
  Integer divisor = 0;
  for (const Integer& c : p) divisor = gcd(divisor, c);
  for (Integer& c : p) mpz_divexact(c.get_mpz_t(), c.get_mpz_t(), divisor.get_mpz_t());
  return p;
}
inline Polynomial commonDivisor(Polynomial l, Polynomial r) {
  while (!r.empty()) l = std::exchange(r, primitive(divide(l, r).remainder));
  return l;
}

/// Bernstein coefficients of a polynomial on [low, high], times a positive number. In (low, high)
/// it has as many roots, counted with their multiplicities, as the coefficients have changes of
/// sign, or an even number less.
inline Polynomial bernstein(Polynomial p, const Rational& low, const Rational& high) {
  const std::size_t count = p.size();
  const Integer denominator = lcm(low.get_den(), high.get_den());
  const Integer start = low.get_num() * (denominator / low.get_den());
  const Integer width = high.get_num() * (denominator / high.get_den()) - start;
  Integer power = 1;
  for (std::size_t i = count; i-- > 0; power *= denominator) p[i] *= power;
  for (std::size_t i = 0; start != 0 && i + 1 < count; ++i)
    for (std::size_t j = count - 1; j-- > i;) p[j] += start * p[j + 1];
  power = 1;
  for (std::size_t i = 0; i < count; ++i, power *= width) {
    p[i] *= power;
    for (std::size_t k = 2; k <= i; ++k) p[i] *= static_cast<unsigned>(k);  // i! (n - i)!
    for (std::size_t k = 2; k < count - i; ++k) p[i] *= static_cast<unsigned>(k);
  }
  for (std::size_t i = 1; i < count; ++i)
    for (std::size_t j = count - 1; j >= i; --j) p[j] += p[j - 1];
  return p;
}
/// 1 or -1 if all are positive or all negative; else 0.
inline int commonSign(const Polynomial& all) {
  const int sign = sgn(all.front());
  const bool same =
      std::all_of(all.begin(), all.end(), [&](const Integer& x) { return sgn(x) == sign; });
  return same ? sign : 0;
}
template <class Signs>
int signChanges(const Signs& all) {
  int count = 0, last = 0;
  for (const auto& x : all) {
    const int sign = sgn(x);
    if (sign != 0 && last != 0 && sign != last) ++count;
    if (sign != 0) last = sign;
  }
  return count;
}

/// Counts the roots of a polynomial in (low, high], by Sturm's theorem.
class RootCounter {
 public:
  explicit RootCounter(const Polynomial& p) : m_sequence{p, derivative(p)} {
    while (!m_sequence.back().empty())
      m_sequence.push_back(
          primitive(Polynomial{Integer(-1)} *
                    divide(m_sequence[m_sequence.size() - 2], m_sequence.back()).remainder));
  }
  int operator()(const Rational& low, const Rational& high) const {
    return changes(low) - changes(high);
  }

 private:
  int changes(const Rational& t) const {
    std::vector<Integer> signs;
    for (const Polynomial& q : m_sequence) signs.push_back(signAt(q, t));
    return signChanges(signs);
  }
  std::vector<Polynomial> m_sequence;
};
inline int rootCount(const Polynomial& p, const Rational& low, const Rational& high) {
  return RootCounter(p)(low, high);
}

/// A real number: the only root of `p` in (low, high], a simple one; or low where p is empty.
struct Real {
  Polynomial p;
  Rational low, high;
  int partBits = 2;

  /// Whether it is at most t, in (low, high]. p changes its sign at the root, unless it has a root
  /// at low, too.
  bool isAtMost(const Rational& t) const {
    const int start = signAt(p, low), there = signAt(p, t);
    return start == 0 ? rootCount(p, low, t) == 1 : there != start;
  }
  /// Shortens the interval, by quadratic interval refinement: a secant names one of 2^partBits
  /// parts, and partBits doubles as long as the root is in it.
  void refine() {
    const Rational start = valueAt(p, low), end = valueAt(p, high);
    if (start != 0) {
      const Rational at = (start / (start - end)) << partBits;
      const Integer part = (at.get_num() - 1) / at.get_den();  // the root may be its upper end
      const Rational width = (high - low) >> partBits, from = low + width * part;
      if (!isAtMost(from) && isAtMost(from + width)) {
        low = from;
        high = from + width;
        partBits *= 2;
        return;
      }
    }
    partBits = std::max(partBits / 2, 2);
    const Rational middle = (low + high) / 2;
    (isAtMost(middle) ? high : low) = middle;
  }
  int sign(const Polynomial& q) {
    if (p.empty()) return signAt(q, low);
    if (q.empty()) return 0;
    for (;; refine()) {
      if (const int sign = commonSign(bernstein(q, low, high))) return sign;
      if (partBits > 16) break;  // a short interval: q may be 0 there
    }
    const Polynomial common = commonDivisor(p, q);
    if (common.size() > 1 && rootCount(common, low, high) == 1) return 0;
    for (;;) {
      refine();
      if (const int sign = commonSign(bernstein(q, low, high))) return sign;
    }
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
    return signAt(p, t) == 0 ? 0 : -1;
  }
};

/// The roots of a polynomial that is not zero, in [0, 1], ascending.
inline std::vector<Real> rootsInStep(Polynomial q) {
  const auto divideOut = [&q](const Rational& root) {
    const Polynomial factor{-root.get_num(), root.get_den()};
    bool isRoot = false;
    for (; signAt(q, root) == 0; isRoot = true) q = primitive(divide(q, factor).quotient);
    return isRoot;
  };
  std::vector<Real> roots;
  if (divideOut(0)) roots.push_back({{}, 0, 0});
  const bool isAtEnd = divideOut(1);
  std::vector<std::array<Rational, 2>> parts{{0, 1}};
  for (int i = 0; !parts.empty(); ++i) {
    // Around a double root there are always two changes of sign.
    if (i == 16) q = primitive(divide(q, commonDivisor(q, derivative(q))).quotient);
    const auto [low, high] = parts.back();
    parts.pop_back();
    if (low == high) {
      roots.push_back({{}, low, low});
      continue;
    }
    const int changes = signChanges(bernstein(q, low, high));
    if (changes == 1) roots.push_back({q, low, high});
    if (changes < 2) continue;
    const Rational middle = (low + high) / 2;
    parts.push_back({middle, high});
    if (divideOut(middle)) parts.push_back({middle, middle});
    parts.push_back({low, middle});
  }
  if (isAtEnd) roots.push_back({{}, 1, 1});
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
  Query(bool edges, const Positions& positions)
      : m_edges(edges), m_separated(axisSeparates(positions, edges ? 2 : 1)) {
    // Whole numbers, times one power of two.
    int unit = std::numeric_limits<int>::max();
    for (const Eigen::Vector3d& p : positions)
      for (const double x : p)
        if (x != 0) unit = std::min(unit, std::ilogb(x) - 52);
    const auto whole = [unit](double x) {
      const int exponent = x == 0 ? unit : std::ilogb(x) - 52;
      return Integer(Integer(std::ldexp(x, -exponent)) << (exponent - unit));
    };
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k) {
        const Integer before = whole(positions[i][k]);
        m_vertices[i][k] = trimmed({before, whole(positions[4 + i][k]) - before});
      }
    const auto& [v, a, b, c] = m_vertices;
    m_coplanarity = dot(a - v, cross(b - v, c - v));
  }

  /// The first time in [0, 1] at which the features touch.
  std::optional<Real> firstTouch() const {
    if (m_separated) return std::nullopt;
    std::vector<Real> times;
    if (!m_coplanarity.empty()) times = rootsInStep(m_coplanarity);
    if (!m_coplanarity.empty() && times.empty()) return std::nullopt;
    const Features features = featuresOf(m_edges, m_vertices);
    if (m_coplanarity.empty()) {
      // Any polynomial that the test evaluates may change its sign at the first touch.
      times.push_back({{}, 0, 0});
      std::vector<Polynomial> all = features.notNegative;
      all.push_back(features.normalSquared);
      for (const auto& [p, q, r] : features.segments) {
        for (const Polynomial& component : cross(q - p, r - p)) all.push_back(component);
        all.push_back(dot(q - p, r - p));
      }
      for (const Polynomial& p : all)
        if (!p.empty())
          for (const Real& root : rootsInStep(p)) times.push_back(root);
    }
    std::optional<Real> first;
    for (Real& time : times)
      if ((!first || isBefore(time, *first)) && touchesInPlaneAt(features, time)) first = time;
    return first;
  }

  /// The times in [0, 1] at which the signed volume changes its sign while the features touch. It
  /// counts as positive where it is 0 at an end.
  struct Passage {
    Real time;
    bool forward;
  };
  std::vector<Passage> passages() const {
    std::vector<Passage> all;
    if (m_separated || m_coplanarity.empty()) return all;
    const Polynomial volume = Polynomial{Integer(m_edges ? 1 : -1)} * m_coplanarity;
    std::vector<Real> roots = rootsInStep(volume);
    const Features features = featuresOf(m_edges, m_vertices);
    const auto signAtEnd = [&](int end) { return signAt(volume, end) < 0 ? -1 : 1; };
    int sign = signAtEnd(0);
    for (std::size_t i = 0; i < roots.size(); ++i) {
      int after = signAtEnd(1);
      if (roots[i].compare(1) < 0) {
        // A number between this root and the next one, or the end.
        Real next = i + 1 < roots.size() ? roots[i + 1] : Real{{}, 1, 1};
        while (roots[i].high >= next.low) {
          if (!roots[i].p.empty()) roots[i].refine();
          if (!next.p.empty()) next.refine();
        }
        after = signAt(volume, (roots[i].high + next.low) / 2);
      }
      if (after != sign && touchesInPlaneAt(features, roots[i]))
        all.push_back({roots[i], after > 0});
      sign = after;
    }
    return all;
  }

  /// Whether a passage is through an edge or a vertex of one of the features.
  bool isAtBorder(const Passage& passage) const {
    const Features features = featuresOf(m_edges, m_vertices);
    Real time = passage.time;
    return std::any_of(features.notNegative.begin(), features.notNegative.end(),
                       [&](const Polynomial& p) { return time.sign(p) == 0; });
  }

  /// For (v, a, b, c): det(a - v, b - v, c - v).
  const Polynomial& coplanarity() const { return m_coplanarity; }

  /// Positions over time, times a positive number.
  const std::array<Vector, 4>& vertices() const { return m_vertices; }

 private:
  /// Whether all corners of one feature are on one side of all of the other along an axis, before
  /// and now. They move linearly, and so are always.
  static bool axisSeparates(const Positions& x, std::size_t ofFirst) {
    for (int axis = 0; axis < 3; ++axis)
      for (const double side : {1.0, -1.0}) {
        bool apart = true;
        for (std::size_t i = 0; i < ofFirst; ++i)
          for (std::size_t j = ofFirst; j < 4; ++j)
            for (const std::size_t end : {0, 4})
              apart &= side * x[end + i][axis] > side * x[end + j][axis];
        if (apart) return true;
      }
    return false;
  }

  /// What decides whether features in one plane touch.
  struct Features {
    Polynomial normalSquared;
    std::vector<Polynomial> notNegative;          ///< of touching features that are not degenerate
    std::vector<std::array<Vector, 3>> segments;  ///< a point and a segment's ends
  };
  static Features featuresOf(bool edges, const std::array<Vector, 4>& vertices) {
    const auto& [v, a, b, c] = vertices;
    if (edges) {
      const Vector normal = cross(a - v, c - b);
      const Polynomial square = dot(normal, normal), s = dot(cross(b - v, c - b), normal),
                       r = dot(cross(b - v, a - v), normal);
      return {square, {s, square - s, r, square - r}, {{v, b, c}, {a, b, c}, {b, v, a}, {c, v, a}}};
    }
    const Vector normal = cross(b - a, c - a);
    return {dot(normal, normal),
            {dot(cross(b - a, v - a), normal), dot(cross(c - b, v - b), normal),
             dot(cross(a - c, v - c), normal)},
            {{v, a, b}, {v, b, c}, {v, c, a}}};
  }

  /// Whether the features touch at a time at which their corners are in one plane.
  static bool touchesInPlaneAt(const Features& features, Real time) {
    const std::vector<Polynomial>& signs = features.notNegative;
    if (time.sign(features.normalSquared) != 0)
      return std::all_of(signs.begin(), signs.end(),
                         [&](const Polynomial& p) { return time.sign(p) >= 0; });
    const auto& segments = features.segments;
    return std::any_of(segments.begin(), segments.end(), [&](const auto& segment) {
      const auto& [p, q, r] = segment;
      for (const Polynomial& component : cross(q - p, r - p))
        if (time.sign(component) != 0) return false;
      return time.sign(dot(q - p, r - p)) <= 0;
    });
  }

  static bool isBefore(Real l, Real r) {
    if (r.p.empty()) return l.compare(r.low) < 0;
    if (l.p.empty()) return r.compare(l.low) > 0;
    // Roots are equal if a common factor has a root in both intervals. Others are separated.
    Polynomial common;
    for (bool isKnown = false;;) {
      if (l.high <= r.low) return true;
      if (r.high <= l.low) return false;
      if (!isKnown && std::max(l.partBits, r.partBits) > 16) {
        common = commonDivisor(l.p, r.p);
        isKnown = true;
      }
      if (common.size() > 1) {
        const Rational low = std::max(l.low, r.low), high = std::min(l.high, r.high);
        if (low < high && rootCount(common, low, high) > 0) return false;
      }
      (l.high - l.low > r.high - r.low ? l : r).refine();
    }
  }

  bool m_edges, m_separated;
  std::array<Vector, 4> m_vertices;
  Polynomial m_coplanarity;
};

}  // namespace palpate::impact
