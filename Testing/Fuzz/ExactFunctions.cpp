#include "Targets.h"

#include <palpate/FeaturePairs.h>

#include "Unit/Math/DistanceAtTime.h"
#include "Unit/Math/DistanceCheck.h"
#include "Unit/Math/ImpactCheck.h"
#include "Unit/Math/IntersectionOracle.h"

#include <gmpxx.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>
#include <span>
#include <utility>

namespace palpate::fuzz {

namespace {

using Eigen::Vector3d;

/// GMP's memory, in blocks of powers of two that are used again. The allocator of AddressSanitizer
/// would take most of the time of rational arithmetic.
class RationalMemory {
 public:
  /// From now on; no number may be there yet.
  static void use() {
    static const bool isUsed = (mp_set_memory_functions(allocate, reallocate, release), true);
    (void)isUsed;
  }

 private:
  struct Block {
    Block* next;
  };

  static void* allocate(std::size_t bytes) {
    Block*& free = s_free[classOf(bytes)];
    if (!free) return std::malloc(std::size_t{1} << classOf(bytes));
    return std::exchange(free, free->next);
  }
  static void release(void* memory, std::size_t bytes) {
    Block*& free = s_free[classOf(bytes)];
    free = new (memory) Block{free};
  }
  static void* reallocate(void* memory, std::size_t before, std::size_t now) {
    if (classOf(before) == classOf(now)) return memory;
    void* moved = allocate(now);
    std::memcpy(moved, memory, std::min(before, now));
    release(memory, before);
    return moved;
  }
  static std::size_t classOf(std::size_t bytes) {
    return static_cast<std::size_t>(std::bit_width(std::max<std::size_t>(bytes, 16) - 1));
  }

  static thread_local std::array<Block*, 64> s_free;
};
thread_local std::array<RationalMemory::Block*, 64> RationalMemory::s_free{};

/// Positions from bytes. Each takes kBytesOfPoint of them, so that a changed byte changes one
/// position and those that are made from it. Bytes that are missing are 0.
class Positions {
 public:
  explicit Positions(Bytes bytes) : m_bytes(bytes) {}

  std::uint8_t byte() { return m_at < m_bytes.size() ? m_bytes[m_at++] : 0; }

  /// Any finite doubles: with any bits, small integers, those of earlier positions or next to
  /// them; and points on lines through earlier ones.
  template <std::size_t count>
  std::array<Vector3d, count> read() {
    const int exponent = exponentOf(byte());
    std::array<Vector3d, count> all;
    for (std::size_t i = 0; i < count; ++i) all[i] = point({all.data(), i});
    for (Vector3d& p : all)
      for (double& x : p)
        if (const double y = std::ldexp(x, exponent); std::isfinite(y)) x = y;
    return all;
  }

 private:
  /// None for most bytes.
  static int exponentOf(std::uint8_t byte) { return byte < 192 ? 0 : (byte - 224) * 33; }

  std::uint64_t bits() {
    std::uint64_t all = 0;
    for (int i = 0; i < 8; ++i) all = all << 8 | byte();
    return all;
  }
  static double finite(std::uint64_t bits) {
    const auto value = std::bit_cast<double>(bits);
    return std::isfinite(value) ? value : std::bit_cast<double>(bits & ~(1ull << 62));
  }

  double coordinate(std::span<const Vector3d> earlier, int axis) {
    const std::uint8_t kind = byte();
    const std::uint64_t payload = bits();
    const auto small = static_cast<std::int8_t>(payload >> 56);
    const double other = earlier.empty() ? 1.0 : earlier[kind / 8 % earlier.size()][axis];
    switch (kind % 8) {
      case 0:
        return finite(payload);
      case 1:
        return small;
      case 2:
        return small % 4;
      case 3:
        return other;
      case 4:
        return std::bit_cast<double>(std::bit_cast<std::uint64_t>(other) +
                                     static_cast<std::uint64_t>(small % 4));
      case 5:
        return std::ldexp(small, static_cast<std::int8_t>(payload >> 48) * 8);
      case 6:
        return other + std::ldexp(small, static_cast<std::int8_t>(payload >> 48));
      default:
        return static_cast<double>(payload >> 11) * 0x1p-53;
    }
  }

  Vector3d point(std::span<const Vector3d> earlier) {
    const std::uint8_t kind = byte();
    Vector3d own;
    for (int k = 0; k < 3; ++k) {
      own[k] = coordinate(earlier, k);
      if (!std::isfinite(own[k])) own[k] = 0.0;
    }
    if (earlier.empty() || kind < 128) return own;
    const auto& p = earlier[kind % earlier.size()];
    const auto& q = earlier[kind / 8 % earlier.size()];
    Vector3d made = p;
    if (kind >= 160) made += (kind % 7 - 1) * 0.25 * (q - p);
    for (int k = 0; kind >= 224 && k < 3; ++k) made[k] = std::nextafter(made[k], own[k]);
    return made.allFinite() ? made : own;
  }

