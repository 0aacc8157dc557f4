#include "Mesh/Motion.h"

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
    range.add({moved, moved, false});
  }
  return range;
}

/// Eight vertices at a time and the rest one by one, in any part of a mesh.
TEST(Motion, RangeMatchesEachVertexOnEverySimdPath) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<Vector3d> before, now;
  for (int i = 0; i < 60; ++i) {
    before.push_back({normal(random), normal(random), normal(random)});
    const double size = std::exp(normal(random));
    now.push_back(before.back() + size * Vector3d(1, normal(random), -2));
  }
  for (const std::size_t first : {0, 3})
    for (std::size_t last = first; last <= before.size(); ++last) {
      const MotionRange expected = oneByOne(before, now, first, last);
      for (const std::string& path : simdPaths()) {
        useSimdPath(path);
        const MotionRange range = motionRange(std::span(before).subspan(first, last - first),
                                              std::span(now).subspan(first, last - first));
        EXPECT_EQ(range.lower, expected.lower) << path << ", " << first << " to " << last;
        EXPECT_EQ(range.upper, expected.upper) << path << ", " << first << " to " << last;
        EXPECT_EQ(range.isEmpty, expected.isEmpty);
      }
    }
  useSimdPath("");
}

TEST(Motion, FastShareIsAboutThatOfAllPairs) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  const auto mesh = [&](int vertices) {
    std::vector<Vector3d> before(vertices), now(vertices);
    for (std::vector<Vector3d>* list : {&before, &now})
      for (Vector3d& p : *list) p = {normal(random), normal(random) + 3, normal(random)};
    return TriangleMesh{MeshTopology(before.size(), {}), now, before};
  };
  const TriangleMesh a = mesh(300), b = mesh(70), many = mesh(20000);
  const auto share = [](const TriangleMesh& s, const TriangleMesh& t, double limit) {
    std::size_t fast = 0;
    for (std::size_t i = 0; i < s.now.size(); ++i)
      for (std::size_t j = 0; j < t.now.size(); ++j)
        fast += (s.now[i] - s.before[i] - t.now[j] + t.before[j]).norm() > limit;
    return static_cast<double>(fast) / static_cast<double>(s.now.size() * t.now.size());
  };
  for (const double limit : {1.0, 2.0, 3.0, 4.0}) {
    EXPECT_NEAR(fastShare(a, b, limit), share(a, b, limit), 0.06) << limit;
    EXPECT_NEAR(fastShare(many, b, limit), share(many, b, limit), 0.06) << limit;
  }
  EXPECT_EQ(fastShare(a, b, 100.0), 0.0);
  EXPECT_EQ(fastShare(a, b, 0.0), 1.0);
  EXPECT_EQ(fastShare(a, mesh(0), 1.0), 0.0);
}

}  // namespace
}  // namespace palpate::test
