#include "Math/ExactClosestPoint.h"

#include "Exact/Rational.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::exact {

namespace {

using Eigen::Vector3d;

Vector<Integer> scaled(const Integer& factor, const Vector<Integer>& a) {
  return {factor * a[0], factor * a[1], factor * a[2]};
}

/// numerator / denominator to the nearest multiple of 2^-53, where 0 <= numerator <= denominator.
double weight(const Integer& numerator, const Integer& denominator) {
  const Integer nearest = ((numerator << 54) + denominator) / (2 * denominator);
  return std::ldexp(nearest.get_d(), -53);
}

Vector3d unit(const Vector<Integer>& a) {
  const Integer square = dot(a, a);
  if (square == 0) return Vector3d::Zero();
  const int shift = std::max(0, (140 - bits(square)) / 2 + 1);  // so that the root has 70 bits
  const Integer root = sqrt(Integer(square << 2 * shift));
  Vector3d result;
  for (int i = 0; i < 3; ++i) result[i] = quotient(a[i] << shift, root, 0);
  return result;
}

/// The foot whose difference is a 2^exponent / denominator.
Foot footFrom(const Vector<Integer>& a, const Integer& denominator, int exponent) {
  Foot foot{Vector3d::Zero(), unit(a), 0.0, 0.0, 0.0, true};
  for (int i = 0; i < 3; ++i) foot.difference[i] = quotient(a[i], denominator, exponent);
  int longest;
  if (foot.direction.cwiseAbs().maxCoeff(&longest) > 0.0)
    foot.distance = foot.difference[longest] / foot.direction[longest];
  return foot;
}

/// The foot of the perpendicular from the origin to the plane from + s u + t v.
Foot footOnPlane(const Vector<Integer>& from, const Vector<Integer>& u, const Vector<Integer>& v,
                 int exponent) {
  const Vector<Integer> normal = cross(u, v);
  const Integer denominator = dot(normal, normal);
  Foot foot = footFrom(scaled(dot(normal, from), normal), denominator, exponent);
  foot.s = weight(dot(cross(v, from), normal), denominator);
  foot.t = weight(dot(cross(from, u), normal), denominator);
  return foot;
}

// ---- Signs, in integers of fixed width if the positions fit, else of any size ----

/// Calls decision(positions) with vectors of integers of the least fixed width into which they fit,
/// else of any size.
template <class Decision, class... Positions>
auto decide(Decision&& decision, const Positions&... positions) {
  if (const FixedGrid grid(positions...); grid.fits) return decision(grid.at);
  if (const FixedGrid<sizeof...(Positions), Int128> grid(positions...); grid.fits)
    return decision(grid.at);
  return decision(Integers(positions...).at);
}

template <class T>
int signAlong(const Vector<T>& p, const Vector<T>& a, const Vector<T>& b) {
  return signOf(dot(p - a, b - a));
}

/// (ab x ap) . (ab x ac)
template <class T>
int signAside(const Vector<T>& p, const Vector<T>& a, const Vector<T>& b, const Vector<T>& c) {
  const Vector<T> ab = b - a, ac = c - a, ap = p - a;
  const auto abab = dot(ab, ab), apac = dot(ap, ac), abac = dot(ab, ac), abap = dot(ab, ap);
  const decltype(product(abab, apac)) sign = product(abab, apac) - product(abac, abap);
  return signOf(sign);
}

template <class T>
bool isAlong(const Vector<T>& p, const Vector<T>& a, const Vector<T>& b) {
  return signAlong(p, a, b) > 0 && signAlong(p, b, a) > 0;
}

template <class T>
bool isZero(const Vector<T>& a) {
  return signOf(a[0]) == 0 && signOf(a[1]) == 0 && signOf(a[2]) == 0;
}

/// The longest edge of a triangle without area; the first one if several are equal.
template <class T>
int longestEdge(const std::array<Vector<T>, 4>& at) {
  int longest = 0;
  for (int i = 1; i < 3; ++i) {
    const Vector<T> edge = at[(i + 1) % 3] - at[i], best = at[(longest + 1) % 3] - at[longest];
    const Wide<T> longer = dot(edge, edge) - dot(best, best);
    if (signOf(longer) > 0) longest = i;
  }
  return longest;
}

/// at: the corners, then p.
template <class T>
TriangleFeature closestFeatureOf(const std::array<Vector<T>, 4>& at) {
  const Vector<T>& p = at[3];
  if (isZero(cross(at[1] - at[0], at[2] - at[0]))) {
    const int edge = longestEdge(at), next = (edge + 1) % 3;
    if (isAlong(p, at[edge], at[next])) return static_cast<TriangleFeature>(3 + edge);
    return static_cast<TriangleFeature>(signAlong(p, at[edge], at[next]) <= 0 ? edge : next);
  }
  bool inside = true;
  for (int i = 0; i < 3; ++i) {
    const Vector<T>&a = at[i], &b = at[(i + 1) % 3], &c = at[(i + 2) % 3];
    if (signAside(p, a, b, c) > 0) continue;
    if (isAlong(p, a, b)) return static_cast<TriangleFeature>(3 + i);
    inside = false;
  }
  if (inside) return TriangleFeature::Face;
  for (int i = 0; i < 2; ++i) {
    if (signAlong(p, at[i], at[(i + 1) % 3]) <= 0 && signAlong(p, at[i], at[(i + 2) % 3]) <= 0)
      return static_cast<TriangleFeature>(i);
  }
  return TriangleFeature::CornerC;
}

/// at: p0, p1, q0, q1.
template <class T>
CrossingPlace crossingOf(const std::array<Vector<T>, 4>& at) {
  const Vector<T> u = at[1] - at[0], v = at[3] - at[2], from = at[0] - at[2];
  if (isZero(cross(u, v))) return CrossingPlace::Parallel;
  const auto uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uf = dot(u, from), vf = dot(v, from);
  using Product = decltype(product(uu, vv));  // not auto: sums of Integers are expressions
  const Product determinant = product(uu, vv) - product(uv, uv);
  const auto isInside = [&](const Product& numerator) {
    const Product rest = determinant - numerator;
    return signOf(numerator) > 0 && signOf(rest) > 0;
  };
  const Product s = product(uv, vf) - product(vv, uf), t = product(uu, vf) - product(uv, uf);
  return isInside(s) && isInside(t) ? CrossingPlace::Interior : CrossingPlace::Outside;
}

}  // namespace

