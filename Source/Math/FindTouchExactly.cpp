// Part of Math/ImpactQuery.h: findTouchExactly(), findPassagesExactly().
#include "Math/ExactMotion.h"
#include "Math/ImpactQuery.h"
#include "Math/MovingStar.h"
#include "Exact/AlgebraicTime.h"
#include "Core/Assert.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <type_traits>

namespace palpate {

namespace {

template <class Moment>
bool vanishesAt(const Moment& moment, const Linear& vector) {
  for (const Form<1>& x : vector)
    if (moment.sign(multiplied(x)) != 0) return false;
  return true;
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
    const Linear rest = difference(segment, point);
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
                              second = firstZeroAfterStart(difference(point, segment));
  return first && second ? std::min(*first, *second) : first ? first : second;
}

/// The query's A, B, C over the integers.
class ExactQuery {
 public:
  explicit ExactQuery(const ImpactQuery& query);
  std::optional<double> firstTouch(double tolerance) const;
  Passages passages(double tolerance, const Surroundings*) const;

 private:
  Form<3> coplanarity() const { return dot(m_normal, m_c); }
  template <class Moment>
  bool touchAt(const Moment& moment) const;
  std::vector<PointAndSegment> border() const;
  template <class Moment>
  std::optional<int> borderAt(const Moment&) const;
  template <class Moment>
  std::optional<int> placeOnSegment(const Moment&, const ImpactQuery::Step&,
                                    const ImpactQuery::Step&) const;
  template <class Moment>
  std::array<int, 2> endsAt(const Moment&) const;
  template <class Moment>
  std::optional<bool> passageAt(const Moment&, const Form<3>& volume, const Surroundings*) const;

