#pragma once

#include <palpate/FeaturePairs.h>

#include "Exact/Exact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

/// Distances in rational numbers. It tries every feature instead of deciding the region, so that it
/// cannot share a mistake of the region logic. Roots have 400 bits.
namespace palpate::oracle {

using Rational = mpq_class;
using Vector = std::array<Rational, 3>;

inline Vector toRational(const Eigen::Vector3d& a) {
  return {Rational(a[0]), Rational(a[1]), Rational(a[2])};
}
inline Vector operator-(const Vector& a, const Vector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Vector operator+(const Vector& a, const Vector& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
inline Vector operator*(const Rational& s, const Vector& a) {
  return {s * a[0], s * a[1], s * a[2]};
}
inline Rational dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline mpf_class root(const Rational& a) { return sqrt(mpf_class(a, 400)); }
inline double length(const Vector& a) { return root(dot(a, a)).get_d(); }

/// A pair of closest points.
struct Closest {
  Vector difference;
  Rational square;
  std::array<Rational, 3> weights;  // corners; or, of edges, the two weights
  bool interior = false;            // inside the face; inside both edges
};

inline void keepNearer(Closest& best, const Closest& other) {
  if (other.square < best.square) best = other;
}

inline Rational clamped(const Rational& a) { return std::clamp(a, Rational(0), Rational(1)); }

/// The parameter on a + t (b - a), 0 for an edge without length.
inline Rational parameter(const Vector& p, const Vector& a, const Vector& b) {
  const Vector edge = b - a;
  const Rational square = dot(edge, edge);
  return square == 0 ? Rational(0) : clamped(dot(p - a, edge) / square);
}

inline Closest vertexTriangle(const Vector& p, const Vector& a, const Vector& b, const Vector& c) {
  const std::array<Vector, 3> corner{a, b, c};
  Closest best;
  best.square = -1;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const Rational t = parameter(p, corner[i], corner[j]);
    Closest edge;
    edge.difference = p - corner[i] - t * (corner[j] - corner[i]);
    edge.square = dot(edge.difference, edge.difference);
    edge.weights[i] = 1 - t;
    edge.weights[j] = t;
    if (best.square < 0) best = edge;
    keepNearer(best, edge);
  }
  const Vector ab = corner[1] - corner[0], ac = corner[2] - corner[0], from = p - corner[0];
  const Vector normal = cross(ab, ac);
  const Rational square = dot(normal, normal);
  if (square == 0) return best;
  const Rational v = dot(cross(from, ac), normal) / square,
                 w = dot(cross(ab, from), normal) / square;
  if (v > 0 && w > 0 && v + w < 1) {
    Closest face;
    face.difference = (dot(normal, from) / square) * normal;
    face.square = dot(face.difference, face.difference);
    face.weights = {1 - v - w, v, w};
    face.interior = true;
    keepNearer(best, face);
  }
  return best;
}

inline Closest edgeEdge(const Vector& p0, const Vector& p1, const Vector& q0, const Vector& q1) {
  Closest best;
  best.square = -1;
  const auto attempt = [&](const Rational& s, const Rational& t) {
    Closest pair;
    pair.difference = p0 + s * (p1 - p0) - q0 - t * (q1 - q0);
    pair.square = dot(pair.difference, pair.difference);
    pair.weights = {s, t, 0};
    if (best.square < 0) best = pair;
    keepNearer(best, pair);
    return pair;
  };
  attempt(0, parameter(p0, q0, q1));
  attempt(1, parameter(p1, q0, q1));
  attempt(parameter(q0, p0, p1), 0);
  attempt(parameter(q1, p0, p1), 1);
  const Vector p = p1 - p0, q = q1 - q0, from = p0 - q0;
  const Rational pp = dot(p, p), qq = dot(q, q), pq = dot(p, q), determinant = pp * qq - pq * pq;
  if (determinant == 0) return best;
  const Rational s = (pq * dot(q, from) - qq * dot(p, from)) / determinant;
  const Rational t = (pp * dot(q, from) - pq * dot(p, from)) / determinant;
  if (s > 0 && s < 1 && t > 0 && t < 1) {
    attempt(s, t);
    best.interior = true;
    best.weights = {s, t, 0};
  }
  return best;
}

inline Closest vertexTriangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                              const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  return vertexTriangle(toRational(p), toRational(a), toRational(b), toRational(c));
}
inline Closest edgeEdge(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1,
                        const Eigen::Vector3d& q0, const Eigen::Vector3d& q1) {
  return edgeEdge(toRational(p0), toRational(p1), toRational(q0), toRational(q1));
}

/// An interval of a line's parameter.
struct Range {
  Rational first, last;