int along(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  return decide([](const auto& at) { return signAlong(at[0], at[1], at[2]); }, p, a, b);
}

int side(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return decide([](const auto& at) { return signAside(at[0], at[1], at[2], at[3]); }, p, a, b, c);
}

TriangleFeature closestFeature(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                               const Vector3d& c) {
  return decide([](const auto& at) { return closestFeatureOf(at); }, a, b, c, p);
}

CrossingPlace crossing(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                       const Vector3d& q1) {
  return decide([](const auto& at) { return crossingOf(at); }, p0, p1, q0, q1);
}

bool areCollinear(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return decide([](const auto& at) { return isZero(cross(at[1] - at[0], at[2] - at[0])); }, a, b,
                c);
}

bool areCoplanar(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  return decide(
      [](const auto& at) {
        return signOf(volumeOf(at[1] - at[0], at[2] - at[0], at[3] - at[0])) == 0;
      },
      a, b, c, d);
}

Foot footOnPoint(const Vector3d& p, const Vector3d& a) {
  const auto [at, exponent] = Integers(p, a);
  return footFrom(at[0] - at[1], 1, exponent);
}

Foot footOnLine(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  PALPATE_ASSERT(a != b);
  const auto [at, exponent] = Integers(p, a, b);
  const Vector<Integer> from = at[0] - at[1], edge = at[2] - at[1];
  const Integer numerator = dot(from, edge), denominator = dot(edge, edge);
  Foot foot = footFrom(scaled(denominator, from) - scaled(numerator, edge), denominator, exponent);
  foot.s = weight(numerator, denominator);
  return foot;
}

Foot footOnPlane(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const auto [at, exponent] = Integers(p, a, b, c);
  return footOnPlane(at[0] - at[1], at[1] - at[2], at[1] - at[3], exponent);
}

Foot footBetweenLines(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                      const Vector3d& q1) {
  const auto [at, exponent] = Integers(p0, p1, q0, q1);
  return footOnPlane(at[0] - at[2], at[1] - at[0], at[2] - at[3], exponent);
}

