#pragma once

#include "ImpactCases.h"
#include "RationalOracle.h"

#include <cmath>

namespace palpate::oracle {

/// The square of the distance at a time of the step, in rational numbers.
inline Rational squareDistanceAt(const ImpactCase& query, double time) {
  const Rational t(time);
  std::array<Vector, 4> x;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector before = toRational(query.positions[i]), now = toRational(query.positions[4 + i]);
    x[i] = before + t * (now - before);
  }
  return query.edges ? edgeEdge(x[0], x[1], x[2], x[3]).square
                     : vertexTriangle(x[0], x[1], x[2], x[3]).square;
}

/// The least double whose square is not below x, for values in the range of double.
inline double rootAbove(const Rational& square) {
  double above = root(square).get_d();
  while (Rational(above) * Rational(above) < square) above = std::nextafter(above, INFINITY);
  return above;
}

}  // namespace palpate::oracle
