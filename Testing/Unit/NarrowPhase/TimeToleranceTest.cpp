#include "Common/PairRun.h"

#include <palpate/FeaturePairs.h>

#include <gtest/gtest.h>

namespace palpate {
namespace {

using testing::PairRun;
using testing::Random;
using Positions = std::vector<Eigen::Vector3d>;

struct Moving {
  testing::Mesh mesh;
  Positions now;
};

Moving movingSoup(Random& random) {
  Moving moving{testing::soup(random, 40, 0.3), {}};
  for (const Eigen::Vector3d& p : moving.mesh.positions)
    moving.now.push_back(p + testing::randomPoint(random, -0.4, 0.4));
  return moving;
}

PairRun runOf(const PairSettings& pair, const Moving& a, const Moving& b) {
  PairRun run({}, a.mesh, b.mesh, pair);
  run.step(a.mesh.positions, a.now, b.mesh.positions, b.now);
  return run;
}

double exactTime(const VertexTriangleContact& c, const Moving& vertex, const Moving& triangle) {
  const auto [i, j, k] = c.vertices;
  const Positions &v = vertex.mesh.positions, &t = triangle.mesh.positions;
  return *vertexTriangleTimeOfImpact(v[c.vertex], t[i], t[j], t[k], vertex.now[c.vertex],
                                     triangle.now[i], triangle.now[j], triangle.now[k],
                                     {.timeTolerance = 0x1p-50});
}
double exactTime(const EdgeEdgeContact& c, const Moving& a, const Moving& b) {
  const auto [i, j] = c.edgeA;
  const auto [k, l] = c.edgeB;
  const Positions &p = a.mesh.positions, &q = b.mesh.positions;
  return *edgeEdgeTimeOfImpact(p[i], p[j], q[k], q[l], a.now[i], a.now[j], b.now[k], b.now[l],
                               {.timeTolerance = 0x1p-50});
}

std::vector<std::array<std::uint32_t, 4>> idsOf(const CollisionData& data) {
  std::vector<std::array<std::uint32_t, 4>> ids;
  for (const auto& c : data.vertexTriangle()) ids.push_back({0, c.vertex, c.triangle});
  for (const auto& c : data.triangleVertex()) ids.push_back({1, c.vertex, c.triangle});
  for (const auto& c : data.edgeEdge())
    ids.push_back({c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]});
  return ids;
}

/// With any tolerance, the same features touch. Times are early by at most the tolerance, and not
/// late.
TEST(TimeTolerance, BoundsHowEarlyTimesAreAndChangesNothingElse) {
  Random random(5);
  const Moving a = movingSoup(random), b = movingSoup(random);
  const auto truth =
      idsOf(runOf({.method = Method::Continuous, .contacts = Contacts::All}, a, b).data());
  ASSERT_GT(truth.size(), 50u);
  for (const double tolerance : {0x1p-50, 1e-10, 1e-3, 0.25, 1.0}) {
    SCOPED_TRACE(tolerance);
    const PairSettings settings{.method = Method::Continuous,
                                .contacts = Contacts::All,
                                .continuous = {.timeTolerance = tolerance}};
    const PairRun run = runOf(settings, a, b);
    run.expectWellFormed(a.mesh, b.mesh);
    const CollisionData& data = run.data();
    EXPECT_EQ(idsOf(data), truth);
    double earliest = 1.0;
    const auto expectTime = [&](double time, double exact) {
      EXPECT_LE(time, exact + 0x1p-50);
      EXPECT_GE(time, exact - tolerance);
      earliest = std::min(earliest, time);
    };
    for (const auto& c : data.vertexTriangle()) expectTime(c.timeOfImpact, exactTime(c, a, b));
    for (const auto& c : data.triangleVertex()) expectTime(c.timeOfImpact, exactTime(c, b, a));
    for (const auto& c : data.edgeEdge()) expectTime(c.timeOfImpact, exactTime(c, a, b));
    PairSettings only = settings;
    only.continuous.earliestTimeOnly = true;
    EXPECT_EQ(runOf(only, a, b).data().earliestTimeOfImpact(), earliest);
  }
}

/// With a thickness: features that come within it are reported. Features that stay farther apart
/// than the thickness and the tolerance times the motion are not.
TEST(TimeTolerance, BoundsTimeAndDistanceWithAThickness) {
  Random random(7);
  const Moving a = movingSoup(random), b = movingSoup(random);
  const auto idsAt = [&](double tolerance, double thickness) {
    const PairSettings settings{.method = Method::Continuous,
                                .thickness = thickness,
                                .contacts = Contacts::All,
                                .continuous = {.timeTolerance = tolerance}};
    const PairRun run = runOf(settings, a, b);
    auto ids = idsOf(run.data());
    std::sort(ids.begin(), ids.end());
    return ids;
  };
  // No coordinate moves further than 0.4 in either mesh.
  const double tolerance = 0.02, thickness = 0.03, motion = 0.8 * std::sqrt(3.0);
  const auto fine = idsAt(0x1p-40, thickness), coarse = idsAt(tolerance, thickness),
             wider = idsAt(0x1p-40, thickness + tolerance * motion);
  EXPECT_GT(coarse.size(), fine.size());
  EXPECT_TRUE(std::includes(coarse.begin(), coarse.end(), fine.begin(), fine.end()));
  EXPECT_TRUE(std::includes(wider.begin(), wider.end(), coarse.begin(), coarse.end()));
}

}  // namespace
}  // namespace palpate
