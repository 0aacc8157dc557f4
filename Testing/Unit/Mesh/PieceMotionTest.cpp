#include "Mesh/PieceMotion.h"

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <set>

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;

Positions positionsOf(const std::vector<Vector3d>& world, Revision::Counter& counter) {
  Positions positions;
  positions.setBody(std::make_shared<const CountedVector<Vector3d>>(world.begin(), world.end()),
                    counter.next());
  return positions;
}

TEST(PieceMotion, RangesHoldTheDisplacementsOfTheirVertices) {
  Random random(3);
  Revision::Counter counter;
  for (const std::size_t size : {1u, 127u, 128u, 129u, 1000u}) {
    std::vector<Vector3d> before(size);
    for (Vector3d& p : before) p = randomPoint(random, -1, 1);
    std::vector<Vector3d> now = before;
    for (std::size_t v = 0; v < std::min<std::size_t>(size, 130); ++v)
      now[v] += randomPoint(random, -0.1, 0.1);
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
  Random random(4);
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
}  // namespace palpate
