#include "Math/StableLength.h"

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>

namespace palpate::testing {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity(),
                 kLargest = std::numeric_limits<double>::max(),
                 kSmallest = std::numeric_limits<double>::denorm_min();

/// Vectors with components of any size, and of sizes near each other.
Eigen::Vector3d randomVector(Random& random) {
  const int exponent = static_cast<int>(random() % 1900) - 950;
  Eigen::Vector3d v = randomPoint(random, -1, 1);
  for (double& x : v) x = std::ldexp(x, exponent + static_cast<int>(random() % 4) * 10);
  return v;
}

TEST(StableLength, IsWithinTwoUlpOfTheLength) {
  Random random(1);
  for (int i = 0; i < 100'000; ++i) {
    const Eigen::Vector3d v = randomVector(random);
    const double length = std::hypot(v.x(), v.y(), v.z());
    ASSERT_NEAR(stableLength(v) / length, 1.0, 0x1p-51) << v.transpose();
  }
}

TEST(StableLength, HasTheSameBitsAtEveryAddress) {
  Random random(2);
  for (int i = 0; i < 10'000; ++i) {
    const Eigen::Vector3d v = randomVector(random);
    const std::uint64_t bits = std::bit_cast<std::uint64_t>(stableLength(v));
    alignas(64) std::array<std::byte, 128> memory;
    for (std::size_t at = 0; at < 64; at += sizeof(double)) {
      const auto* const copy = new (memory.data() + at) Eigen::Vector3d(v);
      ASSERT_EQ(std::bit_cast<std::uint64_t>(stableLength(*copy)), bits) << v.transpose();
    }
  }
}

TEST(StableLength, HoldsAtTheEndsOfTheRange) {
  EXPECT_EQ(stableLength({0, -0.0, 0}), 0);
  EXPECT_EQ(stableLength({0, -3e-300, 4e-300}), 5e-300);
  EXPECT_EQ(stableLength({3e300, 0, -4e300}), 5e300);
  EXPECT_EQ(stableLength({kSmallest, 0, 0}), kSmallest);
  EXPECT_NEAR(stableLength({0, 0, -kLargest}) / kLargest, 1.0, 0x1p-51);
  EXPECT_EQ(stableLength({kLargest, kLargest, 0}), kInf);
  EXPECT_EQ(stableLength({1, -kInf, 0}), kInf);
  EXPECT_TRUE(std::isnan(stableLength({1, std::nan(""), 2})));
}

}  // namespace
}  // namespace palpate::testing
