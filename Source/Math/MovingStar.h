#pragma once

#include "Math/ExactMotion.h"
#include "Math/ImpactQuery.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <type_traits>
#include <vector>

// Features that touch at an edge or a vertex of their meshes, with what surrounds them there.
namespace palpate {

/// What is next to the points at which two features touch.
struct TouchSurroundings {
  /// The triangle (at[1], a, b) in its winding.
  struct Sector {
    ImpactQuery::Step a, b;
    std::uint32_t triangle;
    bool endsWithEdge = false;  ///< the touched edge is (b, at[1]), else (at[1], a)
  };
  /// By feature: the vertex that touches, or an end of the edge that touches within.
  std::array<ImpactQuery::Step, 2> at;
  /// By feature: the neighbours of the vertex that touches, or the opposite corners of the
  /// triangles of an edge that touches within. Displaced towards them, bodies that touch are apart.
  std::array<std::vector<ImpactQuery::Step>, 2> neighbours;
  /// The triangles there, for neighbours in a plane: bodies are also displaced against the normals.
  std::array<std::vector<std::array<ImpactQuery::Step, 3>>, 2> triangles;
  bool isAlone = true;  ///< at neither feature there is more than one triangle or segment

  // Of a triangle's corner or edge:
  /// Of a closed surface all triangles there, in any order. At a border, those from one border to
  /// the next, in the order of the winding; the surface is then continued in its plane. A triangle
  /// at a corner has two sectors if the corner is within its edge.
  std::vector<Sector> sectors;
  bool isEdge = false, isClosed = false;
  std::uint32_t own = 0;  ///< the query's triangle
};

/// Where the vertex that touches a triangle lies on another segment then: 0 and 1 are its ends, 2
/// is between them.
using PlaceOnSegment =
    std::function<std::optional<int>(const ImpactQuery::Step&, const ImpactQuery::Step&)>;

/// Finds what is next to a touch. Corner i of a triangle is i, its edge from corner i to the next
/// one is 3 + i; the vertex that touches it is 0. End i of an edge is i, its interior is 2.
struct Surroundings {
  std::function<void(std::array<int, 2> features, const PlaceOnSegment&, TouchSurroundings&)> find;
  bool swapped = false;  ///< the query's first feature is of the second mesh
};

/// The sign of a form just before the moment (direction -1) or just after it (1). 0: the form is
/// zero.
template <class Moment, std::size_t N>
int signNear(const Moment& moment, const std::array<Integer, N>& form, int direction) {
  if constexpr (std::is_same_v<Moment, EndOfStep>) {
    std::size_t i = N - 1;
    while (i > 0 && form[i] == 0) --i;
    return sgn(form[i]);
  } else if constexpr (N <= 3) {
    return signNear(moment, multiplied(form), direction);
  } else {
    if (const int sign = moment.sign(form)) return sign;
    std::array<Integer, N> slope = form;
    for (std::size_t order = 1; order < N; ++order) {
      for (std::size_t i = 1; i < N; ++i) slope[i - 1] = static_cast<unsigned long>(i) * slope[i];
      slope[N - 1] = 0;
      if (const int sign = moment.sign(slope))
        return order % 2 == 1 && direction < 0 ? -sign : sign;
    }
    return 0;
  }
}

/// Whether the moment has a time before (direction -1) or after it within the step.
template <class Moment>
constexpr bool hasTime(const Moment&, int direction) {
  return direction < 0 ? !std::is_same_v<Moment, StartOfStep> : !std::is_same_v<Moment, EndOfStep>;
}

/// The way of the first feature around a place at which it touches the second one: from where it is
/// just before the moment, over a place at which both are displaced towards what surrounds them, to
/// where it is just after. In front of a step's start and behind its end it is displaced, so that
/// the ways of all steps are one way. All features that touch there go the same way, and so pass
/// what a displaced feature passes.
class TouchWay {
 public:
  /// swapped: Surroundings::swapped.
  TouchWay(const TouchSurroundings&, bool swapped);
  const Linear& from() const { return m_from; }  ///< from the second feature to the first

