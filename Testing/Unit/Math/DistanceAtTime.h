#pragma once

#include "ImpactCases.h"
#include "RationalOracle.h"

#include <algorithm>
#include <cmath>

namespace palpate::oracle {

/// The features at a time of the step, in rational numbers.
class FeaturesAtTime {
 public:
  FeaturesAtTime(const ImpactCase& query, double time) : m_edges(query.edges) {
    const Rational t(time);
    for (std::size_t i = 0; i < 4; ++i) {
      const Vector before = toRational(query.positions[i]);
      m_x[i] = before + t * (toRational(query.positions[4 + i]) - before);
      for (int k = 0; k < 3; ++k) m_rounded[i][k] = m_x[i][k].get_d();
    }
  }

  Rational squareDistance() const {
    return m_edges ? edgeEdge(m_x[0], m_x[1], m_x[2], m_x[3]).square
                   : vertexTriangle(m_x[0], m_x[1], m_x[2], m_x[3]).square;
  }

  /// Whether the square of the distance is above a number. Two planes often prove it, whose normal
  /// may come from anywhere.
  bool isAbove(const Rational& square) const {
    const auto& [p, q, r, s] = m_rounded;
    const Vector normal = toRational(finite(m_edges ? edgeEdgeDistance(p, q, r, s).normal
                                                    : vertexTriangleDistance(p, q, r, s).normal));
    std::array<Rational, 4> height;
    for (std::size_t i = 0; i < 4; ++i) height[i] = dot(normal, m_x[i]);
    const auto second = height.begin() + (m_edges ? 2 : 1);
    const Rational gap =
        *std::min_element(height.begin(), second) - *std::max_element(second, height.end());
    if (gap > 0 && gap * gap > square * dot(normal, normal)) return true;
    return squareDistance() > square;
  }

  /// Whether the square of the distance is at most a number. Two points often prove it, whose
  /// weights may come from anywhere.
  bool isAtMost(const Rational& square) const {
    const auto& [p, q, r, s] = m_rounded;
    const auto between = [](const Rational& t, const Vector& a, const Vector& b) {
      return a + t * (b - a);
    };
    Vector difference;
    bool valid = true;
    if (m_edges) {
      const auto distance = edgeEdgeDistance(p, q, r, s);
      const Rational u(finite(distance.weightA)), v(finite(distance.weightB));
      valid = u >= 0 && u <= 1 && v >= 0 && v <= 1;
      difference = between(u, m_x[0], m_x[1]) - between(v, m_x[2], m_x[3]);
    } else {
      const auto distance = vertexTriangleDistance(p, q, r, s);
      const Rational u(finite(distance.weights[1])), v(finite(distance.weights[2]));
      valid = u >= 0 && v >= 0 && u + v <= 1;
      difference = m_x[0] - (m_x[1] + u * (m_x[2] - m_x[1]) + v * (m_x[3] - m_x[1]));
    }
    if (valid && dot(difference, difference) <= square) return true;
    return squareDistance() <= square;
  }

 private:
  static double finite(double x) { return std::isfinite(x) ? x : 0.0; }
  static Eigen::Vector3d finite(const Eigen::Vector3d& x) {
    return x.unaryExpr([](double y) { return finite(y); });
  }

  bool m_edges;
  std::array<Vector, 4> m_x;
  std::array<Eigen::Vector3d, 4> m_rounded;
};

/// The square of the distance at a time of the step, in rational numbers.
inline Rational squareDistanceAt(const ImpactCase& query, double time) {
  return FeaturesAtTime(query, time).squareDistance();
}

/// The least double whose square is not below x, for values in the range of double.
inline double rootAbove(const Rational& square) {
  double above = root(square).get_d();
  while (Rational(above) * Rational(above) < square) above = std::nextafter(above, INFINITY);
  return above;
}

}  // namespace palpate::oracle
