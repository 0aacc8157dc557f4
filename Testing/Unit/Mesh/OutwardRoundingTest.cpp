#include "Mesh/FloatPositions.h"
#include "Mesh/TriangleBoxes.h"
#include "Math/Box.h"

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

// Boxes in float enclose the doubles from which they are made, at every exponent.

namespace palpate {
namespace {

using Eigen::Vector3d;
using testing::Random;

constexpr double kFloatMargin = 0x1p-20;  ///< the most that outward rounding may add, relative

/// (x - origin) * scale with enough bits for the test. long double has 64 bits. If the difference
/// needs more, the origin is so far away that the last bits cannot affect a bound of 2^-22.
long double inFrame(double x, double origin, double scale) {
  return (static_cast<long double>(x) - origin) * scale;
}

/// The library's interval of one coordinate encloses it, and is not much wider.
void expectHeld(double x, double origin, double scale) {
  const Vector3d position(x, x, x);
  FloatFrame frame;
  frame.origin = {origin, origin, origin};
  frame.scale = scale;
  // Several at once, and the last alone.
  const Vector3d positions[3] = {position, position, position};
  FloatPoint points[3];
  toFloats(positions, frame, points);
  const FloatPoint& point = points[0];
  for (const FloatPoint& other : points)
    ASSERT_TRUE(other.x == point.x && other.y == point.y && other.z == point.z);
  const float lower = OutwardRounding::down(point.x), upper = OutwardRounding::up(point.x);
  const long double exact = inFrame(x, origin, scale);
  ASSERT_LE(lower, exact) << x << " " << origin << " " << scale;
  ASSERT_GE(upper, exact) << x << " " << origin << " " << scale;
  ASSERT_LE(upper - lower, kFloatMargin * std::fabs(exact) + 4.0L * OutwardRounding::kAbsolute)
      << x << " " << origin << " " << scale;
}

/// Significands at which rounding to nearest changes direction: near 1 and 2, and around half ulps
/// of float.
std::vector<double> significands(Random& random) {
  std::vector<double> all{1.0, std::nextafter(1.0, 2.0), std::nextafter(2.0, 1.0), 1.5};
  for (int i = 0; i < 6; ++i) {
    const double f = 1.0 + std::floor(testing::uniform(random, 0, 0x1p23)) * 0x1p-23;
    for (const double half : {0x1p-24, 0x1p-24 - 0x1p-52, 0x1p-24 + 0x1p-52})
      all.push_back(f + half);
  }
  return all;
}

TEST(OutwardRounding, EnclosesEveryExponentOfFloats) {
  Random random(1);
  for (int exponent = -1074; exponent < 120; ++exponent)
    for (const double s : significands(random))
      for (const double sign : {-1.0, 1.0}) {
        const double x = sign * std::ldexp(s, exponent);
        if (std::fabs(x) <= 0x1p120) expectHeld(x, 0, 1);
      }
  expectHeld(0.0, 0, 1);
  expectHeld(-0.0, 0, 1);
}

TEST(OutwardRounding, EnclosesEveryExponentInItsOwnScale) {
  Random random(2);
  for (int exponent = -1074; exponent < 1024; ++exponent) {
    const double size = std::ldexp(1.0, exponent), scale = frameScale(size);
    ASSERT_EQ(std::ilogb(scale) % 32, 0);
    for (const double s : significands(random)) {
      const double x = s * size;
      if (std::isinf(x)) continue;
      expectHeld(x, 0, scale);
      expectHeld(-x, 0, scale);
      // Within 1e-5 to 1e5 times the size.
      expectHeld(x * 0x1p-17, 0, scale);
      if (exponent < 1006) expectHeld(-x * 0x1p17, 0, scale);
    }
  }
}

TEST(OutwardRounding, EnclosesDifferencesFromTheOrigin) {
  Random random(3);
  for (int exponent = -1060; exponent < 1000; exponent += 3) {
    const double origin = std::ldexp(testing::uniform(random, 1, 2), exponent);
    for (int closer = 0; closer <= 52; ++closer) {
      const double x =
          origin + std::ldexp(testing::uniform(random, -1, 1), std::max(exponent - closer, -1074));
      expectHeld(x, origin, frameScale(std::ldexp(1.0, exponent - closer)));
      expectHeld(x, -origin, frameScale(std::ldexp(1.0, exponent)));
    }
  }
}

TEST(OutwardRounding, ScaleBringsEverySpreadNearOne) {
  for (int exponent = -1074; exponent < 1024; ++exponent) {
    const double spread = std::ldexp(1.0, exponent), scaled = spread * frameScale(spread);
    EXPECT_GE(scaled, exponent < -1008 ? 0x1p-82 : 0x1p-16) << exponent;
    EXPECT_LE(scaled, exponent > 1008 ? 0x1p32 : 0x1p16) << exponent;
  }
  EXPECT_EQ(frameScale(0), 1.0);
  EXPECT_GT(frameScale(std::numeric_limits<double>::infinity()), 0.0);
}

TEST(OutwardRounding, IsMonotone) {
  float last = -std::numeric_limits<float>::infinity(), lastUp = last;
  for (int exponent = 119; exponent >= -149; --exponent)
    for (const float s : {1.75f, 1.0f}) {
      const float f = -std::ldexp(s, exponent);
      ASSERT_GE(OutwardRounding::down(f), last);
      ASSERT_GE(OutwardRounding::up(f), lastUp);
      last = OutwardRounding::down(f);
      lastUp = OutwardRounding::up(f);
    }
}

/// Clamping beyond the range of float: bounds stay finite and in order, and overlapping ones still
/// overlap.
TEST(OutwardRounding, ValuesBeyondTheRangeAreClampedAndFinite) {
  const std::vector<Vector3d> positions{{1e300, -1e300, 0x1p121}, {-1e300, 1e300, -0x1p121}};
  FloatPoint points[2];
  toFloats(positions, {}, points);
  for (const FloatPoint& p : points)
    for (const float f : {p.x, p.y, p.z}) {
      EXPECT_EQ(std::fabs(f), kLargestFloat);
      EXPECT_TRUE(std::isfinite(OutwardRounding::down(f)) && std::isfinite(OutwardRounding::up(f)));
    }
}

/// The boxes that the SIMD code makes are those of OutwardRounding, bit for bit.
TEST(OutwardRounding, SimdTriangleBoxesMatchOutwardRounding) {
  Random random(4);
  const std::size_t count = 3000;
  std::vector<FloatPoint> points(3 * count);
  std::vector<Triangle> triangles;
  for (FloatPoint& p : points) {
    const auto value = [&] {
      const double fraction = testing::uniform(random, -1, 1);
      return static_cast<float>(std::ldexp(fraction, static_cast<int>(random() % 269) - 149));
    };
    p = {value(), value(), value(), 0};
  }
  for (std::uint32_t t = 0; t < count; ++t) triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  const std::vector<std::uint32_t> groups{0, 1, 18, 19, 20, 1000, 1000, 2999, 3000};
  std::vector<FloatBox> groupBoxes(groups.size() - 1);
  BoxArrays boxes;
  boxes.resize(count);
  triangleBoxes(points.data(), nullptr, triangles.data(), groups, boxes, groupBoxes.data());
  for (std::size_t g = 0; g + 1 < groups.size(); ++g) {
    FloatBox group;
    for (std::size_t t = groups[g]; t < groups[g + 1]; ++t) {
      for (int k = 0; k < 3; ++k) {
        float values[3];
        for (int i = 0; i < 3; ++i) values[i] = (&points[triangles[t][i]].x)[k];
        ASSERT_EQ(boxes.lower[k][t], OutwardRounding::down(*std::min_element(values, values + 3)));
        ASSERT_EQ(boxes.upper[k][t], OutwardRounding::up(*std::max_element(values, values + 3)));
      }
      group.add(boxes[t]);
    }
    if (groups[g] == groups[g + 1]) continue;
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(groupBoxes[g].lower[k], group.lower[k]) << g;
      EXPECT_EQ(groupBoxes[g].upper[k], group.upper[k]) << g;
    }
  }
}

}  // namespace
}  // namespace palpate
