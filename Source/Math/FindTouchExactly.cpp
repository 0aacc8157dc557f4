// Part of Math/ImpactQuery.h: findTouchExactly(), findPassagesExactly().
#include "Math/ImpactQuery.h"
#include "Exact/AlgebraicTime.h"
#include "Core/Assert.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <type_traits>

namespace palpate {

namespace {

using Linear = std::array<Form<1>, 3>;  ///< a vector that moves linearly: its values at 0 and 1
using Quadratic = std::array<Form<2>, 3>;

/// The number odd · 2^exponent.
struct Dyadic {
  double odd = 0;
  int exponent = 0;
};

Dyadic dyadic(double value) {
  if (value == 0.0) return {0, std::numeric_limits<int>::max()};
  int exponent;
  const double mantissa = std::ldexp(std::frexp(value, &exponent), 53);
  const int zeros = std::countr_zero(static_cast<std::uint64_t>(std::abs(mantissa)));
  return {std::ldexp(mantissa, -zeros), exponent - 53 + zeros};
}

Linear operator-(const Linear& l, const Linear& r) {
  Linear difference;
  for (int k = 0; k < 3; ++k)
    for (int end = 0; end < 2; ++end) difference[k][end] = l[k][end] - r[k][end];
  return difference;
}

void addProduct(Form<2>& sum, const Form<1>& l, const Form<1>& r) {
  sum[0] += l[0] * r[0];
  sum[1] += l[0] * r[1];
  sum[1] += l[1] * r[0];
  sum[2] += l[1] * r[1];
}

Form<2> crossComponent(const Linear& l, const Linear& r, int k) {
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  Form<2> component{l[i][0] * r[j][0] - l[j][0] * r[i][0], l[i][0] * r[j][1] - l[j][0] * r[i][1],
                    l[i][1] * r[j][1] - l[j][1] * r[i][1]};
  component[1] += l[i][1] * r[j][0];
  component[1] -= l[j][1] * r[i][0];
  return component;
}

Form<2> operator-(Form<2> l, const Form<2>& r) {
  for (int i = 0; i < 3; ++i) l[i] -= r[i];
  return l;
}

/// A moving point, and the moving end of a segment from the origin. They touch where point = z
/// segment, z in [0, 1].
struct PointAndSegment {
  Linear point, segment;

  template <class Moment>
  bool touchAt(const Moment& moment) const {
    for (int k = 0; k < 3; ++k)
      if (moment.sign(crossComponent(point, segment, k)) != 0) return false;
    // With point = z segment this is z (1 - z) |segment|², or -|point|² if the segment is a point.
    Form<2> inside;
    const Linear rest = segment - point;
    for (int k = 0; k < 3; ++k) addProduct(inside, point[k], rest[k]);
    return moment.sign(inside) >= 0;
  }

  std::optional<double> firstTouchAfterStart() const;
};

/// The first time after the start at which a moving point is at the origin, if there is one. It may
/// not be there all the time.
std::optional<double> firstZeroAfterStart(const Linear& point) {
  int k = 0;
  while (k < 2 && isZero(point[k])) ++k;
  PALPATE_ASSERT(!isZero(point[k]));
  const auto vanishes = [&](const auto& moment) {
    return moment.sign(point[0]) == 0 && moment.sign(point[1]) == 0 && moment.sign(point[2]) == 0;
  };
  for (const QuadraticTime& root : rootsInside(point[k]))
    if (vanishes(root)) return root.timeLowerBound();
  if (vanishes(EndOfStep{})) return 1.0;
  return {};
}

/// Finds times after the start only. At the start, point and segment must be apart or about to
/// separate.
std::optional<double> PointAndSegment::firstTouchAfterStart() const {
  for (int k = 0; k < 3; ++k) {
    const Form<2> cross = crossComponent(point, segment, k);
    if (isZero(cross)) continue;
    for (const QuadraticTime& root : rootsInside(cross))
      if (touchAt(root)) return root.timeLowerBound();
    if (touchAt(EndOfStep{})) return 1.0;
    return {};
  }
  // They are always on one line: the point enters the segment over an end.
  const std::optional<double> first = firstZeroAfterStart(point),
                              second = firstZeroAfterStart(point - segment);
  return first && second ? std::min(*first, *second) : first ? first : second;
}

/// The query's A, B, C over the integers.
class ExactQuery {
 public:
  explicit ExactQuery(const ImpactQuery& query);
  std::optional<double> firstTouch(double tolerance) const;
  Passages passages(double tolerance) const;

 private:
  Form<3> coplanarity() const;
  template <class Moment>
  bool touchAt(const Moment& moment) const;
  std::vector<PointAndSegment> border() const;