  /// By how often the way passes the sector between the directions a and b to the side of a x b,
  /// less often to the other one. plane: the sector is its whole plane.
  template <class Moment>
  int passes(const Moment&, const Linear& a, const Linear& b, bool plane = false) const;

 private:
  const Quadratic& normals() const;

  Linear m_from;
  Linear m_displacement;  ///< of the first feature, seen from the second one
  std::vector<std::array<Linear, 3>> m_triangles;
  std::size_t m_ofFirst;  ///< number of m_triangles
  mutable std::optional<Quadratic> m_normals;
  int m_turn;
};

/// A vertex that touches a triangle's edge or corner at a moment.
class StarTouch {
 public:
  StarTouch(const TouchSurroundings&, bool swapped);
  /// Whether it passes the surface, and forward, and the query's triangle reports this: exactly one
  /// triangle does.
  template <class Moment>
  std::optional<bool> passageAt(const Moment&) const;

 private:
  struct Sector {
    Linear a, b;
    std::uint32_t triangle;
  };
  template <class Moment>
  bool isBehind(const Moment&, int direction) const;
  template <class Moment>
  bool holds(const Moment&, int direction, const Sector&) const;

  static constexpr std::uint32_t kContinued = 0xffffffffu;  ///< a sector beyond a border
  std::vector<Sector> m_sectors;
  std::vector<std::uint32_t> m_triangles;
  TouchWay m_way;
  std::uint32_t m_own;
};

/// Two edges that touch at a moment, at ends of them or within.
class EdgeTouch {
 public:
  EdgeTouch(const ImpactQuery&, std::array<int, 2> ends, const TouchSurroundings&, bool swapped);
  /// Whether edge a passes edge b, and forward.
  template <class Moment>
  std::optional<bool> passageAt(const Moment&) const;

