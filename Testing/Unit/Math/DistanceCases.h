#pragma once

#include "TrianglePairs.h"

#include <Eigen/Geometry>

#include <array>
#include <cmath>

/// Four positions whose distances are hard to decide: (p, a, b, c), or (p0, p1, q0, q1).
namespace palpate::oracle {

using Four = std::array<Eigen::Vector3d, 4>;

enum class DistanceKind {
  Random,
  Sliver,
  FarAway,
  SmallGrid,
  NearlyTouching,
  NearlyParallel,
  NearlyCoincident,
  NoArea,
  FarVertex,
  AnySize,
  MiddleOfTheLongestEdge,  ///< where two weights are 1/2
  ShortEdge,
  SmallFarAway,  ///< scaled so that the differences are near 1, sums of the positions overflow
  FarEdges,      ///< in whole numbers, with a perpendicular that passes exactly through an end
  FarParallel,   ///< the error compensation would carry the coordinates, not the differences
  Count
};

inline constexpr int kDistanceKinds = static_cast<int>(DistanceKind::Count);

class DistanceCases {
 public:
  explicit DistanceCases(std::uint64_t seed) : m_random(seed) {}

  Four next(DistanceKind kind) {
    Four x{vector(), vector(), vector(), vector()};
    switch (kind) {
      case DistanceKind::Sliver:
        x[3] = x[1] + real() * (x[2] - x[1]);
        x[3] += smallVector();
        break;
      case DistanceKind::FarAway:
        for (Vector& v : x) v += Vector(1e6, -2e6, 3e5);
        break;
      case DistanceKind::SmallGrid:
        for (Vector& v : x) v = m_random.onGrid(4);
        break;
      case DistanceKind::NearlyTouching:
        x[0] = x[1] + unit() * (x[2] - x[1]);
        x[0] += 0.3 * below(2) * (x[3] - x[1]);
        x[0] += smallVector();
        break;
      case DistanceKind::NearlyParallel:
        x[3] = x[2] + real() * (x[1] - x[0]);
        x[3] += smallVector();
        break;
      case DistanceKind::NearlyCoincident: {
        Vector near = x[below(4)];
        const int share = below(3);
        near += share * smallVector();
        x[1 + below(3)] = near;
        break;
      }
      case DistanceKind::NoArea:
        x[3] = x[2];
        if (below(2)) x[1] = x[2];
        break;
      case DistanceKind::FarVertex:
        x[0] /= smallPower();
        break;
      case DistanceKind::AnySize:
        for (Vector& v : x) v *= std::ldexp(1.0, below(2092) - 1070);
        if (below(4) == 0) x[below(4)] *= 1e-20;
        break;
      case DistanceKind::MiddleOfTheLongestEdge: {
        const Vector b = x[2], c = x[3], a = 0.5 * (b + c) + 0.3 * x[1],
                     normal = (b - a).cross(c - a).normalized();
        x[1] = a;
        x[0] = b + (0.5 + 0.1 * smallReal()) * (c - b);
        x[0] += smallReal() * normal;
        x[0] += 0x1p-53 * below(3) * (a - b);
        break;
      }
      case DistanceKind::ShortEdge: {
        const Vector a = x[1], b = a + std::ldexp(1.0, -below(50)) * x[2], c = x[3],
                     normal = (b - a).cross(c - a).normalized();
        const double s = unit();
        x[0] = (1 - s) * a + s * c + m_random.ldexp(real(), -59, 0) * (b - a);
        x[0] += real() * normal;
        x[2] = b;
        if (below(2)) x = {x[0], b, c, a};
        break;
      }
      case DistanceKind::SmallFarAway: {
        const int axis = below(3), exponent = below(1060) - 1074;
        const double far = std::ldexp(1.0, exponent + 1010 + below(25));
        for (Vector& v : x) {
          v = test::scaled(m_random.onGrid(9), exponent);
          v[axis] = far;
        }
        break;
      }
      case DistanceKind::FarEdges: {
        const auto whole = [&] { return m_random.onGrid(1 << 20); };
        Vector p = 4 * whole(), q = 4 * whole();
        p -= 4 * whole();
        q -= 4 * whole();
        const Vector p0 = whole();
        const int alongP = below(2), alongQ = below(5), across = 1 + below(3);
        const Vector q0 = p0 + alongP * p - 0.25 * alongQ * q + across * p.cross(q);
        x = {p0, p0 + p, q0, q0 + q};
        if (below(2)) x = {q0, q0 + q, p0, p0 + p};
        break;
      }
      case DistanceKind::FarParallel: {
        const Vector origin = Vector(1.1, -1.3, 1.7) * 0x1p99,
                     edge = 0x1p50 * m_random.onGrid(1000),
                     q0 = origin + 0x1p50 * m_random.onGrid(100);
        x = {origin, origin + edge, q0, q0 + (1 + below(3)) * edge};
        x[3] += 0x1p50 * m_random.onGrid(2);
        break;
      }
      default:
        break;
    }
    return x;
  }
  int below(int n) { return m_random.below(n); }
  double unit() { return m_random.unit(); }

 private:
  using Vector = Eigen::Vector3d;
  double real() { return 2 * unit() - 1; }
  double smallPower() { return std::pow(10.0, -below(18)); }
  double smallReal() {
    const double power = smallPower();
    return power * real();
  }
  Vector vector() { return m_random.inCube(); }
  Vector smallVector() {
    const double power = smallPower();
    return power * vector();
  }

  test::Random m_random;
};

}  // namespace palpate::oracle
