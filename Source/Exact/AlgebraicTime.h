#pragma once

#include "Exact/Exact.h"
#include "Core/Assert.h"

#include <array>
#include <cstddef>
#include <vector>

namespace palpate {

/// A polynomial of t in [0, 1] as Σ c[i] t^i (1-t)^(N-i). Let x = t / (1-t), which runs from 0 to
/// infinity with t. For t < 1 the polynomial's sign is that of Σ c[i] x^i; at t = 1 it is that of
/// c[N].
template <std::size_t N>
using Form = std::array<Integer, N + 1>;

template <std::size_t N>
bool isZero(const std::array<Integer, N>& form) {
  for (const Integer& coefficient : form)
    if (coefficient != 0) return false;
  return true;
}

struct StartOfStep {
  template <std::size_t N>
  int sign(const std::array<Integer, N>& form) const {
    return sgn(form.front());
  }
};

struct EndOfStep {
  template <std::size_t N>
  int sign(const std::array<Integer, N>& form) const {
    return sgn(form.back());
  }
};

/// The moment at which x = (p + q √d) / r > 0, with r > 0, d >= 0, q in {-1, 0, 1}.
struct QuadraticTime {
  Integer p, r, d;
  int q = 0;

  template <std::size_t N>
  int sign(const std::array<Integer, N>& form) const;
  double timeLowerBound() const;  ///< at most 2^-51 below the exact time
};

/// The moments strictly inside the step at which a form vanishes, ascending, each once. The form
/// must not be zero.
std::vector<QuadraticTime> rootsInside(const Form<1>&);
std::vector<QuadraticTime> rootsInside(const Form<2>&);

/// A simple root of a cubic strictly inside the step, in an open interval of x on which the cubic
/// is monotone.
///
/// The signs of quadratics at this root need no refinement. It is enough to compare the root with
/// the quadratics' roots, which are quadratic numbers. This takes the sign of the cubic at those
/// numbers, which has a closed form.
class CubicTime {
 public:
  /// cell: the index of the interval between the cubic's critical points on the real line. rising:
  /// the sign of the cubic's slope there. lower, upper: times between which the root lies, where
  /// the search starts.
  CubicTime(const Form<3>& cubic, int cell, int rising, double lower, double upper);

  int sign(const Form<2>&) const;
  /// Of forms of a higher degree.
  template <std::size_t N>
  int sign(const std::array<Integer, N>& form) const;
  double timeLowerBound(double tolerance) const;

 private:
  int compare(const QuadraticTime&) const;  ///< sign of this - other
  int compare(double t) const;
  int cellOf(const QuadraticTime&) const;
  void bracket(double lower, double upper);

  Form<3> m_cubic;
  int m_cell, m_rising;
  double m_low = 0.0, m_high = 1.0;  ///< the root's time lies in [m_low, m_high]
};

/// Calls f(root) for each root of the cubic strictly inside the step, ascending, until f returns
/// true. The cubic must not be zero. A root is a QuadraticTime or a CubicTime. (Multiple roots are
/// critical points, so they are quadratic.)
template <class F>
bool anyRootInside(Form<3> cubic, F&& f);

// Implementation of the templates.

template <std::size_t N>
int QuadraticTime::sign(const std::array<Integer, N>& form) const {
  PALPATE_ASSERT(r > 0 && d >= 0 && q >= -1 && q <= 1);
  // Horner's scheme in numbers a + b √d. The result is multiplied by r^(N-1) > 0.
  Integer a = form[N - 1], b, power = r, next;
  for (std::size_t i = N - 1; i-- > 0;) {
    next = a * p;
    if (q != 0) {
      if (b != 0) {
        const Integer bd = b * d;
        if (q > 0)
          next += bd;
        else
          next -= bd;
        b *= p;
      }
      if (q > 0)
        b += a;
      else
        b -= a;
    }
    next += form[i] * power;
    a = next;
    if (i > 0) power *= r;
  }
  const int signA = sgn(a), signB = sgn(d) == 0 ? 0 : sgn(b);
  if (signA == signB || signB == 0) return signA;
  if (signA == 0) return signB;
  const int larger = cmp(Integer(a * a), Integer(b * b * d));
  return larger > 0 ? signA : larger < 0 ? signB : 0;
}

/// The remainder of a division by the cubic has a lower degree, and the form's sign at the root.
template <std::size_t N>
int CubicTime::sign(const std::array<Integer, N>& form) const {
  static_assert(N > 3);
  std::array<Integer, N - 1> rest;
  const Integer& leading = form[N - 1];
  std::size_t degree = 3;
  if (leading != 0)
    while (m_cubic[degree] == 0) --degree;
  PALPATE_ASSERT(degree > 0);
  const std::size_t shift = N - 1 - degree;
  for (std::size_t i = 0; i + 1 < N; ++i) {
    rest[i] = form[i];
    if (leading == 0) continue;
    rest[i] *= m_cubic[degree];
    if (i >= shift) rest[i] -= leading * m_cubic[i - shift];
  }
  return leading == 0 ? sign(rest) : sgn(m_cubic[degree]) * sign(rest);
}

/// The critical points of a cubic strictly inside the step, and the number of critical points
/// before the step.
struct CriticalPoints {
  std::vector<QuadraticTime> inside;
  int before = 0;
};
CriticalPoints criticalPoints(const Form<3>&);
/// The sign of the highest coefficient that is not zero, which is the form's sign just before t =
/// 1.
int signBeforeEnd(const Form<3>&);
/// Divides by t until the form is not zero at 0.
void removeRootsAtStart(Form<3>&);

template <class F>
bool anyRootInside(Form<3> cubic, F&& f) {
  removeRootsAtStart(cubic);
  const CriticalPoints critical = criticalPoints(cubic);
  int sign = sgn(cubic[0]), cell = critical.before;
  double time = 0.0;
  for (std::size_t i = 0; i <= critical.inside.size(); ++i, ++cell) {
    const bool last = i == critical.inside.size();
    const int signThere = last ? signBeforeEnd(cubic) : critical.inside[i].sign(cubic);
    const double timeThere = last ? 1.0 : critical.inside[i].timeLowerBound();
    if (sign * signThere < 0 && f(CubicTime(cubic, cell, signThere, time, timeThere))) return true;
    if (signThere == 0 && f(critical.inside[i])) return true;
    sign = signThere;
    time = timeThere;
  }
  return false;
}

}  // namespace palpate
