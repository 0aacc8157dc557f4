#include "Math/Box.h"

#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <cmath>

namespace palpate::test {
namespace {

FloatBox randomBox(Random& random) {
  FloatBox box;
  for (int k = 0; k < 3; ++k) {
    box.lower[k] = static_cast<float>(random.below(4));
    box.upper[k] = box.lower[k] + static_cast<float>(random.below(3));
  }
  return box;
}

/// Small integer bounds, so that boxes often touch: closed boxes overlap there.
TEST(FloatBox, OverlapsWhereAllIntervalsDo) {
  Random random(1);
  int overlaps = 0;
  for (int repeat = 0; repeat < 5000; ++repeat) {
    const FloatBox a = randomBox(random), b = randomBox(random);
    bool share = true;
    for (int k = 0; k < 3; ++k) {
      bool any = false;
      for (float x = 0; x <= 8; ++x)
        any = any || (a.lower[k] <= x && x <= a.upper[k] && b.lower[k] <= x && x <= b.upper[k]);
      share = share && any;
    }
    ASSERT_EQ(a.overlaps(b), share);
    overlaps += share;
    FloatBox both = a;
    both.add(b);
    for (int k = 0; k < 3; ++k) {
      ASSERT_EQ(both.lower[k], std::fmin(a.lower[k], b.lower[k]));
      ASSERT_EQ(both.upper[k], std::fmax(a.upper[k], b.upper[k]));
    }
  }
  EXPECT_GT(overlaps, 500);
}

TEST(FloatBox, AnEmptyBoxOverlapsNothingAndIsNeutral) {
  Random random(2);
  const FloatBox empty;
  EXPECT_TRUE(empty.empty());
  EXPECT_FALSE(empty.overlaps(empty));
  const FloatBox box = randomBox(random);
  EXPECT_FALSE(box.empty());
  EXPECT_FALSE(empty.overlaps(box));
  FloatBox sum = empty;
  sum.add(box);
  EXPECT_EQ(sum.lower, box.lower);
  EXPECT_EQ(sum.upper, box.upper);
  FloatBox point;
  point.lower = point.upper = {1, 1, 1, 0};
  EXPECT_FALSE(point.empty());
}

TEST(FloatBox, ABoundAtTheLargestFloatMayBeClamped) {
  FloatBox box;
  box.lower = {-1, -1, -1, 0};
  box.upper = {1, 1, 1, 0};
  EXPECT_FALSE(box.mayBeClamped());
  for (int k = 0; k < 3; ++k) {
    FloatBox low = box, high = box;
    low.lower[k] = -kLargestFloat;
    high.upper[k] = kLargestFloat;
    EXPECT_TRUE(low.mayBeClamped());
    EXPECT_TRUE(high.mayBeClamped());
  }
}

/// The bounds of f's rounded value contain every double that rounds to f, with its own error.
TEST(OutwardRounding, EnclosesEveryCoordinateThatRoundsToAFloat) {
  Random random(3);
  const auto check = [](float f) {
    const double size = std::abs(static_cast<double>(f)),
                 error = size >= 0x1p-126 ? 0x1p-24 * size : 0x1p-150;
    const double most = error + 0x1p-53 * (size + error);
    ASSERT_LT(OutwardRounding::down(f), f - most);
    ASSERT_GT(OutwardRounding::up(f), f + most);
    ASSERT_GE(OutwardRounding::down(f), f - 0x1p-21 * size - 0x1p-102);
    ASSERT_LE(OutwardRounding::up(f), f + 0x1p-21 * size + 0x1p-102);
  };
  for (int exponent = -149; exponent <= 119; ++exponent) {
    for (int repeat = 0; repeat < 50; ++repeat) {
      const auto f = static_cast<float>(std::ldexp(1 + random.unit(), exponent));
      check(f);
      check(-f);
    }
  }
  check(0.0f);
  check(-0.0f);
  FloatBox box;
  box.lower = {-1, 2, 0, 0};
  box.upper = {3, 4, 0, 0};
  const FloatBox outward = OutwardRounding::outward(box);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(outward.lower[k], OutwardRounding::down(box.lower[k]));
    EXPECT_EQ(outward.upper[k], OutwardRounding::up(box.upper[k]));
  }
}

TEST(BoxArrays, HaveTheirBoxesAndPadding) {
  Random random(4);
  BoxArrays arrays;
  arrays.resize(5);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(arrays.lower[k].size(), 5 + BoxArrays::kPadding);
    EXPECT_EQ(arrays.upper[k].size(), 5 + BoxArrays::kPadding);
  }
  for (std::size_t i = 0; i < 5; ++i) {
    const FloatBox box = randomBox(random);
    for (int k = 0; k < 3; ++k) {
      arrays.lower[k][i] = box.lower[k] + static_cast<float>(k);
      arrays.upper[k][i] = box.upper[k] + static_cast<float>(k);
    }
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(arrays[i].lower[k], box.lower[k] + static_cast<float>(k));
      EXPECT_EQ(arrays[i].upper[k], box.upper[k] + static_cast<float>(k));
    }
  }
}

}  // namespace
}  // namespace palpate::test