 private:
  std::array<int, 2> m_ends;
  Linear m_a, m_b;  ///< along the edges, from the ends
  TouchWay m_way;
};

// Implementation of the templates.

template <class Moment>
int TouchWay::passes(const Moment& moment, const Linear& a, const Linear& b, bool plane) const {
  const Quadratic normal = cross(a, b);
  const auto displacedSide = [&] {
    if (const int sign = moment.sign(dot(normal, m_displacement))) return sign;
    if (const int sign = moment.sign(dot(normal, normals()))) return sign;
    for (const Form<2>& component : normal)
      if (const int sign = moment.sign(component)) return sign * m_turn;
    return 1;
  };
  const Form<3> volume = dot(normal, m_from);
  if (isZero(volume)) return 0;
  const int displaced = displacedSide();
  int count = 0;
  for (const int direction : {-1, 1}) {
    if (!hasTime(moment, direction)) continue;
    const int side = signNear(moment, volume, direction);
    if (side == displaced) continue;
    const auto sideOfWay = [&](const Linear& q) {
      const Quadratic across = cross(q, m_from);
      if (const int sign = signNear(moment, dot(across, m_displacement), direction)) return sign;
      if (const int sign = signNear(moment, dot(across, normals()), direction)) return sign;
      for (const Form<2>& component : across)
        if (const int sign = signNear(moment, component, direction)) return sign * m_turn;
      return 1;
    };
    if (!plane && (sideOfWay(a) != -side || sideOfWay(b) != side)) continue;
    count += direction > 0 ? side : displaced;
  }
  return count;
}

/// Whether the vertex, which is in the sector's plane, is in the sector.
template <class Moment>
bool StarTouch::holds(const Moment& moment, int direction, const Sector& sector) const {
  const Linear& p = m_way.from();
  const auto sign = [&](const Linear& l, const Linear& r, int k) {
    return signNear(moment, crossComponent(l, r, k), direction);
  };
  for (int k = 0; k < 3; ++k)
    if (const int turn = sign(sector.a, sector.b, k))
      return turn * sign(sector.a, p, k) >= 0 && turn * sign(p, sector.b, k) >= 0;
  return false;
}

/// Whether the vertex is strictly behind the surface. As FeatureStar decides it at an end of the
/// step: the arc from the vertex's direction to a sector, next to its first border, is followed to
/// its end.
template <class Moment>
bool StarTouch::isBehind(const Moment& moment, int direction) const {
  const Linear& p = m_way.from();
  const auto side = [&](const Linear& a, const Linear& b, const Linear& c) {
    return signNear(moment, volumeOf(a, b, c), direction);
  };
  std::vector<int> sides;
  bool isFront = false, isBack = false;
  for (const Sector& sector : m_sectors) {
    sides.push_back(side(sector.a, sector.b, p));
    if (sides.back() == 0 && holds(moment, direction, sector)) return false;
    isFront |= sides.back() > 0;
    isBack |= sides.back() < 0;
  }
  if (!isFront || !isBack) return isBack;
  std::size_t last = 0;
  while (sides[last] == 0) ++last;
  const Linear &first = m_sectors[last].a, &second = m_sectors[last].b;
  const auto sideOfArc = [&](const Linear& q) {
    const int sign = side(p, first, q);
    return (sign != 0 ? sign : side(p, second, q)) >= 0 ? 1 : -1;
  };
  int depth = sides[last] < 0 ? 1 : 0;
  for (std::size_t i = 0; i < m_sectors.size(); ++i) {
    if (i == last || sides[i] == 0) continue;
    const Linear &a = m_sectors[i].a, &b = m_sectors[i].b;
    const int ofA = sideOfArc(a);
    if (ofA == sideOfArc(b) || sides[i] != -ofA) continue;
    int ofEnd = side(a, b, first);
    if (ofEnd == 0) ofEnd = side(a, b, second);
    if (ofEnd == ofA) depth -= sides[i];
  }
  return depth > 0;
}

template <class Moment>
std::optional<bool> StarTouch::passageAt(const Moment& moment) const {
  // What lies on a surface is in front of it.
  const bool before = hasTime(moment, -1) && isBehind(moment, -1),
             after = hasTime(moment, 1) && isBehind(moment, 1);
  if (before == after) return {};
  // The lowest triangle that the way passes so. The way may pass none if the surface folds over.
  std::uint32_t lowest = kContinued, lowestPassed = kContinued;
  for (const std::uint32_t triangle : m_triangles) {
    int count = 0;
    bool isInPlane = true;
    for (const Sector& sector : m_sectors)
      if (sector.triangle == triangle) {
        count += m_way.passes(moment, sector.a, sector.b);
        isInPlane &= isZero(volumeOf(sector.a, sector.b, m_way.from()));
      }
    if (isInPlane) continue;
    lowest = std::min(lowest, triangle);
    if (count == (before ? 1 : -1)) lowestPassed = std::min(lowestPassed, triangle);
  }
  if (m_own != (lowestPassed != kContinued ? lowestPassed : lowest)) return {};
  return before;
}

template <class Moment>
std::optional<bool> EdgeTouch::passageAt(const Moment& moment) const {
  int count = 0;
  if (m_ends[0] == 2 && m_ends[1] == 2) {
    count = m_way.passes(moment, m_a, m_b, true);
  } else {
    // The edges touch in directions along b and against a.
    const Linear back = reversed(m_a);
    count = m_way.passes(moment, m_b, back);
    if (m_ends[0] == 2) count += m_way.passes(moment, m_a, m_b);
    if (m_ends[1] == 2) count += m_way.passes(moment, back, reversed(m_b));
  }
  if (count == 0) return {};
  return count * (m_ends[0] == 1 ? -1 : 1) * (m_ends[1] == 1 ? -1 : 1) > 0;
}

}  // namespace palpate
