#include "Mesh/Motion.h"

#include "Common/EverySimdPath.h"
#include "Common/RandomMeshes.h"
#include "Mesh/PieceMotion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
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
      for (const std::string& path : testing::EverySimdPath()) {
        const MotionRange range = motionRange(std::span(before).subspan(first, last - first),
                                              std::span(now).subspan(first, last - first));
        EXPECT_EQ(range.lower, expected.lower) << path << ", " << first << " to " << last;
        EXPECT_EQ(range.upper, expected.upper) << path << ", " << first << " to " << last;
        EXPECT_EQ(range.isEmpty, expected.isEmpty);
      }
    }
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

// ---- Pieces ----

Positions positionsOf(const std::vector<Vector3d>& world, Revision::Counter& counter) {
  Positions positions;
  positions.setBody(std::make_shared<const CountedVector<Vector3d>>(world.begin(), world.end()),
                    counter.next());
  return positions;
}

TEST(PieceMotion, RangesHoldTheDisplacementsOfTheirVertices) {
  testing::Random random(3);
  Revision::Counter counter;
  for (const std::size_t size : {1u, 127u, 128u, 129u, 1000u}) {
    std::vector<Vector3d> before(size);
    for (Vector3d& p : before) p = testing::randomPoint(random, -1, 1);
    std::vector<Vector3d> now = before;
    for (std::size_t v = 0; v < std::min<std::size_t>(size, 130); ++v)
      now[v] += testing::randomPoint(random, -0.1, 0.1);
    PieceMotion motion;
    const Positions from = positionsOf(before, counter), to = positionsOf(now, counter);
    motion.advanceTo(from);  // without earlier positions
    for (const MotionRange& range : motion.ranges()) EXPECT_TRUE(range.isZero());
    motion.advanceTo(to);
    EXPECT_EQ(motion.from(), from.bodyRevision());
    EXPECT_EQ(motion.to(), to.bodyRevision());
    ASSERT_EQ(motion.ranges().size(), PieceMotion::pieceCount(size));
    for (std::size_t v = 0; v < size; ++v) {
      const MotionRange& range = motion.ranges()[v / PieceMotion::kPiece];
      const Vector3d moved = now[v] - before[v];
      EXPECT_TRUE((range.lower.array() <= moved.array()).all());
      EXPECT_TRUE((range.upper.array() >= moved.array()).all());
    }
    for (std::size_t piece = 2; piece < motion.ranges().size(); ++piece)
      EXPECT_TRUE(motion.ranges()[piece].isZero());
    motion.advanceTo(to);
    for (const MotionRange& range : motion.ranges()) EXPECT_TRUE(range.isZero());
  }
}

TEST(PieceMotion, PiecesOfRangesOfElements) {
  testing::Random random(4);
  std::vector<Triangle> elements(200);
  for (Triangle& t : elements)
    for (std::uint32_t& v : t) v = static_cast<std::uint32_t>(random() % 1000);
  const std::vector<std::pair<std::uint32_t, std::uint32_t>> ranges{
      {0, 3}, {50, 50}, {3, 90}, {10, 200}};
  const IndexLists pieces = piecesOf(elements, ranges, 1000);
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    std::set<std::uint32_t> expected;
    for (std::uint32_t e = ranges[i].first; e < ranges[i].second; ++e)
      for (const std::uint32_t v : elements[e]) expected.insert(v / 128);
    EXPECT_EQ(std::multiset<std::uint32_t>(pieces[i].begin(), pieces[i].end()),
              std::multiset<std::uint32_t>(expected.begin(), expected.end()));
  }
}

}  // namespace
}  // namespace palpate::test
