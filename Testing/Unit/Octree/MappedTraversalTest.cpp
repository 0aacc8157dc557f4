#include "Octree/Traversal.h"

#include "BoxOctree.h"
#include "Common/EverySimdPath.h"
#include "Common/Sanitized.h"
#include "Common/TraversedPairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <vector>

// Traversals of two octrees in different frames, on every SIMD path, against all pairs of boxes or
// k-DOPs. Coordinates are multiples of 1/64, and rotations are exact, so that bounds touch often.

namespace palpate {
namespace {

using testing::Boxes;
using testing::BoxOctree;
using testing::Random;
using Point3 = std::array<double, 3>;
using Three = std::array<Point3, 3>;
using TurnRows = std::array<Point3, 3>;

/// Rotations by 0, 90 and 180 degrees about an axis, and about a diagonal.
constexpr TurnRows kRotations[] = {{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                                   {{{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}},
                                   {{{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}}},
                                   {{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}}};

Point3 imageOf(const TurnRows& rotation, const Point3& offset, const Point3& p) {
  Point3 image = offset;
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < 3; ++j) image[k] += rotation[k][j] * p[j];
  return image;
}

std::vector<Three> gridTriangles(Random& random, std::size_t count) {
  std::vector<Three> triangles(count);
  for (Three& corners : triangles) {
    Point3 start;
    for (double& x : start) x = static_cast<double>(random() % 64) / 64;
    for (Point3& corner : corners)
      for (std::size_t k = 0; k < 3; ++k)
        corner[k] = start[k] + static_cast<double>(random() % 12) / 64;
  }
  return triangles;
}

FloatBox boxOf(const Three& corners) {
  FloatBox box;
  for (const Point3& p : corners) {
    FloatBox point;
    for (std::size_t k = 0; k < 3; ++k) point.lower[k] = point.upper[k] = static_cast<float>(p[k]);
    box.add(point);
  }
  return box;
}

Boxes boxesOf(const std::vector<Three>& triangles) {
  Boxes boxes;
  for (const Three& corners : triangles) boxes.push_back(boxOf(corners));
  return boxes;
}

OctreeSettings smallLeaves() {
  OctreeSettings settings;
  settings.maxElementsPerLeaf = 3;
  return settings;
}

/// The pairs of a traversal, sorted; the same on every SIMD path.
std::vector<ElementPair> pairsOf(const TreePair& trees) {
  std::vector<std::vector<ElementPair>> found;
  for (const std::string& path : testing::EverySimdPath()) {
    found.push_back(testing::traversedPairs(trees));
    EXPECT_EQ(found.back(), found.front()) << path;
  }
  return found.front();
}

template <class Overlaps>
std::vector<ElementPair> expectedPairs(std::size_t countA, std::size_t countB, Overlaps overlaps) {
  std::vector<ElementPair> pairs;
  for (std::uint32_t a = 0; a < countA; ++a)
    for (std::uint32_t b = 0; b < countB; ++b)
      if (overlaps(a, b)) pairs.push_back({a, b});
  return pairs;
}

Point3 gridPoint(Random& random) {
  Point3 p;
  for (double& x : p) x = (static_cast<double>(random() % 129) - 64) / 64;
  return p;
}

TEST(MappedTraversal, FindsThePairsWhoseMappedBoxesOverlap) {
  Random random(81);
  std::size_t pairs = 0;
  for (int run = 0; run < testing::casesOf(24); ++run) {
    const Boxes first = boxesOf(gridTriangles(random, 120)),
                second = boxesOf(gridTriangles(random, 90));
    BoxOctree a, b;
    a.build(first, smallLeaves(), Threads(1));
    b.build(second, smallLeaves(), Threads(1));
    TreePair trees{&a.octree, &b.octree};
    BoxMap* const maps[] = {&trees.mapA, &trees.mapB};
    for (std::size_t side = 0; side < 2; ++side) {
      maps[side]->count = side == 0 ? run % 3 : run / 3 % 3;
      for (int end = 0; end < maps[side]->count; ++end) {
        const auto& rotation = kRotations[random() % 4];
        setEnd(maps[side]->ends[static_cast<std::size_t>(end)], rotation, gridPoint(random),
               run % 4 == 0 ? 0.03125 : 0.0, 0.0);
      }
    }
    if (trees.mapA.count == 0 && trees.mapB.count == 0) continue;
    ASSERT_TRUE(trees.isMapped());
    if (trees.mapA.count == 0) setShift(trees, gridPoint(random), 0.03125);
    const auto placedA = [&](std::uint32_t i) {
      FloatBox box = trees.mapA(first[i]);
      for (std::size_t k = 0; k < 3 && trees.mapA.count == 0; ++k) {
        box.lower[k] += trees.shiftLower[k];
        box.upper[k] += trees.shiftUpper[k];
      }
      return box;
    };
    const auto expected = expectedPairs(120, 90, [&](std::uint32_t i, std::uint32_t j) {
      return placedA(i).overlaps(trees.mapB(second[j]));
    });
    EXPECT_EQ(pairsOf(trees), expected) << run;
    pairs += expected.size();
  }
  EXPECT_GE(pairs, testing::leastOf(2000));
}

/// Boxes that were clamped to the range of float may reach anywhere beyond it.
TEST(MappedTraversal, ClampedBoxesOverlapWhatIsBeyondTheRange) {
  Random random(82);
  std::vector<Boxes> both;
  for (const std::size_t count : {200u, 150u}) {
    Boxes boxes = boxesOf(gridTriangles(random, count));
    for (std::size_t i = 0; i < count; i += 3) {
      const std::size_t axis = random() % 3;
      const bool isLow = random() % 2, isBeyond = random() % 2;
      if (isLow || isBeyond) boxes[i].lower[axis] = isLow ? -kLargestFloat : kLargestFloat;
      if (!isLow || isBeyond) boxes[i].upper[axis] = isLow ? -kLargestFloat : kLargestFloat;
    }
    both.push_back(boxes);
  }
  BoxOctree a, b;
  a.build(both[0], smallLeaves(), Threads(1));
  b.build(both[1], smallLeaves(), Threads(1));
  TreePair trees{&a.octree, &b.octree};
  trees.isClamped = true;
  // A shift by a large part of the range moves clamped bounds away from each other.
  setShift(trees, {0x1p118, 0, 0}, 0.0);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto reach = [](const FloatBox& box, std::size_t k) -> std::array<double, 2> {
    return {box.lower[k] <= -kLargestFloat ? -kInfinity : double{box.lower[k]},
            box.upper[k] >= kLargestFloat ? kInfinity : double{box.upper[k]}};
  };
  const auto expected = expectedPairs(200, 150, [&](std::uint32_t i, std::uint32_t j) {
    bool all = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [lowA, highA] = reach(both[0][i], k);
      const auto [lowB, highB] = reach(both[1][j], k);
      const double shift = k == 0 ? 0x1p118 : 0.0;
      all = all && lowA + shift <= highB && highA + shift >= lowB;
    }
    return all;
  });
  EXPECT_EQ(pairsOf(trees), expected);
  EXPECT_GT(expected.size(), 10u);
}

std::array<double, 2> extentAlong(const DopDirection& direction, const Three& corners) {
  std::array<double, 2> extent{1e9, -1e9};
  for (const Point3& p : corners) {
    const double at = direction[0] * p[0] + direction[1] * p[1] + direction[2] * p[2];
    extent = {std::min(extent[0], at), std::max(extent[1], at)};
  }
  return extent;
}

/// An octree of triangles with k-DOPs.
void buildWithDops(BoxOctree& tree, const std::vector<Three>& triangles, int count) {
  tree.build(boxesOf(triangles), smallLeaves(), Threads(1));
  OctreeDops& dops = tree.octree.startDops(count);
  for (std::size_t i = 0; i < triangles.size(); ++i)
    for (int k = 3; k < count; ++k) {
      const auto [lower, upper] = extentAlong(dopDirections(count)[static_cast<std::size_t>(k)],
                                              triangles[tree.octree.order()[i]]);
      dops.lower[static_cast<std::size_t>(k)][i] = static_cast<float>(lower);
      dops.upper[static_cast<std::size_t>(k)][i] = static_cast<float>(upper);
    }
  tree.octree.fitDops(count);
}

/// The exact rotations map the directions of the 14-DOP onto each other, so that k-DOPs overlap
/// where those of the turned triangles do; the same for the 18-DOP.
TEST(MappedTraversal, FindsThePairsWhoseDopsOverlap) {
  Random random(83);
  std::size_t pairs = 0, ofBoxes = 0;
  for (int run = 0; run < testing::casesOf(32); ++run) {
    const int count = run % 2 ? 9 : 7;
    const TurnRows& rotation = kRotations[run / 2 % 4];
    const std::vector<Three> first = gridTriangles(random, 120), second = gridTriangles(random, 90);
    BoxOctree a, b;
    buildWithDops(a, first, count);
    buildWithDops(b, second, count);
    TreePair trees{&a.octree, &b.octree};
    std::vector<Point3> offsets;
    for (int end = 0; end <= run / 8 % 2; ++end) offsets.push_back(gridPoint(random));
    trees.dops.directions = count;
    trees.dops.count = trees.mapA.count = static_cast<int>(offsets.size());
    for (std::size_t end = 0; end < offsets.size(); ++end) {
      setEnd(trees.dops.ends[end], a.octree.dops(), rotation, offsets[end], 0.0, 0.0);
      setEnd(trees.mapA.ends[end], rotation, offsets[end], 0.0, 0.0);
    }
    trees.swapped = run / 16 % 2;
    const auto overlapAlong = [&](const DopDirection& d, std::uint32_t i, std::uint32_t j) {
      std::array<double, 2> ofA{1e9, -1e9};
      for (const Point3& offset : offsets) {
        Three turned = first[i];
        for (Point3& p : turned) p = imageOf(rotation, offset, p);
        const auto [lower, upper] = extentAlong(d, turned);
        ofA = {std::min(ofA[0], lower), std::max(ofA[1], upper)};
      }
      const auto ofB = extentAlong(d, second[j]);
      return ofA[0] <= ofB[1] && ofA[1] >= ofB[0];
    };
    const auto overlap = [&](std::uint32_t i, std::uint32_t j, int directions) {
      const auto all = dopDirections(count).first(static_cast<std::size_t>(directions));
      return std::ranges::all_of(all, [&](const auto& d) { return overlapAlong(d, i, j); });
    };
    std::vector<ElementPair> expected = expectedPairs(
        120, 90, [&](std::uint32_t i, std::uint32_t j) { return overlap(i, j, count); });
    if (trees.swapped)
      for (ElementPair& pair : expected) std::swap(pair.a, pair.b);
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(pairsOf(trees), expected) << run;
    pairs += expected.size();
    ofBoxes += expectedPairs(120, 90, [&](std::uint32_t i, std::uint32_t j) {
                 return overlap(i, j, 3);
               }).size();
  }
  EXPECT_GE(pairs, testing::leastOf(2000));
  EXPECT_GT(ofBoxes, pairs + pairs / 20);
}

}  // namespace
}  // namespace palpate
