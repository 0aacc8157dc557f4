#pragma once

#include "Math/TriangleIntersection.h"

#include <cmath>
#include <cstdint>
#include <random>
#include <utility>

namespace palpate::test {

/// The same numbers from the same seed on every platform. The standard's distributions do not
/// guarantee that.
class Random {
 public:
  explicit Random(std::uint64_t seed) : m_engine(seed) {}
  int below(int count) { return static_cast<int>(m_engine() % static_cast<unsigned>(count)); }
  int between(int first, int last) { return first + below(last - first + 1); }
  double unit() { return static_cast<double>(m_engine() >> 11) * 0x1p-53; }
  /// x times a power of two with an exponent from first to last.
  double ldexp(double x, int first, int last) { return std::ldexp(x, between(first, last)); }
  Eigen::Vector3d inCube() { return {2 * unit() - 1, 2 * unit() - 1, 2 * unit() - 1}; }
  Eigen::Vector3d onGrid(int size) {
    const int z = below(size), y = below(size), x = below(size);
    return Eigen::Vector3i(x, y, z).cast<double>();
  }

 private:
  std::mt19937_64 m_engine;
};

using CornersPair = std::pair<Corners, Corners>;

/// Categories of pairs for which exact decisions are hard, and one for which they are not.
enum class Kind {
  Random,
  SmallGrid,
  TinyGrid,
  NearlyTouching,
  SharedVertex,
  SharedEdge,
  CoplanarAxis,
  CoplanarTilted,
  CoplanarShared,
  Segments,
  Points,
  MixedExponents,
  Huge,
  Tiny,
  Denormal,
  FarSmall,
  Count
};

inline Corners cornersOf(auto&& makeCorner) { return {makeCorner(), makeCorner(), makeCorner()}; }
inline Eigen::Vector3d pointOn(const Corners& t, Random& random) {
  const double u = random.unit(), v = random.unit() * (1 - u);
  return t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]);
}
inline Eigen::Vector3d scaled(const Eigen::Vector3d& p, int exponent) {
  return {std::ldexp(p[0], exponent), std::ldexp(p[1], exponent), std::ldexp(p[2], exponent)};
}
inline CornersPair scaled(CornersPair pair, int exponent) {
  for (Corners* corners : {&pair.first, &pair.second})
    for (auto& corner : *corners) corner = scaled(corner, exponent);
  return pair;
}

/// A corner becomes another one, or the midpoint of the others (exact on even grids), or all become
/// one point.
inline void degenerate(Corners& t, Random& random) {
  const int i = random.below(3), j = (i + 1) % 3, k = (i + 2) % 3;
  switch (random.below(3)) {
    case 0:
      t[i] = t[j];
      break;
    case 1:
      t[i] = (t[j] + t[k]) / 2;
      break;
    default:
      t[i] = 2 * t[j] - t[k];
  }
}

inline CornersPair makePair(Kind kind, Random& random) {
  const auto anywhere = [&] { return random.inCube(); };
  const auto grid = [&] { return Eigen::Vector3d(random.onGrid(5)); };
  CornersPair pair{cornersOf(anywhere), cornersOf(anywhere)};
  auto& [a, b] = pair;
  const CornersPair gridPair{cornersOf(grid), cornersOf(grid)};
  const auto ofAnyKind = [&] { return random.below(2) ? gridPair : pair; };
  switch (kind) {
    case Kind::Random:
      break;
    case Kind::SmallGrid:
      pair = gridPair;
      break;
    case Kind::TinyGrid:
      for (Corners* t : {&a, &b}) *t = cornersOf([&] { return random.onGrid(3); });
      break;
    case Kind::NearlyTouching:
      for (int i = random.below(3); i < 3; ++i) b[i] = pointOn(a, random);
      if (random.below(2)) b[0] = a[0] + random.unit() * (a[1] - a[0]);
      break;
    case Kind::SharedVertex:
      b[random.below(3)] = a[random.below(3)];
      break;
    case Kind::SharedEdge: {
      pair = ofAnyKind();
      const int i = random.below(3), j = random.below(3);
      b[j] = a[i];
      b[(j + 1) % 3] = a[(i + 1 + random.below(2)) % 3];
      break;
    }
    case Kind::CoplanarAxis: {
      pair = ofAnyKind();
      const int axis = random.below(3);
      const double height = random.unit();
      for (Corners* t : {&a, &b})
        for (auto& corner : *t) corner[axis] = height;
      break;
    }
    case Kind::CoplanarTilted:
    case Kind::CoplanarShared: {
      const Eigen::Vector3d origin = random.onGrid(9), u = random.onGrid(7), v = random.onGrid(7);
      const auto inPlane = [&] {
        const int alongU = random.between(-3, 3), alongV = random.between(-3, 3);
        return Eigen::Vector3d(origin + alongU * u + alongV * v);
      };
      pair = {cornersOf(inPlane), cornersOf(inPlane)};
      if (kind == Kind::CoplanarShared) {
        const int i = random.below(3);
        for (int j = random.below(3); j < 3; ++j) b[j] = a[(i + j) % 3];
      }
      break;
    }
    case Kind::Segments:
      pair = gridPair;
      if (random.below(2)) degenerate(b, random);
      degenerate(a, random);
      break;
    case Kind::Points:
      pair = gridPair;
      a = {a[0], a[0], a[0]};
      if (random.below(2)) b = {b[0], b[0], b[0]};
      if (random.below(2))
        a = cornersOf([&, middle = Eigen::Vector3d((b[0] + b[1]) / 2)] { return middle; });
      break;
    case Kind::MixedExponents:
      pair = ofAnyKind();
      for (Corners* t : {&a, &b})
        for (auto& corner : *t)
          for (double& x : corner)
            x = std::ldexp(x, random.below(3) ? 0 : random.between(-1060, 1020));
      break;
    case Kind::Huge:
      pair = ofAnyKind();
      pair = scaled(pair, random.between(980, 1020));
      break;
    case Kind::Tiny:
      pair = ofAnyKind();
      pair = scaled(pair, random.between(-1020, -960));
      break;
    case Kind::Denormal:
      pair = scaled(gridPair, random.between(-1074, -1060));
      break;
    case Kind::FarSmall: {
      pair = ofAnyKind();
      const Eigen::Vector3d far = 1e6 * random.inCube();
      for (Corners* t : {&a, &b})
        for (auto& corner : *t) corner = far + 1e-9 * corner;
      break;
    }
    case Kind::Count:
      break;
  }
  if (random.below(2)) std::swap(a, b);
  return pair;
}

}  // namespace palpate::test
