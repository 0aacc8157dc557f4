#include "Common/DegenerateCases.h"
#include "Common/PairRun.h"

#include <map>
#include <utility>

namespace palpate::testing {
namespace {

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
void compare(const Mesh& a, const Mesh& b, const PairSettings& pair,
             const Settings& settings = settingsOf(Engine::Octree),
             const Eigen::Vector3d& offset = {0, 0, 0}, double scale = 1, int frames = 4) {
  OctreeBasedCD octree(settings), oracle(settingsOf(Engine::BruteForce));
  const Mesh first = moved(a, offset * scale, scale), second = moved(b, offset * scale, scale);
  PairSettings scaled = pair;
  scaled.thickness *= scale;
  const GeometryId idA{0}, idB{1};
  for (OctreeBasedCD* each : {&octree, &oracle}) {
    addMesh(*each, first), addMesh(*each, second);
    each->addCollisionPair(idA, idB, scaled);
    each->addCollisionPair(idA, idA, scaled);
  }
  Random random(7);
  std::vector<Eigen::Vector3d> now = first.positions;
  for (int frame = 0; frame < frames; ++frame) {
    for (Eigen::Vector3d& p : now) p += randomPoint(random, -0.01 * scale, 0.02 * scale);
    for (OctreeBasedCD* each : {&octree, &oracle}) {
      each->advance();
      each->setPositions(idA, now);
    }
    octree.update();
    EXPECT_EQ(octree.octree().validate(), std::vector<std::string>{});
    for (const GeometryId other : {idA, idB})
      expectComplete(octree.candidatePairs(idA, other), oracle.candidatePairs(idA, other));
    expectSameInBatches(octree, {{idA, idB}, {idA, idA}});
  }
}

const PairSettings kNearby{.thickness = 0.01};

TEST(Candidates, MatchBruteForceOnSoups) {
  Random random(1);
  for (const double size : {0.003, 0.05, 0.5}) {
    const Mesh a = soup(random, 400, size), b = soup(random, 300, size * 2);
    for (const Settings& settings : octreeSettings()) compare(a, b, kNearby, settings);
  }
}

/// As long as doubles resolve the features: at 1e13 they are 0.002 apart, where edges are 0.05 to
/// 0.1 long.
TEST(Candidates, AreCompleteAndFewAtEveryOffset) {
  Random random(1);
  const auto shaken = [](Mesh mesh) {  // boxes that touch but for a rounding error are candidates
    Random by(9);
    for (Eigen::Vector3d& p : mesh.positions) p += randomPoint(by, -0.003, 0.003);
    return mesh;
  };
  const std::pair<Mesh, Mesh> scenes[]{
      {soup(random, 250, 0.05), soup(random, 200, 0.08)},
      {shaken(sphere(10, 14, {0.5, 0.5, 0.5}, 0.4)), shaken(sphere(9, 13, {0.6, 0.5, 0.9}, 0.3))},
      {sheet(12, 0, 0), sheet(11, 0.02, 1)}};
  std::size_t number = 0;
  for (const MethodCase& method : methodCases(0.01))
    for (int exponent = 0; exponent <= 13; ++exponent)
      for (const Eigen::Vector3d& direction : {Eigen::Vector3d(1, 1, 1), {-1, 0, 0.3}})
        for (const auto& [a, b] : scenes) {
          if (isLeftOut(number++)) continue;
          SCOPED_TRACE(method.name + " at 1e" + std::to_string(exponent));
          compare(a, b, method.settings, settingsOf(Engine::Octree),
                  std::pow(10.0, exponent) * direction, 1, 1);
        }
}

TEST(Candidates, DoNotDependOnTheScaleOfTheScene) {
  Random random(3);
  const Mesh a = soup(random, 300, 0.05), b = soup(random, 300, 0.05);
  for (const double scale : {1e-300, 1e-3, 1e3, 1e293})
    compare(a, b, kNearby, settingsOf(Engine::Octree), {1e6, -1e6, 1e6}, scale);
}

const Settings kRebuilt = settingsOf(Engine::Octree, 1, OctreeUpdate::Rebuild);

/// One triangle is far away; then, beyond the range of floats, one of each mesh at the same place,
/// in different frames.
TEST(Candidates, MatchBruteForceWithTrianglesFarAway) {
  Random random(4);
  Mesh a = soup(random, 500, 0.03), b = soup(random, 500, 0.03);
  for (const double far : {1e3, 1e6, 1e12, 1e100}) {
    a.positions[0] = {far, -far, far};
    compare(a, b, kNearby, kRebuilt);
  }
  for (Eigen::Vector3d& p : b.positions) p += Eigen::Vector3d(3e30, -2e33, 1e36);
  for (const double far : {1e37, 1e60, 1e200, 1e300})
    for (const Eigen::Vector3d& sign : {Eigen::Vector3d(1, -1, 1), Eigen::Vector3d(-1, 1, 0)}) {
      for (std::size_t i = 0; i < 3; ++i)
        a.positions[i] = b.positions[i] = (1.0 - 0.01 * static_cast<double>(i)) * far * sign;
      compare(a, b, kNearby, kRebuilt);
    }
}

TEST(Candidates, MatchBruteForceOnIdenticalPoints) {
  Mesh a;
  a.positions.assign(60, Eigen::Vector3d(1, 2, 3));
  for (std::uint32_t t = 0; t < 20; ++t) a.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  compare(a, a, {}, kRebuilt);
}

}  // namespace
}  // namespace palpate::testing
