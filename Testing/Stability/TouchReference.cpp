#include "TouchReference.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace palpate::stability {

namespace {

using Kind = FeaturePair::Kind;
using impact::operator-;  // for its vectors, which are std::array

/// True if the boxes of the two features over the step are disjoint.
bool stayApart(bool edges, const impact::Positions& p) {
  const int first = edges ? 2 : 1;  // vertices of the first feature
  for (int axis = 0; axis < 3; ++axis) {
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < 8; ++i) {
      const int feature = i % 4 < first ? 0 : 1;
      low[feature] = std::min(low[feature], p[i][axis]);
      high[feature] = std::max(high[feature], p[i][axis]);
    }
    if (low[0] > high[1] || low[1] > high[0]) return true;
  }
  return false;
}

/// True if the volume of the four vertices certainly keeps one strict sign over the step. The
/// volume is a cubic. Its Bernstein coefficients are compared with a hundred times the rounding
/// error of 80-bit arithmetic.
bool neverInOnePlane(const impact::Positions& p) {
  using Vector = Eigen::Matrix<long double, 3, 1>;
  const auto from = [&](int end, int vertex) -> Vector {
    return p[4 * end + vertex].cast<long double>() - p[4 * end].cast<long double>();
  };
  long double error = 0;
  const auto volume = [&](int i, int j, int k) {
    const Vector u = from(i, 1), v = from(j, 2), w = from(k, 3);
    error = std::max(error, u.norm() * v.norm() * w.norm() * 0x1p-53L);
    return u.cross(v).dot(w);
  };
  const std::array<long double, 4> b{
      volume(0, 0, 0), (volume(0, 0, 1) + volume(0, 1, 0) + volume(1, 0, 0)) / 3,
      (volume(0, 1, 1) + volume(1, 0, 1) + volume(1, 1, 0)) / 3, volume(1, 1, 1)};
  const auto [low, high] = std::minmax_element(b.begin(), b.end());
  return *low > error || *high < -error;
}

std::array<impact::Vector, 2> planeSpan(bool edges, const impact::Query& query) {
  const auto& [a, b, c, d] = query.vertices();
  if (edges) return {b - a, d - c};
  return {c - b, d - b};
}

/// Height of the vertex over the plane, or of edge a over edge b.
impact::Polynomial heightOf(bool edges, const impact::Query& query) {
  impact::Polynomial height = query.coplanarity();
  if (!edges)
    for (impact::Integer& coefficient : height) coefficient = -coefficient;
  return height;
}

int sideJustBefore(impact::Polynomial height, impact::Real time) {
  if (time.compare(0) == 0) return 0;  // touches from the start
  for (int side = 1; !height.empty(); side = -side) {
    if (const int sign = time.sign(height)) return side * sign;
    height = impact::derivative(height);
  }
  return 0;
}

}  // namespace

bool Touch::isBefore(double reported) const {
  impact::Real exact = time;
  return exact.compare(impact::Rational(reported)) < 0;
}

bool Touch::isTimely(double reported) const {
  impact::Real exact = time;
  const impact::Rational early(1, 1'000'000);
  return !isBefore(reported) && exact.compare(impact::Rational(reported) + early) <= 0;
}

bool Touch::isWrongSide(const Eigen::Vector3d& reported, double at) const {
  impact::Real touch = time;
  const int sideThen = touch.compare(impact::Rational(at)) > 0
                           ? sgn(impact::valueAt(height, impact::Rational(at)))
                           : side;
  if (side == 0 || sideThen == 0) return false;
  using Rational = impact::Rational;
  std::array<std::array<Rational, 3>, 2> sides;
  for (int i = 0; i < 2; ++i)
    for (int axis = 0; axis < 3; ++axis)
      sides[i][axis] = impact::valueAt(span[i][axis], Rational(at));
  const auto& [u, v] = sides;
  const auto dot = [](const auto& l, const auto& r) -> Rational {
    return l[0] * r[0] + l[1] * r[1] + l[2] * r[2];
  };
  const std::array<Rational, 3> normal{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                                       u[0] * v[1] - u[1] * v[0]};
  const Rational square = dot(normal, normal);
  if (square * Rational(0x1p100) < dot(u, u) * dot(v, v)) return false;
  const std::array<Rational, 3> normalReported{Rational(reported[0]), Rational(reported[1]),
                                               Rational(reported[2])};
  const Rational along = dot(normal, normalReported);
  // The triangle's normal points to the vertex, for either order of the meshes.
  const int sign = features.kind == Kind::TriangleVertex ? -sideThen : sideThen;
  return along * sign < 0 && along * along > square / 100;
}

std::vector<Touch> touchesWithin(const Case::Frame& before, const Case::Frame& now) {
  std::vector<Touch> touches;
  for (const FeaturePair& pair : everyFeaturePair()) {
    const auto start = positionsOf(pair, before), end = positionsOf(pair, now);
    impact::Positions positions;
    std::copy(start.begin(), start.end(), positions.begin());
    std::copy(end.begin(), end.end(), positions.begin() + 4);
    const bool edges = pair.kind == Kind::EdgeEdge;
    if (stayApart(edges, positions) || neverInOnePlane(positions)) continue;
    const impact::Query query(edges, positions);
    const auto time = query.firstTouch();
    if (!time) continue;
    const impact::Polynomial height = heightOf(edges, query);
    touches.push_back(
        {pair, *time, sideJustBefore(height, *time), height, planeSpan(edges, query)});
  }
  return touches;
}

}  // namespace palpate::stability
