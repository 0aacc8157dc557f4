#pragma once

#include <palpate/FeaturePairs.h>

#include "ImpactOracle.h"
#include "Math/ImpactQuery.h"
#include "TrianglePairs.h"

#include <Eigen/Core>

#include <cmath>
#include <cstdint>
#include <optional>

namespace palpate {

/// A query as the tests store it.
struct ImpactCase {
  bool edges;
  impact::Positions positions;

  std::optional<double> time(const TimeOfImpactSettings& settings = {}) const {
    const auto& p = positions;
    return (edges ? edgeEdgeTimeOfImpact : vertexTriangleTimeOfImpact)(p[0], p[1], p[2], p[3], p[4],
                                                                       p[5], p[6], p[7], settings);
  }
  ImpactQuery query() const {
    ImpactQuery result{edges ? ImpactQuery::Kind::EdgeEdge : ImpactQuery::Kind::VertexTriangle, {}};
    for (std::size_t i = 0; i < 4; ++i) result.vertices[i] = {positions[i], positions[4 + i]};
    return result;
  }
  /// Vertex i was vertex order[i] before.
  ImpactCase permuted(const std::array<int, 4>& order) const {
    ImpactCase result = *this;
    for (int i = 0; i < 4; ++i)
      for (int end = 0; end < 2; ++end)
        result.positions[4 * end + i] = positions[4 * end + order[i]];
    return result;
  }
  ImpactCase reversed() const {
    ImpactCase result = *this;
    for (int i = 0; i < 4; ++i) std::swap(result.positions[i], result.positions[4 + i]);
    return result;
  }
  template <class F>
  ImpactCase mapped(F&& f) const {
    ImpactCase result = *this;
    for (Eigen::Vector3d& p : result.positions) p = f(p);
    return result;
  }
};

/// Integer coordinates from -range to range. Vertices often coincide, move together or rest, and
/// steps are often in one plane or on one line, so that degenerate queries are common.
inline ImpactCase randomGridCase(test::Random& random, bool edges, int range) {
  const auto pick = [&](int count) { return random.below(count); };
  ImpactCase result{edges, {}};
  auto& p = result.positions;
  for (Eigen::Vector3d& position : p)
    for (int k = 0; k < 3; ++k) position[k] = pick(2 * range + 1) - range;
  if (pick(4) == 0) p[pick(8)] = p[pick(8)];
  if (pick(6) == 0) {
    const int from = pick(4), to = pick(4);
    p[to] = p[from];
    p[4 + to] = p[4 + from];
  }
  if (pick(6) == 0)
    for (int i = 0; i < 4; ++i)
      if (pick(2)) p[4 + i] = p[i];
  if (pick(3) == 0) {
    const int flat = pick(3), alsoFlat = pick(3);
    for (Eigen::Vector3d& position : p) position[flat] = 1.0;
    if (pick(4) == 0)
      for (Eigen::Vector3d& position : p) position[alsoFlat] = position[flat];
  }
  if (pick(8) == 0) {
    const Eigen::Vector3d move = p[4] - p[0];
    for (int i = 0; i < 4; ++i) p[4 + i] = p[i] + (pick(4) ? move : Eigen::Vector3d::Zero());
  }
  return result;
}

/// Coordinates with all their bits, in [-1, 1].
inline ImpactCase randomCase(test::Random& random, bool edges) {
  ImpactCase result{edges, {}};
  for (Eigen::Vector3d& position : result.positions) position = random.inCube();
  return result;
}

/// Categories of queries that are hard to decide.
enum class ImpactKind {
  Grid,
  FullDoubles,
  TouchAtStart,
  TouchAtEnd,
  TouchHalfway,
  NearlyTouching,
  InOnePlane,
  Parallel,
  Collinear,
  Still,
  MovingTogether,
  SmallMotion,
  Degenerate,
  Identical,
  FarAway,
  ScaledAxes,
  MixedSizes,
  Denormal,
  Count
};

/// On grids so small that each stated property of a case holds for its doubles.
class HardCases {
 public:
  explicit HardCases(std::uint64_t seed) : m_random(seed) {}

  ImpactCase next(ImpactKind kind) { return next(kind, m_random.below(2)); }
  ImpactCase next(ImpactKind kind, bool edges) {
    ImpactCase query = onGrid(edges, kind != ImpactKind::SmallMotion && m_random.below(3) == 0);
    make(kind, query);
    if (kind != ImpactKind::FullDoubles && m_random.below(2)) shear(query);
    refine(kind, query);
    return query;
  }

 private:
  using Vector = Eigen::Vector3d;

  static Vector& at(ImpactCase& query, int vertex, int end) {
    return query.positions[static_cast<std::size_t>(4 * end + vertex)];
  }
  Vector point() { return m_random.onGrid(17) - Vector::Constant(8); }
  /// Wide ones round in every product, and still touch exactly.
  ImpactCase onGrid(bool edges, bool wide) {
    ImpactCase query{edges, {}};
    for (Vector& p : query.positions)
      p = 4 * (wide ? Vector((m_random.inCube() * 0x1p42).array().round()) : point());
    return query;
  }

  /// The features touch at that end, in quarters of theirs.
  void touch(ImpactCase& query, int end) {
    if (query.edges) {
      const Vector p =
          at(query, 0, end) + 0.25 * m_random.below(5) * (at(query, 1, end) - at(query, 0, end));
      at(query, 3, end) = at(query, 2, end) + (1 << m_random.below(3)) * (p - at(query, 2, end));
    } else {
      const int i = m_random.below(5), j = m_random.below(5 - i);
      at(query, 0, end) = at(query, 1, end) + 0.25 * i * (at(query, 2, end) - at(query, 1, end)) +
                          0.25 * j * (at(query, 3, end) - at(query, 1, end));
    }
  }