namespace {

Rational squaredDistanceToEdge(const Vector<Integer>& p, const Vector<Integer>& a,
                               const Vector<Integer>& b) {
  const Vector<Integer> from = p - a, edge = b - a;
  const Integer along = dot(from, edge), square = dot(edge, edge);
  if (along <= 0) return {dot(from, from), 1};
  if (along >= square) return {dot(p - b, p - b), 1};
  return {dot(from, from) * square - along * along, square};
}

/// corners: of a triangle, whose feature holds the point closest to p.
Rational squaredDistance(const Vector<Integer>& p, const Vector<Integer>* corners,
                         TriangleFeature feature) {
  const int index = static_cast<int>(feature);
  if (index < 3) {
    const Vector<Integer> from = p - corners[index];
    return {dot(from, from), 1};
  }
  if (index < 6) return squaredDistanceToEdge(p, corners[index - 3], corners[(index - 2) % 3]);
  const Vector<Integer> normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const Integer height = dot(p - corners[0], normal);
  return {height * height, dot(normal, normal)};
}

/// A distance as the root of `square` less `radius`.
struct RoundDistance {
  Rational square, radius;
};

/// Sign of a + b times the root of c / d, for c >= 0 and d > 0.
int signOfSum(const Integer& a, const Integer& b, const Integer& c, const Integer& d) {
  PALPATE_ASSERT(c >= 0 && d > 0);
  const int root = sgn(c) == 0 ? 0 : sgn(b);
  if (root == 0 || sgn(a) == root) return sgn(a);
  return root * sgn(Integer(b * b * c - a * a * d));
}

/// p's distance from the hull of two balls: from the nearest of the balls on the segment between
/// their centres (Math/RoundSegment.h).
RoundDistance distanceFromBalls(const Vector<Integer>& p, const Vector<Integer>& a,
                                const Vector<Integer>& b, const Integer& radiusA,
                                const Integer& radiusB) {
  const Vector<Integer> from = p - a, edge = b - a, normal = cross(from, edge);
  const Integer along = dot(from, edge), square = dot(edge, edge), height = dot(normal, normal),
                change = radiusB - radiusA, room = square - change * change;
  // The nearest ball's centre is at (along + change sqrt(height / room)) / square.
  if (room <= 0 ? change <= 0 : signOfSum(along, change, height, room) <= 0)
    return {{dot(from, from), 1}, {radiusA, 1}};
  if (room <= 0 || signOfSum(along - square, change, height, room) >= 0)
    return {{dot(p - b, p - b), 1}, {radiusB, 1}};
  return {{height * room, square * square}, {radiusA * square + change * along, square}};
}

/// p's distance from a feature. radii: of the corners.
RoundDistance distanceFrom(const Vector<Integer>& p, const Vector<Integer>* corners,
                           TriangleFeature feature, const Vector<Integer>& radii) {
  const auto index = static_cast<std::size_t>(feature);
  if (index > 2 && index < 6) {
    const std::size_t i = index - 3, j = (index - 2) % 3;
    if (radii[i] != radii[j])
      return distanceFromBalls(p, corners[i], corners[j], radii[i], radii[j]);
  }
  const Integer radius = index > 5 ? Integer(0) : radii[index % 3];
  return {squaredDistance(p, corners, feature), {radius, 1}};
}

Rational difference(const Rational& a, const Rational& b) {
  return {a.numerator * b.denominator - b.numerator * a.denominator, a.denominator * b.denominator};
}

/// Sign of the root of a less the root of b, less c.
int compareRoots(const Rational& a, const Rational& b, const Rational& c) {
  PALPATE_ASSERT(a.numerator >= 0 && b.numerator >= 0 && c.denominator > 0);
  if (c.numerator < 0) return -compareRoots(b, a, {-c.numerator, c.denominator});
  // a - b - c² against 2 c times the root of b
  const Integer cc = c.numerator * c.numerator, dd = c.denominator * c.denominator,
                ab = a.denominator * b.denominator,
                left = (a.numerator * b.denominator - b.numerator * a.denominator) * dd - cc * ab;
  if (left < 0) return -1;
  return sgn(Integer(left * left - 4 * cc * dd * ab * a.denominator * b.numerator));
}

}  // namespace

int compareDistances(const Vector3d& p, const ClosestFeature& first, const ClosestFeature& second) {
  // Radii take part as coordinates, so that they have the same unit.
  const auto at = Integers(p, first.a, first.b, first.c, second.a, second.b, second.c, first.radii,
                           second.radii)
                      .at;
  const RoundDistance one = distanceFrom(at[0], &at[1], first.feature, at[7]),
                      two = distanceFrom(at[0], &at[4], second.feature, at[8]);
  return compareRoots(one.square, two.square, difference(one.radius, two.radius));
}

int compareDistance(const Vector3d& p, const ClosestFeature& feature, double length) {
  const Vector3d lengths(length, 0.0, 0.0);
  const auto at = Integers(p, feature.a, feature.b, feature.c, feature.radii, lengths).at;
  const RoundDistance found = distanceFrom(at[0], &at[1], feature.feature, at[4]);
  return compareRoots(
      found.square, {0, 1},
      difference({at[5][0], 1}, {-found.radius.numerator, found.radius.denominator}));
}

int nearestEnd(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0, const Vector3d& q1) {
  const auto at = Integers(p0, p1, q0, q1).at;
  int nearest = 0;
  Rational least = squaredDistanceToEdge(at[0], at[2], at[3]);
  for (int i = 1; i < 4; ++i) {
    const int other = i < 2 ? 2 : 0;
    const Rational own = squaredDistanceToEdge(at[i], at[other], at[other + 1]);
    if (compare(own, least) < 0) {
      least = own;
      nearest = i;
    }
  }
  return nearest;
}

Vector3d unitCross(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const auto at = Integers(a, b, c, d).at;
  return unit(cross(at[1] - at[0], at[3] - at[2]));
}

}  // namespace palpate::exact