  /// Keeps the part in which t * slope + height >= 0. Returns whether there is one.
  bool cut(const Rational& height, const Rational& slope) {
    if (slope == 0) return height >= 0;
    const Rational zero = -height / slope;
    if (slope > 0)
      first = std::max(first, zero);
    else
      last = std::min(last, zero);
    return first <= last;
  }
};

/// What a line shares with a triangle. It is cut by the planes through the edges, across the
/// triangle, and meets its plane at one parameter or everywhere. A triangle without area is cut by
/// the planes at the ends of its longest edge, and by three that hold it.
inline std::optional<Range> lineOn(const Vector& origin, const Vector& direction,
                                   const std::array<Vector, 3>& c) {
  const Rational far(mpz_class(1) << 5000);  // beyond all parameters of doubles
  Range range{-far, far};
  const auto isOnPlane = [&](const Vector& normal) {
    const Rational height = dot(origin - c[0], normal), slope = dot(direction, normal);
    return range.cut(height, slope) && range.cut(-height, -slope);
  };
  const auto edge = [&](std::size_t i) { return c[(i + 1) % 3] - c[i]; };
  const Vector normal = cross(edge(0), c[2] - c[0]);
  if (dot(normal, normal) != 0) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector inwards = cross(normal, edge(i));
      if (!range.cut(dot(origin - c[i], inwards), dot(direction, inwards))) return {};
    }
    if (!isOnPlane(normal)) return {};
    return range;
  }
  std::size_t longest = 0;
  for (std::size_t i = 1; i < 3; ++i)
    if (dot(edge(i), edge(i)) > dot(edge(longest), edge(longest))) longest = i;
  const Vector along = edge(longest);
  const bool isPoint = dot(along, along) == 0;
  for (std::size_t k = 0; k < 3; ++k) {
    Vector axis;
    axis[k] = 1;
    if (!isOnPlane(isPoint ? axis : cross(along, axis))) return {};
  }
  const Vector &p = c[longest], &q = c[(longest + 1) % 3];
  if (!range.cut(dot(origin - p, along), dot(direction, along)) ||
      !range.cut(dot(q - origin, along), -dot(direction, along)))
    return {};
  return range;
}

/// The weights of a point in a tetrahedron. None outside, and none without volume.
inline std::optional<std::array<Rational, 4>> tetrahedronWeights(
    const Eigen::Vector3d& p, const std::array<Eigen::Vector3d, 4>& corners) {
  std::array<Rational, 4> weights;
  Rational sum = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    std::array<Eigen::Vector3d, 4> with = corners;
    with[i] = p;
    const Vector a = toRational(with[0]);
    const auto edge = [&](std::size_t k) { return toRational(with[k]) - a; };
    weights[i] = dot(cross(edge(1), edge(2)), edge(3));
    sum += weights[i];
  }
  if (sum == 0) return {};
  for (Rational& weight : weights) {
    weight /= sum;
    if (weight < 0) return {};
  }
  return weights;
}

/// One unit in the last place of the largest coordinate difference among four positions.
inline double ulpOfLargestDifference(const std::array<Eigen::Vector3d, 4>& at) {
  double most = 0.0;
  for (const Eigen::Vector3d& a : at)
    for (const Eigen::Vector3d& b : at) most = std::max(most, (a - b).cwiseAbs().maxCoeff());
  return std::nextafter(most, INFINITY) - most;
}

/// Errors of a result, in ulp of the largest coordinate difference. The error of the normal is
/// multiplied by the distance.
struct Errors {
  double distance = 0, difference = 0, witness = 0, normal = 0;
  void keepLarger(const Errors& o) {
    distance = std::max(distance, o.distance);
    difference = std::max(difference, o.difference);
    witness = std::max(witness, o.witness);
    normal = std::max(normal, o.normal);
  }
};

/// `difference`: of the two closest points that the result's weights name, in real arithmetic.
inline Errors errorsOf(const Closest& truth, const Vector& difference,
                       const Eigen::Vector3d& answeredDifference, const Eigen::Vector3d& normal,
                       double distance, double ulp) {
  const mpf_class exactDistance = root(truth.square);
  Errors errors;
  errors.distance = std::abs(mpf_class(exactDistance - distance).get_d()) / ulp;
  errors.difference = length(toRational(answeredDifference) - truth.difference) / ulp;
  errors.witness = length(difference - truth.difference) / ulp;
  if (truth.square != 0) {
    Vector scaled = toRational(normal);
    for (Rational& x : scaled) x *= Rational(exactDistance);
    errors.normal = length(scaled - truth.difference) / ulp;
  }
  return errors;
}

}  // namespace palpate::oracle
