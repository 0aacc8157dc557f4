#include <palpate/OctreeBasedCD.h>

#include "Common/PairRun.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <vector>

namespace palpate {
namespace {

using testing::Mesh;
using testing::Random;

/// Compares with exact boxes in double: no false negatives, and false positives by outward rounding
/// only.
void expectComplete(std::span<const ElementPair> found, std::span<const ElementPair> truth) {
  EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
  EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
  EXPECT_TRUE(std::includes(found.begin(), found.end(), truth.begin(), truth.end()));
  EXPECT_LE(found.size(), truth.size() + truth.size() / 100 + 2);
}

/// forEachCandidate(), of one pair and of all, gives the pairs of candidatePairs().
void expectSameInBatches(OctreeBasedCD& octree,
                         const std::vector<std::array<GeometryId, 2>>& pairs) {
  std::map<std::pair<GeometryId, GeometryId>, std::vector<ElementPair>> ofAll;
  octree.forEachCandidate([&](const CollisionPair& pair, std::span<const ElementPair> batch) {
    auto& own = ofAll[{pair.a, pair.b}];
    own.insert(own.end(), batch.begin(), batch.end());
  });
  for (const auto& [a, b] : pairs) {
    std::vector<ElementPair> own;
    octree.forEachCandidate(a, b, [&](std::span<const ElementPair> batch) {
      own.insert(own.end(), batch.begin(), batch.end());
    });
    const auto expected = octree.candidatePairs(a, b);
    for (std::vector<ElementPair>* found : {&own, &ofAll[{a, b}]}) {
      std::sort(found->begin(), found->end());
      EXPECT_TRUE(std::equal(found->begin(), found->end(), expected.begin(), expected.end()));
    }
  }
  EXPECT_EQ(ofAll.size(), pairs.size());
}

/// Compares the octree's candidates of a and b, and of a with itself, with brute force, over frames
/// in which both move.
void compare(const Mesh& a, const Mesh& b, double thickness, const Eigen::Vector3d& offset,
             double scale, int threads, OctreeUpdate update) {
  OctreeBasedCD octree(testing::settingsOf(Engine::Octree, threads, update)),
      oracle(testing::settingsOf(Engine::BruteForce, 1, update));
  Mesh first = a, second = b;
  const auto place = [&](Eigen::Vector3d& p) { p = p * scale + offset * scale; };
  std::for_each(first.positions.begin(), first.positions.end(), place);
  std::for_each(second.positions.begin(), second.positions.end(), place);
  GeometryId ids[2][2];
  OctreeBasedCD* engines[] = {&octree, &oracle};
  for (int e = 0; e < 2; ++e) {
    ids[e][0] = engines[e]->addTriangleMesh(first.positions, first.triangles);
    ids[e][1] = engines[e]->addTriangleMesh(second.positions, second.triangles);
    engines[e]->addCollisionPair(ids[e][0], ids[e][1], {.thickness = thickness * scale});
    engines[e]->addCollisionPair(ids[e][0], ids[e][0], {.thickness = thickness * scale});
  }
  Random random(7);
  for (int frame = 0; frame < 4; ++frame) {
    octree.update();
    EXPECT_EQ(octree.octree().validate(), std::vector<std::string>{});
    expectComplete(octree.candidatePairs(ids[0][0], ids[0][1]),
                   oracle.candidatePairs(ids[1][0], ids[1][1]));
    expectSameInBatches(octree, {{ids[0][0], ids[0][1]}, {ids[0][0], ids[0][0]}});
    expectComplete(octree.candidatePairs(ids[0][0], ids[0][0]),
                   oracle.candidatePairs(ids[1][0], ids[1][0]));
    for (Eigen::Vector3d& p : first.positions)
      p += testing::randomPoint(random, -0.01 * scale, 0.02 * scale);
    for (OctreeBasedCD* engine : engines) engine->advance();
    for (int e = 0; e < 2; ++e) engines[e]->setPositions(ids[e][0], first.positions);
  }
}

TEST(Candidates, MatchBruteForceOnSoups) {
  Random random(1);
  for (const double size : {0.003, 0.05, 0.5}) {
    const Mesh a = testing::soup(random, 400, size), b = testing::soup(random, 300, size * 2);
    for (const int threads : {1, 2, 8})
      for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild})
        compare(a, b, 0.01, {0, 0, 0}, 1, threads, update);
  }
}

TEST(Candidates, DoNotDependOnPositionAndScaleOfTheScene) {
  Random random(3);
  const Mesh a = testing::soup(random, 300, 0.05), b = testing::soup(random, 300, 0.05);
  for (const double offset : {0.0, 1e3, 1e6})
    for (const double scale : {1e-300, 1e-3, 1.0, 1e3, 1e293})
      compare(a, b, 0.01, {offset, -offset, offset}, scale, 1, OctreeUpdate::Auto);
}

TEST(Candidates, MatchBruteForceWithOneTriangleFarAway) {
  Random random(4);
  Mesh a = testing::soup(random, 500, 0.03);
  const Mesh b = testing::soup(random, 500, 0.03);
  for (const double far : {1e3, 1e6, 1e12, 1e100}) {
    a.positions[0] = {far, -far, far};
    compare(a, b, 0.01, {0, 0, 0}, 1, 1, OctreeUpdate::Rebuild);
  }
}

/// Beyond the range of floats, both meshes have a triangle at the same place, in different frames.
TEST(Candidates, MatchBruteForceWithOneTriangleOfBothFarAway) {
  Random random(5);
  Mesh a = testing::soup(random, 100, 0.03), b = testing::soup(random, 100, 0.03);
  for (Eigen::Vector3d& p : b.positions) p += Eigen::Vector3d(3e30, -2e33, 1e36);
  for (const double far : {1e37, 1e60, 1e200, 1e300})
    for (const Eigen::Vector3d& sign : {Eigen::Vector3d(1, -1, 1), Eigen::Vector3d(-1, 1, 0)}) {
      for (std::size_t i = 0; i < 3; ++i)
        a.positions[a.triangles[0][i]] = b.positions[b.triangles[0][i]] =
            (1.0 - 0.01 * static_cast<double>(i)) * far * sign;
      compare(a, b, 0.01, {0, 0, 0}, 1, 1, OctreeUpdate::Rebuild);
    }
}

TEST(Candidates, MatchBruteForceOnIdenticalPoints) {
  Mesh a;
  a.positions.assign(60, Eigen::Vector3d(1, 2, 3));
  for (std::uint32_t t = 0; t < 20; ++t) a.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  compare(a, a, 0.0, {0, 0, 0}, 1, 1, OctreeUpdate::Rebuild);
}

}  // namespace
}  // namespace palpate