  const ImpactQuery& m_query;
  Linear m_a, m_b, m_c;
  Quadratic m_normal;  ///< A x B
};

ExactQuery::ExactQuery(const ImpactQuery& query) : m_query(query) {
  std::array<Linear, 4> vertices;
  toIntegers(query.vertices, vertices);
  const auto axis = [&](const ImpactQuery::Difference& ids) {
    return difference(vertices[static_cast<std::size_t>(ids[0])],
                      vertices[static_cast<std::size_t>(ids[1])]);
  };
  const auto axes = ImpactQuery::axes(query.kind);
  m_a = axis(axes[0]);
  m_b = axis(axes[1]);
  m_c = axis(axes[2]);
  m_normal = cross(m_a, m_b);
}

std::vector<PointAndSegment> ExactQuery::border() const {
  if (m_query.kind == ImpactQuery::Kind::VertexTriangle)
    return {{m_c, m_a}, {m_c, m_b}, {difference(m_c, m_a), difference(m_b, m_a)}};
  return {{m_c, m_a}, {m_c, m_b}, {difference(m_c, m_b), m_a}, {difference(m_c, m_a), m_b}};
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
    const Form<2> restX = difference(m_normal[k], x);
    if (m_query.kind == ImpactQuery::Kind::VertexTriangle)
      return side * moment.sign(difference(restX, y)) >= 0;
    return side * moment.sign(restX) >= 0 && side * moment.sign(difference(m_normal[k], y)) >= 0;
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

/// The border of the triangle on which the vertex is, at a moment at which it is on the triangle
/// (Surroundings). None if it is in the interior.
template <class Moment>
std::optional<int> ExactQuery::borderAt(const Moment& moment) const {
  if (vanishesAt(moment, m_c)) return 0;
  if (vanishesAt(moment, difference(m_c, m_a))) return 1;
  if (vanishesAt(moment, difference(m_c, m_b))) return 2;
  constexpr std::array kEdges{3, 5, 4};
  const std::vector<PointAndSegment> sides = border();
  for (std::size_t i = 0; i < 3; ++i)
    if (sides[i].touchAt(moment)) return kEdges[i];
  return {};
}

/// Where the vertex is on a segment (PlaceOnSegment).
template <class Moment>
std::optional<int> ExactQuery::placeOnSegment(const Moment& moment, const ImpactQuery::Step& p,
                                              const ImpactQuery::Step& q) const {
  std::array<Linear, 3> at;
  toIntegers(std::array{m_query.vertices[0], p, q}, at);
  const Linear fromP = difference(at[0], at[1]);
  if (vanishesAt(moment, fromP)) return 0;
  if (vanishesAt(moment, difference(at[0], at[2]))) return 1;
  if (PointAndSegment{fromP, difference(at[2], at[1])}.touchAt(moment)) return 2;
  return {};
}

/// The ends of the edges at which they touch, at a moment at which they do (Surroundings).
template <class Moment>
std::array<int, 2> ExactQuery::endsAt(const Moment& moment) const {
  const std::vector<PointAndSegment> sides = border();
  const auto endAt = [&](std::size_t first, std::size_t second) {
    if (sides[first].touchAt(moment)) return 0;
    return sides[second].touchAt(moment) ? 1 : 2;
  };
  const std::array<int, 2> ends{endAt(1, 3), endAt(0, 2)};
  if (ends[0] == 2 || ends[1] == 2) return ends;
  Linear between = m_c;
  if (ends[0] == 1) between = difference(between, m_a);
  if (ends[1] == 1) between = difference(between, m_b);
  return vanishesAt(moment, between) ? ends : std::array{2, 2};  // along each other
}

/// A passage at a moment at which the features touch. None if they only touch.
template <class Moment>
std::optional<bool> ExactQuery::passageAt(const Moment& moment, const Form<3>& volume,
                                          const Surroundings* around) const {
  if (around) {
    TouchSurroundings near;
    if (m_query.kind == ImpactQuery::Kind::VertexTriangle) {
      if (const std::optional<int> border = borderAt(moment)) {
        const auto place = [&](const ImpactQuery::Step& p, const ImpactQuery::Step& q) {
          return placeOnSegment(moment, p, q);
        };
        around->find({0, *border}, std::ref(place), near);
        return StarTouch(near, around->swapped).passageAt(moment);
      }
    } else {
      const std::array<int, 2> ends = endsAt(moment);
      around->find(ends, {}, near);
      if (!near.isAlone) return EdgeTouch(m_query, ends, near, around->swapped).passageAt(moment);
    }
  }
  // A volume of 0 at an end of the step counts as positive.
  const auto isBehind = [&](int direction) {
    return hasTime(moment, direction) && signNear(moment, volume, direction) < 0;
  };
  const bool before = isBehind(-1), after = isBehind(1);
  if (before == after) return {};
  return before;
}

/// The volume A x B · C is positive or negative between its roots.
Passages ExactQuery::passages(double tolerance, const Surroundings* around) const {
  Passages found;
  const Form<3> volume = coplanarity();
  if (isZero(volume)) return found;
  const auto take = [&](const auto& moment, auto&& time) {
    if (!touchAt(moment)) return;
    const std::optional<bool> forward = passageAt(moment, volume, around);
    if (!forward) return;
    PALPATE_ASSERT(found.count < 3);
    found.all[static_cast<std::size_t>(found.count++)] = {time(), *forward};
  };
  if (volume[0] == 0) take(StartOfStep{}, [] { return 0.0; });
  anyRootInside(volume, [&](const auto& root) {
    take(root, [&] {
      if constexpr (requires { root.timeLowerBound(tolerance); })
        return root.timeLowerBound(tolerance);
      else
        return root.timeLowerBound();
    });
    return false;
  });
  if (volume[3] == 0) take(EndOfStep{}, [] { return 1.0; });
  return found;
}

}  // namespace

Passages findPassagesExactly(const ImpactQuery& query, double tolerance,
                             const Surroundings* around) {
  PALPATE_ASSERT(tolerance > 0.0);
  Passages found = ExactQuery(query).passages(tolerance, around);
  found.exact = true;
  return found;
}

ImpactResult findTouchExactly(const ImpactQuery& query, double tolerance) {
  PALPATE_ASSERT(tolerance > 0.0);
  const std::optional<double> time = ExactQuery(query).firstTouch(tolerance);
  return {time.has_value(), true, time.value_or(0.0)};
}

}  // namespace palpate