  /// Edges, or the triangle's corners and sometimes the vertex, along one direction.
  void align(ImpactCase& query, int end, bool onOneLine) {
    const Vector along = point();
    const auto place = [&](int vertex, int from) {
      at(query, vertex, end) = at(query, from, end) + (m_random.below(9) - 4) * along;
    };
    if (query.edges) {
      place(1, 0);
      if (onOneLine) place(2, 0);
      place(3, 2);
    } else {
      place(2, 1);
      place(3, 1);
      if (onOneLine) place(0, 1);
    }
  }

  void make(ImpactKind kind, ImpactCase& query) {
    const auto ends = 1 + m_random.below(3);  // bits
    switch (kind) {
      case ImpactKind::Grid:
        query = randomGridCase(m_random, query.edges, 1 + m_random.below(4));
        break;
      case ImpactKind::FullDoubles:
        query = randomCase(m_random, query.edges);
        break;
      case ImpactKind::TouchAtStart:
        touch(query, 0);
        break;
      case ImpactKind::TouchAtEnd:
      case ImpactKind::NearlyTouching:
        touch(query, 1);
        break;
      case ImpactKind::TouchHalfway:
        touch(query, 1);
        for (int i = 0; i < 4; ++i) at(query, i, 1) = 2 * at(query, i, 1) - at(query, i, 0);
        break;
      case ImpactKind::InOnePlane: {
        const Vector u = point(), v = point(), origin = point();
        for (Vector& p : query.positions) {
          p = origin + (m_random.below(9) - 4) * u;
          p += (m_random.below(9) - 4) * v;
        }
        break;
      }
      case ImpactKind::Parallel:
      case ImpactKind::Collinear:
        for (int end = 0; end < 2; ++end)
          if (ends & 1 << end) align(query, end, kind == ImpactKind::Collinear);
        break;
      case ImpactKind::Still:
        if (m_random.below(2)) touch(query, 0);
        for (int i = 0; i < 4; ++i) at(query, i, 1) = at(query, i, 0);
        break;
      case ImpactKind::MovingTogether: {
        if (m_random.below(2)) touch(query, 0);
        const Vector move = 4 * point(), other = m_random.below(2) ? move : 4 * point();
        for (int i = 0; i < 4; ++i)
          at(query, i, 1) = at(query, i, 0) + (i < (query.edges ? 2 : 1) ? move : other);
        break;
      }
      case ImpactKind::SmallMotion:
        query = query.mapped([size = std::ldexp(1.0, m_random.between(8, 38))](
                                 const Vector& p) -> Vector { return size * p; });
        touch(query, 1);
        for (int i = 0; i < 4; ++i) {
          const Vector move = point();
          at(query, i, 0) = at(query, i, 1) - move;
          at(query, i, 1) += m_random.below(3) * move;
        }
        break;
      case ImpactKind::Degenerate:
        for (int end = 0; end < 2; ++end) {
          at(query, 3, end) = at(query, 2, end);
          if (m_random.below(2)) at(query, 1, end) = at(query, query.edges ? 0 : 2, end);
        }
        if (m_random.below(2)) touch(query, 1);
        break;
      case ImpactKind::Identical:
        for (int end = 0; end < 2; ++end)
          if (ends & 1 << end)
            for (int i = 0; i < (query.edges ? 2 : 1); ++i)
              at(query, i, end) = at(query, query.edges ? 3 - i : 1, end);
        break;
      default:
        if (m_random.below(2)) touch(query, 1);
    }
  }

  /// Scales each axis by a power of two, some of which leave the range of normal doubles. Touching
  /// features on a grid still touch.
  void scaleAxes(ImpactCase& query) {
    constexpr int kExponents[] = {-1074, -1070, -1000, -600, -540, -530, -345,
                                  -100,  0,     60,    190,  400,  900};
    for (int k = 0; k < 3; ++k) {
      const int exponent = kExponents[m_random.below(static_cast<int>(std::size(kExponents)))];
      for (Vector& p : query.positions) p[k] = std::ldexp(p[k], exponent);
    }
  }

  /// Out of the axes, on the grid.
  void shear(ImpactCase& query) {
    Eigen::Matrix3d matrix;
    for (int k = 0; k < 9; ++k) matrix(k / 3, k % 3) = m_random.below(7) - 3;
    for (Vector& p : query.positions) p = Vector(matrix * p);
  }

  void refine(ImpactKind kind, ImpactCase& query) {
    const auto nudged = [&](double x) {
      return m_random.below(3) ? std::nextafter(x, m_random.below(2) ? 1e9 : -1e9)
                               : x + m_random.ldexp(m_random.unit() - 0.5, -44, 0);
    };
    if (kind == ImpactKind::NearlyTouching)
      for (Vector& p : query.positions)
        if (m_random.below(3) == 0) p[m_random.below(3)] = nudged(p[m_random.below(3)]);
    if (kind == ImpactKind::FarAway) {
      const bool isWhole = m_random.below(2);
      const double size = isWhole ? std::ldexp(1.0, m_random.below(42)) : 1e6;
      const Vector offset = size * (isWhole ? point() : m_random.inCube());
      for (Vector& p : query.positions) p += offset;
    }
    if (kind == ImpactKind::ScaledAxes) scaleAxes(query);
    if (kind == ImpactKind::MixedSizes)
      for (Vector& p : query.positions)
        for (double& x : p)
          if (m_random.below(3) == 0) x = std::ldexp(x, m_random.between(-90, 90));
    if (kind == ImpactKind::Denormal)
      for (Vector& p : query.positions) p = test::scaled(p, -1074 + m_random.below(4));
  }

  test::Random m_random;
};

}  // namespace palpate
