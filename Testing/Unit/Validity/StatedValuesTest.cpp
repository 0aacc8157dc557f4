#include "Common/DegenerateCases.h"
#include "Common/PairRun.h"
#include "Common/TestGeometry.h"

#include <algorithm>
#include <array>
#include <limits>
#include <set>

// The numbers that Validity states about a step of two sheets, one above the other, of which the
// upper one moves.

namespace palpate {
namespace {

using namespace testing;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Expected {
  Method method;
  MethodReason reason;
  double displacementLimit, effectiveThickness;
};

/// A share of the upper sheet's vertices moves by `motion` along x.
Validity afterStep(const PairSettings& settings, double motion, double share = 1.0) {
  const Mesh high = flat(8, 1), low = flat(8, 0);
  PairRun run(settingsOf(Engine::Octree), high, low, settings, false);
  Positions now = high.positions;
  for (std::size_t v = 0; static_cast<double>(v) < share * static_cast<double>(now.size()); ++v)
    now[v].x() += motion;
  run.step(high.positions, now, low.positions, low.positions);
  return run.data().validity();
}

void expectStated(const Validity& found, double motion, const Expected& expected) {
  EXPECT_EQ(found.method, expected.method);
  EXPECT_EQ(found.reason, expected.reason);
  EXPECT_GE(found.displacement, motion);
  EXPECT_NEAR(found.displacement, motion, 1e-12);
  EXPECT_EQ(found.displacementLimit, expected.displacementLimit);
  EXPECT_GE(found.effectiveThickness, expected.effectiveThickness);
  EXPECT_NEAR(found.effectiveThickness, expected.effectiveThickness, 1e-5);  // the timeTolerance
  EXPECT_EQ(found.arcDeviation, 0.0);
}

TEST(StatedValues, OfRequestedMethodsAreTheirSettings) {
  constexpr MethodReason kRequested = MethodReason::Requested;
  for (const double motion : {0.0, 0.25}) {
    expectStated(afterStep({Method::Proximity, 0.5}, motion), motion,
                 {Method::Proximity, kRequested, 0.5, 0.5});
    expectStated(afterStep({Method::Continuous, 0.5}, motion), motion,
                 {Method::Continuous, kRequested, kInfinity, 0.5});
  }
}

TEST(StatedValues, OfAutoFollowFromTheMotionAndItsTolerance) {
  const auto expectAuto = [](double thickness, double tolerance, double motion, double share,
                             Method method, MethodReason reason, double more) {
    SCOPED_TRACE(::testing::Message() << thickness << " " << tolerance << " " << motion);
    PairSettings settings{Method::Auto, thickness};
    settings.automatic.motionTolerance = tolerance;
    expectStated(afterStep(settings, motion, share), motion,
                 {method, reason, tolerance < 0 ? thickness / 2 : tolerance,
                  method == Method::Intersection ? 0.0 : thickness + more});
  };
  using enum MethodReason;
  expectAuto(0.5, -1, 0, 1, Method::Proximity, Still, 0);
  expectAuto(0, -1, 0, 1, Method::Intersection, Still, 0);
  expectAuto(0, -1, 0.125, 1, Method::Continuous, Cheapest, 0);
  expectAuto(0.5, -1, 0.125, 1, Method::Proximity, Slow, 0.125);
  expectAuto(0.5, -1, 0.1875, 1, Method::Proximity, Slow, 0.1875);
  expectAuto(0.5, 0.375, 0.25, 0.3, Method::Proximity, Slow, 0.25);
  expectAuto(0.5, -1, 0.375, 1, Method::Continuous, Fast, 0);
  expectAuto(0.5, 0, 0.375, 1, Method::Continuous, Fast, 0);
  expectAuto(0.5, 0, 0.375, 0.3, Method::Auto, Mixed, 0);
  expectAuto(0.5, 0.25, 0.375, 0.3, Method::Auto, Mixed, 0.25);
  expectAuto(0.5, 0.25, 0.375, 0.6, Method::Continuous, Fast, 0);
}

/// A step in which sheets stay apart is trusted up to the smallest height of both.
TEST(StatedValues, OfIntersectionHaveTheSmallestHeightAsLimit) {
  const Mesh coarse = flat(2, 1), fine = flat(8, 0);
  const double height = 0.125 / std::sqrt(2.0);
  for (const bool isSwapped : {false, true})
    for (const double motion : {0.0, 0.5 * height, 2.0 * height}) {
      PairRun run(settingsOf(Engine::Octree), isSwapped ? fine : coarse, isSwapped ? coarse : fine,
                  {Method::Intersection}, false);
      Positions now = coarse.positions;
      for (Vector3d& p : now) p.x() += motion;
      run.detection().setPositions(isSwapped ? run.b() : run.a(), coarse.positions, now);
      run.detect();
      const Validity& found = run.data().validity();
      EXPECT_EQ(found.effectiveThickness, 0.0);
      EXPECT_NEAR(found.displacementLimit, height, 1e-12);
      EXPECT_EQ(found.trusted, motion < height);
    }
}

/// Every fifth triangle of two soups, in which no two share a vertex, has an edge without a length.
TEST(StatedValues, NameTheTrianglesWithoutAreaThatAreInContacts) {
  Random random(31);
  std::size_t named = 0;
  for (int i = 0; i < casesOf(40); ++i) {
    std::array<Mesh, 2> meshes{soup(random, 30, 0.2), soup(random, 30, 0.2)};
    for (Mesh& mesh : meshes)
      for (std::size_t v = 0; v < mesh.positions.size(); v += 15)
        mesh.positions[v + 1] = mesh.positions[v];
    PairRun run(settingsOf(Engine::Octree), meshes[0], meshes[1],
                {Method::Proximity, 0.05, Contacts::All}, false);
    run.detect();
    std::array<std::set<std::uint32_t>, 2> expected;
    const auto addTriangle = [&](std::size_t side, std::uint32_t triangle) {
      if (triangle % 5 == 0) expected[side].insert(triangle);
    };
    const auto addEdge = [&](std::size_t side, const Segment& edge) {
      const Positions& at = meshes[side].positions;
      if (at[edge[0]] == at[edge[1]]) expected[side].insert(edge[0] / 3);
    };
    for (const auto& c : run.data().vertexTriangle()) addTriangle(1, c.triangle);
    for (const auto& c : run.data().triangleVertex()) addTriangle(0, c.triangle);
    for (const auto& c : run.data().edgeEdge()) addEdge(0, c.edgeA), addEdge(1, c.edgeB);
    const Validity& found = run.data().validity();
    EXPECT_TRUE(std::ranges::equal(found.degenerateTrianglesA, expected[0]));
    EXPECT_TRUE(std::ranges::equal(found.degenerateTrianglesB, expected[1]));
    named += expected[0].size() + expected[1].size();
  }
  EXPECT_GE(named, leastOf(50));
}

}  // namespace
}  // namespace palpate