  Bytes m_bytes;
  std::size_t m_at = 0;
};

template <std::size_t count>
double largestOf(const std::array<Vector3d, count>& all) {
  double largest = 0.0;
  for (const Vector3d& p : all) largest = std::max(largest, p.cwiseAbs().maxCoeff());
  return largest;
}

bool isNan(const Vector3d& v) { return v.array().isNaN().all(); }

/// NaN or infinity in gives NaN out.
void checkNotFinite(oracle::Four x, std::uint8_t place) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  x[place % 4][place / 4 % 3] = place & 16   ? std::numeric_limits<double>::quiet_NaN()
                                : place & 32 ? kInfinity
                                             : -kInfinity;
  const VertexTriangleDistance face = vertexTriangleDistance(x[0], x[1], x[2], x[3]);
  const EdgeEdgeDistance edge = edgeEdgeDistance(x[0], x[1], x[2], x[3]);
  EXPECT_TRUE(std::isnan(face.distance) && isNan(face.difference) && isNan(face.normal));
  EXPECT_TRUE(std::isnan(edge.distance) && isNan(edge.difference) && isNan(edge.normal));
}

/// With a distance, at a few times: none before the impact is an impact, and the impact is one
/// within the stated error. Without an impact none is one.
void checkWithDistance(const ImpactCase& query, double distance, double tolerance) {
  using oracle::Rational;
  const std::optional<double> impact = query.time({distance, tolerance});
  const Rational square = Rational(distance) * Rational(distance);
  for (const double time : {0.0, 0.25, 0.5, 1.0})
    if (!impact || time < *impact) {
      EXPECT_TRUE(oracle::FeaturesAtTime(query, time).isAbove(square))
          << "missed at " << time << ", distance " << distance << ", " << text(query);
    }
  if (!impact) return;
  double motion = 0.0, spread = 0.0;
  std::array<Vector3d, 8> p = query.positions;
  const double unit =
      largestOf(p) < 0x1p1000 ? 1.0 : 16.0;  // differences of differences are finite
  for (Vector3d& each : p) each /= unit;
  const std::size_t first = query.edges ? 2 : 1;
  for (std::size_t i = 0; i < first; ++i)
    for (std::size_t j = first; j < 4; ++j)
      motion = std::max(motion, ((p[4 + i] - p[i]) - (p[4 + j] - p[j])).stableNorm());
  for (const Vector3d& l : p)
    for (const Vector3d& r : p) spread = std::max(spread, (l - r).cwiseAbs().maxCoeff());
  const Rational most =
      Rational(distance) + Rational(tolerance) * Rational(unit) * Rational(motion) +
      Rational(0x1p-35) * (Rational(unit) * Rational(spread) + Rational(distance));
  EXPECT_TRUE(oracle::FeaturesAtTime(query, *impact).isAtMost(most * most))
      << "too early at " << *impact << ", distance " << distance << ", " << text(query);
}

}  // namespace

void distance(Bytes bytes) {
  RationalMemory::use();
  Positions positions(bytes);
  const std::uint8_t mode = positions.byte();
  const oracle::Four x = positions.read<4>();
  if (mode >= 240) return checkNotFinite(x, mode);
  if (largestOf(x) > 0x1p1020) return;  // lengths of differences would not be finite
  oracle::checkVertexTriangle(x);
  oracle::checkEdgeEdge(x);
}

void intersection(Bytes bytes) {
  RationalMemory::use();
  const auto x = Positions(bytes).read<6>();
  const bool truth = intersection::trianglesIntersect(x);
  EXPECT_EQ(trianglesIntersect(x[0], x[1], x[2], x[3], x[4], x[5]), truth);
  EXPECT_EQ(trianglesIntersect(x[5], x[3], x[4], x[1], x[0], x[2]), truth);
}

void timeOfImpact(Bytes bytes) {
  RationalMemory::use();
  constexpr std::array kTolerances{1e-6, 1e-2, 0x1p-50, 1.0};
  Positions positions(bytes);
  const std::uint8_t mode = positions.byte(), size = positions.byte();
  const ImpactCase query{bool(mode & 1), positions.read<8>()};
  const double tolerance = kTolerances[mode / 2 % 4];
  int impacts = 0;
  if (mode < 128) return expectTrue(query, tolerance, impacts);
  // For sizes from 128, relative to the positions.
  const double largest = size < 128 ? 0x1p11 : std::max(largestOf(query.positions), 0x1p-1000);
  const double distance = std::ldexp(1.0 + mode % 16, std::ilogb(largest) + size % 32 - 35);
  checkWithDistance(query, distance, std::max(tolerance, 1e-6));
}

}  // namespace palpate::fuzz