  ImpactQuery::Kind m_kind;
  Linear m_a, m_b, m_c;
  Quadratic m_normal;  ///< A x B
};

ExactQuery::ExactQuery(const ImpactQuery& query) : m_kind(query.kind) {
  Dyadic values[4][2][3];
  int least = std::numeric_limits<int>::max();
  for (int vertex = 0; vertex < 4; ++vertex)
    for (int end = 0; end < 2; ++end)
      for (int k = 0; k < 3; ++k) {
        values[vertex][end][k] = dyadic(query.vertices[vertex].at(end)[k]);
        least = std::min(least, values[vertex][end][k].exponent);
      }
  Linear vertices[4];
  for (int vertex = 0; vertex < 4; ++vertex)
    for (int end = 0; end < 2; ++end)
      for (int k = 0; k < 3; ++k) {
        const auto [odd, exponent] = values[vertex][end][k];
        vertices[vertex][k][end] = odd;
        if (odd != 0) vertices[vertex][k][end] <<= exponent - least;
      }
  const auto axes = ImpactQuery::axes(m_kind);
  m_a = vertices[axes[0][0]] - vertices[axes[0][1]];
  m_b = vertices[axes[1][0]] - vertices[axes[1][1]];
  m_c = vertices[axes[2][0]] - vertices[axes[2][1]];
  for (int k = 0; k < 3; ++k) m_normal[k] = crossComponent(m_a, m_b, k);
}

Form<3> ExactQuery::coplanarity() const {
  Form<3> sum;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 3; ++i) {
      sum[i] += m_normal[k][i] * m_c[k][0];
      sum[i + 1] += m_normal[k][i] * m_c[k][1];
    }
  return sum;
}

std::vector<PointAndSegment> ExactQuery::border() const {
  if (m_kind == ImpactQuery::Kind::VertexTriangle)
    return {{m_c, m_a}, {m_c, m_b}, {m_c - m_a, m_b - m_a}};
  return {{m_c, m_a}, {m_c, m_b}, {m_c - m_b, m_a}, {m_c - m_a, m_b}};
}

/// Whether C = x A + y B for an (x, y) in the domain, at a moment at which A, B and C are in one
/// plane. If A and B are not on one line, Cramer's rule on two of the coordinates decides.
/// Otherwise, if there is such an (x, y), there is one on the domain's border.
template <class Moment>
bool ExactQuery::touchAt(const Moment& moment) const {
  for (int k = 0; k < 3; ++k) {
    const int side = moment.sign(m_normal[k]);
    if (side == 0) continue;
    const Form<2> x = crossComponent(m_c, m_b, k), y = crossComponent(m_a, m_c, k);
    if (side * moment.sign(x) < 0 || side * moment.sign(y) < 0) return false;
    const Form<2> restX = m_normal[k] - x;
    if (m_kind == ImpactQuery::Kind::VertexTriangle) return side * moment.sign(restX - y) >= 0;
    return side * moment.sign(restX) >= 0 && side * moment.sign(m_normal[k] - y) >= 0;
  }
  for (const PointAndSegment& side : border())
    if (side.touchAt(moment)) return true;
  return false;
}

std::optional<double> ExactQuery::firstTouch(double tolerance) const {
  const Form<3> cubic = coplanarity();
  if (cubic[0] == 0 && touchAt(StartOfStep{})) return 0.0;
  std::optional<double> first;
  if (!isZero(cubic)) {
    anyRootInside(cubic, [&](const auto& root) {
      if (!touchAt(root)) return false;
      if constexpr (requires { root.timeLowerBound(tolerance); })
        first = root.timeLowerBound(tolerance);
      else
        first = root.timeLowerBound();
      return true;
    });
    if (!first && cubic[3] == 0 && touchAt(EndOfStep{})) first = 1.0;
    return first;
  }
  // They are always in one plane. A point inside the domain stays there for a while, so the first
  // touch after the start is on the domain's border.
  for (const PointAndSegment& side : border())
    if (const std::optional<double> time = side.firstTouchAfterStart();
        time && (!first || *time < *first))
      first = time;
  return first;
}

/// The volume A x B · C is positive or negative between its roots. Simple roots change its sign. It
/// has one multiple root at most, and its signs at both ends tell whether that changes it.
Passages ExactQuery::passages(double tolerance) const {
  Passages found;
  const Form<3> volume = coplanarity();
  if (isZero(volume)) return found;
  const auto add = [&](double time, bool forward) {
    PALPATE_ASSERT(found.count < 3);
    found.all[static_cast<std::size_t>(found.count++)] = {time, forward};
  };
  int sign = signAfterStart(volume);
  const int last = signBeforeEnd(volume);
  if (volume[0] == 0 && sign < 0 && touchAt(StartOfStep{})) add(0.0, false);
  int simple = 0;
  anyRootInside(volume, [&]<class Root>(const Root&) {
    simple += std::is_same_v<Root, CubicTime>;
    return false;
  });
  const bool multipleChanges = (sign != last) != (simple % 2 == 1);
  anyRootInside(volume, [&]<class Root>(const Root& root) {
    constexpr bool kIsSimple = std::is_same_v<Root, CubicTime>;
    if (!kIsSimple && !multipleChanges) return false;
    sign = -sign;
    if (!touchAt(root)) return false;
    if constexpr (kIsSimple)
      add(root.timeLowerBound(tolerance), sign > 0);
    else
      add(root.timeLowerBound(), sign > 0);
    return false;
  });
  PALPATE_ASSERT(sign == last);
  if (volume[3] == 0 && sign < 0 && touchAt(EndOfStep{})) add(1.0, true);
  return found;
}

}  // namespace

Passages findPassagesExactly(const ImpactQuery& query, double tolerance) {
  PALPATE_ASSERT(tolerance > 0.0);
  Passages found = ExactQuery(query).passages(tolerance);
  found.exact = true;
  return found;
}

ImpactResult findTouchExactly(const ImpactQuery& query, double tolerance) {
  PALPATE_ASSERT(tolerance > 0.0);
  const std::optional<double> time = ExactQuery(query).firstTouch(tolerance);
  return {time.has_value(), true, time.value_or(0.0)};
}

}  // namespace palpate
