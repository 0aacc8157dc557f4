#include "Common/PairRun.h"
#include "Common/DegenerateCases.h"

#include <gtest/gtest.h>

#include <cmath>

// Candidates at any position of the scene, as long as doubles resolve its features: no false
// negatives, and at most one in a hundred candidates whose exact boxes do not overlap.

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;

struct Counts {
  std::size_t truth = 0, found = 0;
};

Mesh shaken(Mesh mesh) {
  Random random(9);
  for (Vector3d& p : mesh.positions) p += randomPoint(random, -0.003, 0.003);
  return mesh;
}

/// Candidates of a frame in which both meshes have moved, and of each mesh with itself.
void count(const Mesh& a, const Mesh& b, const PairSettings& settings, const Vector3d& offset,
           Counts& counts) {
  const Mesh first = moved(a, offset), second = moved(b, offset);
  Random random(2);
  const auto before = [&](const Mesh& mesh) {
    std::vector<Vector3d> positions = mesh.positions;
    for (Vector3d& p : positions) p += randomPoint(random, -0.02, 0.02);
    return positions;
  };
  const std::vector<Vector3d> firstBefore = before(first), secondBefore = before(second);
  PairRun octree(settingsOf(Engine::Octree), first, second, settings),
      oracle(settingsOf(Engine::BruteForce), first, second, settings);
  for (PairRun* run : {&octree, &oracle}) {
    run->detection().setPositions(run->a(), firstBefore, first.positions);
    run->detection().setPositions(run->b(), secondBefore, second.positions);
  }
  for (const CollisionPair& pair : octree.detection().pairs()) {
    const auto found = octree.detection().candidatePairs(pair.a, pair.b),
               truth = oracle.detection().candidatePairs(pair.a, pair.b);
    EXPECT_TRUE(std::includes(found.begin(), found.end(), truth.begin(), truth.end()));
    EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
    counts.truth += truth.size();
    counts.found += found.size();
  }
}

class CandidateOffsets : public ::testing::TestWithParam<MethodCase> {};

TEST_P(CandidateOffsets, CandidatesAreCompleteAndFewAtEveryOffset) {
  Random random(1);
  const std::pair<Mesh, Mesh> scenes[]{
      {soup(random, 250, 0.05), soup(random, 200, 0.08)},
      // Not symmetric: boxes that touch but for a rounding error are candidates.
      {shaken(sphere(10, 14, {0.5, 0.5, 0.5}, 0.4)), shaken(sphere(9, 13, {0.6, 0.5, 0.9}, 0.3))},
      {sheet(12, 0, 0), sheet(11, 0.02, 1)}};
  // At 1e13 doubles are 0.002 apart, where edges are 0.05 to 0.1 long.
  for (int exponent = 0; exponent <= 13; ++exponent) {
    const double far = std::pow(10.0, exponent);
    for (const Vector3d& direction : {Vector3d(1, 1, 1), Vector3d(-1, 0, 0.3)}) {
      SCOPED_TRACE("1e" + std::to_string(exponent));
      Counts counts;
      for (const auto& [a, b] : scenes) count(a, b, GetParam().settings, far * direction, counts);
      EXPECT_GT(counts.truth, 2000u);
      EXPECT_LE(static_cast<double>(counts.found), 1.01 * static_cast<double>(counts.truth));
      RecordProperty(
          "more1e" + std::to_string(exponent),
          std::to_string(counts.found - counts.truth) + " of " + std::to_string(counts.truth));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, CandidateOffsets, ::testing::ValuesIn(methodCases(0.01)),
                         [](const auto& method) { return method.param.name; });

}  // namespace
}  // namespace palpate
