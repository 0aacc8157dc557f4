#include "Geometry/Motion.h"

#include "Core/SimdPath.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

namespace palpate::test {
namespace {

using Eigen::Vector3d;

MotionRange oneByOne(const std::vector<Vector3d>& before, const std::vector<Vector3d>& now,
                     std::size_t begin, std::size_t end) {
  MotionRange range;
  for (std::size_t i = begin; i < end; ++i) {
    const Vector3d moved = now[i] - before[i];
    range.add({moved, moved, moved, moved.squaredNorm(), 1.0});
  }
  return range;
}

/// Eight vertices at a time and the rest one by one, in any part of a mesh.
TEST(Motion, RangeIsThatOfEachVertexOnEveryPath) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<Vector3d> before, now;
  for (int i = 0; i < 60; ++i) {
    before.push_back({normal(random), normal(random), normal(random)});
    now.push_back(before.back() + std::exp(normal(random)) * Vector3d(1, normal(random), -2));
  }
  const Positions start(before), end(now);
  for (const std::size_t first : {0, 3})
    for (std::size_t last = first; last <= before.size(); ++last) {
      const MotionRange expected = oneByOne(before, now, first, last);
      std::vector<MotionRange> ofPaths;
      for (const std::string& path : simdPaths()) {
        useSimdPath(path);
        const MotionRange& range = ofPaths.emplace_back(motionRange(start, end, first, last));
        EXPECT_EQ(range.lower, expected.lower) << path << ", " << first << " to " << last;
        EXPECT_EQ(range.upper, expected.upper) << path << ", " << first << " to " << last;
        EXPECT_EQ(range.count, expected.count);
        EXPECT_NEAR(range.squares, expected.squares, 1e-12 * expected.squares);
        EXPECT_LT((range.sum - expected.sum).norm(), 1e-12 * (1 + expected.squares));
        EXPECT_EQ(range.sum, ofPaths.front().sum) << path;
        EXPECT_EQ(range.squares, ofPaths.front().squares) << path;
      }
    }
  useSimdPath("");
}

}  // namespace
}  // namespace palpate::test
