#include "RestReference.h"

#include "Unit/Math/RationalOracle.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::stability {

namespace {

using Kind = FeaturePair::Kind;
using oracle::Rational;
using oracle::operator-;  // for its vectors, which are std::array

Rational volume(const oracle::Vector& a, const oracle::Vector& b, const oracle::Vector& c,
                const oracle::Vector& d) {
  return oracle::dot(b - a, oracle::cross(c - a, d - a));
}

/// True if the edge crosses the triangle's plane strictly inside the triangle.
bool pierces(const oracle::Vector& p, const oracle::Vector& q,
             const std::array<oracle::Vector, 3>& t) {
  if (sgn(volume(p, t[0], t[1], t[2])) * sgn(volume(q, t[0], t[1], t[2])) >= 0) return false;
  const int first = sgn(volume(p, q, t[0], t[1]));
  return first != 0 && sgn(volume(p, q, t[1], t[2])) == first &&
         sgn(volume(p, q, t[2], t[0])) == first;
}

bool anyEdgePierces(const Corners& edges, const Corners& triangle) {
  std::array<oracle::Vector, 3> e, t;
  for (int i = 0; i < 3; ++i) {
    e[i] = oracle::toRational(edges[i]);
    t[i] = oracle::toRational(triangle[i]);
  }
  return pierces(e[0], e[1], t) || pierces(e[1], e[2], t) || pierces(e[2], e[0], t);
}

/// True if the box of the first `count` positions is further than `distance` from the box of the
/// others, along an axis.
template <std::size_t N>
bool areApart(const std::array<Eigen::Vector3d, N>& p, std::size_t count, double distance) {
  for (int axis = 0; axis < 3; ++axis) {
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (std::size_t i = 0; i < N; ++i) {
      const int box = i < count ? 0 : 1;
      low[box] = std::min(low[box], p[i][axis]);
      high[box] = std::max(high[box], p[i][axis]);
    }
    if (low[0] - high[1] > distance || low[1] - high[0] > distance) return true;
  }
  return false;
}

}  // namespace

Rest restOf(const Case::Frame& frame, double thickness) {
  Rest rest;
  const auto& [a, b] = frame;
  if (areApart(std::array{a[0], a[1], a[2], b[0], b[1], b[2]}, 3, 2 * thickness)) return rest;
  for (const FeaturePair& pair : everyFeaturePair()) {
    const auto p = positionsOf(pair, frame);
    if (areApart(p, pair.kind == Kind::EdgeEdge ? 2 : 1, 2 * thickness)) continue;
    const oracle::Closest closest = pair.kind == Kind::EdgeEdge
                                        ? oracle::edgeEdge(p[0], p[1], p[2], p[3])
                                        : oracle::vertexTriangle(p[0], p[1], p[2], p[3]);
    rest.pairs.push_back(
        {pair, oracle::root(closest.square).get_d(), 8 * oracle::ulpOfLargestDifference(p)});
    rest.intersect |= closest.square == 0;
  }
  // Triangles can intersect although no closest distance is zero: an edge crosses a face.
  rest.intersect = rest.intersect || anyEdgePierces(a, b) || anyEdgePierces(b, a);
  return rest;
}

}  // namespace palpate::stability
