#include "Diagnostics/ContactsByBruteForce.h"
#include "Math/MotionBound.h"
#include "Mesh/RestDistance.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/StepCheck.h"

#include "Common/ContactRows.h"
#include "Common/RandomMeshes.h"
#include "Mesh/FloatPositions.h"
#include "PublishedFrames.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {
namespace {

using Eigen::Vector3d;
constexpr double kUnbounded = std::numeric_limits<double>::infinity();

TriangleMesh meshOf(const std::vector<Vector3d>& before, const std::vector<Vector3d>& now,
                    const std::vector<Triangle>& triangles) {
  return {MeshTopology(now.size(), triangles), now, before};
}

/// A soup in which each vertex has its own motion, in grid steps if `grid` is positive.
TriangleMesh movingSoup(testing::Random& random, std::size_t triangles, double size, double grid) {
  testing::Mesh mesh = testing::soup(random, triangles, size);
  // Some share vertices, so that triangles are neighbours too.
  for (std::size_t t = 1; t < mesh.triangles.size(); t += 2)
    mesh.triangles[t][0] = mesh.triangles[t - 1][random() % 3];
  std::vector<Vector3d> now = mesh.positions;
  for (Vector3d& p : now) p += testing::randomPoint(random, -0.3, 0.3);
  if (grid > 0)
    for (auto* positions : {&mesh.positions, &now})
      for (Vector3d& p : *positions) p = (p / grid).array().round() * grid;
  return meshOf(mesh.positions, now, mesh.triangles);
}

std::vector<ElementPair> everyPair(const TriangleMesh& a, const TriangleMesh& b) {
  std::vector<ElementPair> pairs;
  for (std::uint32_t i = 0; i < a.topology.elements.size(); ++i)
    for (std::uint32_t j = &a == &b ? i + 1 : 0; j < b.topology.elements.size(); ++j)
      pairs.push_back({i, j});
  return pairs;
}

double earliestOf(const ContactBuffers& contacts) {
  double earliest = kUnbounded;
  for (const auto* list : {&contacts.vertexTriangle, &contacts.triangleVertex})
    for (const auto& contact : *list) earliest = std::min(earliest, contact.timeOfImpact);
  for (const auto& contact : contacts.edgeEdge) earliest = std::min(earliest, contact.timeOfImpact);
  return earliest;
}

void expectSame(const ContactBuffers& found, const ContactBuffers& expected) {
  EXPECT_EQ(found.featurePairs, expected.featurePairs);
  const auto expectSameSet = [](const auto& l, const auto& r) {
    EXPECT_EQ(testing::firstDifference(testing::sortedRows(l), testing::sortedRows(r)), "");
  };
  expectSameSet(found.vertexTriangle, expected.vertexTriangle);
  expectSameSet(found.triangleVertex, expected.triangleVertex);
  expectSameSet(found.edgeEdge, expected.edgeEdge);
}

std::vector<FloatPoint> floatsOf(const Positions& positions) {
  std::vector<FloatPoint> floats(positions.size());
  toFloats(positions.body(), {}, floats.data());
  return floats;
}

void expectSameAsBruteForce(MeshPair pair) {
  ContactBuffers found{}, boxed{}, expected{}, counts{};
  const std::vector<ElementPair> candidates = everyPair(pair.a, pair.b);
  findContactsByBruteForce(pair, expected);
  EXPECT_GT(expected.vertexTriangle.size(), 0u);
  EXPECT_GT(expected.edgeEdge.size(), 0u);
  findContinuous(pair, candidates, found);
  expectSame(found, expected);
  EXPECT_EQ(findEarliestImpact(pair, candidates, kUnbounded, counts), earliestOf(expected));
  EXPECT_EQ(findEarliestImpact(pair, candidates, 0.0, counts), 0.0);

  // With boxes over the step, inflated outward.
  const auto nowA = floatsOf(pair.a.now), beforeA = floatsOf(pair.a.before),
             nowB = floatsOf(pair.b.now), beforeB = floatsOf(pair.b.before);
  const float shift = std::nextafter(static_cast<float>(pair.settings.thickness), 1.0f);
  const FloatPair floats{nowA.data(),
                         nowB.data(),
                         beforeA.data(),
                         beforeB.data(),
                         {-shift, -shift, -shift, 0},
                         {shift, shift, shift, 0}};
  pair.floats = &floats;
  findContinuous(pair, candidates, boxed);
  expectSame(boxed, expected);
  EXPECT_LT(boxed.features.vertexTriangle.size() + boxed.features.edgeEdge.size(),
            found.features.vertexTriangle.size() + found.features.edgeEdge.size());
  EXPECT_EQ(findEarliestImpact(pair, candidates, kUnbounded, counts), earliestOf(expected));
}

TEST(Continuous, MatchesBruteForce) {
  testing::Random random(1);
  for (int i = 0; i < 12; ++i) {
    const double grid = i % 3 == 0 ? 0.25 : 0.0, thickness = i % 4 == 3 ? 0.02 : 0.0;
    const TriangleMesh a = movingSoup(random, 24, 0.3, grid), b = movingSoup(random, 17, 0.4, grid);
    SCOPED_TRACE(i);
    expectSameAsBruteForce({a, b, {Method::Continuous, thickness, Contacts::All}});
    expectSameAsBruteForce({a, a, {Method::Continuous, thickness, Contacts::All}});
  }
}

/// What the rest of the step may leave of the distance at an impact.
template <ImpactQuery::Kind kind>
double leftOf(const Features<kind>& features, std::uint32_t first, std::uint32_t second,
              double time, double distance, const StepPlan& step) {
  const double rounding = step.motionWithRounding - step.motion,
               most = (1.0 - time) * step.motion + rounding,
               own = (1.0 - time) * motionBound<kind>(features.query(first, second)) + rounding;
  return std::max(0.0, distance - (distance <= most ? own : most));
}

/// The clearance from its definition, of all contacts that were found.
double clearanceOf(const MeshPair& pair, const ContactBuffers& found) {
  using Kind = ImpactQuery::Kind;
  double least = kUnbounded;
  const auto add = [&](const auto& features, std::uint32_t first, std::uint32_t second,
                       const auto& contact) {
    least = std::min(
        least, leftOf(features, first, second, contact.timeOfImpact, contact.distance, pair.step));
  };
  for (const auto& c : found.vertexTriangle)
    add(Features<Kind::VertexTriangle>{pair.a, pair.b}, c.vertex, c.triangle, c);
  for (const auto& c : found.triangleVertex)
    add(Features<Kind::VertexTriangle>{pair.b, pair.a}, c.vertex, c.triangle, c);
  for (const auto& c : found.edgeEdge)
    add(Features<Kind::EdgeEdge>{pair.a, pair.b}, pair.a.topology.edgeOf(c.edgeA),
        pair.b.topology.edgeOf(c.edgeB), c);
  return least;
}

/// Features that are near at rest are no contacts, but count for the clearance.
TEST(Continuous, ClearanceIsThatOfAllImpactsWhetherFilteredOrNot) {
  testing::Random random(5);
  int positive = 0, zero = 0, filtered = 0;
  for (int i = 0; i < 60; ++i) {
    TriangleMesh mesh = movingSoup(random, 20, 0.3, 0.0);
    const double speed = std::exp2(testing::uniform(random, -12, 0)), thickness = 0.1;
    std::vector<Vector3d> now(mesh.before.size());
    double motion = 0.0;
    for (std::uint32_t v = 0; v < now.size(); ++v) {
      now[v] = mesh.before[v] + speed * (mesh.now[v] - mesh.before[v]);
      motion = std::max(motion, 2.0 * (now[v] - mesh.before[v]).norm());
    }
    mesh.now = now;
    MeshPair pair{mesh, mesh, {Method::Continuous, thickness, Contacts::All}};
    pair.step.motion = motion;
    pair.step.motionWithRounding = motion * (1.0 + 1e-12);
    ContactBuffers all{}, some{};
    findContinuous(pair, everyPair(mesh, mesh), all);
    const double clearance = clearanceOf(pair, all);
    EXPECT_EQ(all.facts.clearance, clearance) << i;
    const IndexLists near = verticesWithin(mesh.topology, mesh.before.body(), 0.4, Threads(1));
    pair.nearAtRest = &near;
    findContinuous(pair, everyPair(mesh, mesh), some);
    EXPECT_EQ(some.facts.clearance, clearance) << i;
    positive += clearance > 0.0 && clearance < kUnbounded;
    zero += clearance == 0.0;
    filtered += some.edgeEdge.size() < all.edgeEdge.size();
  }
  EXPECT_GT(positive, 5);
  EXPECT_GT(zero, 5);
  EXPECT_GT(filtered, 20);
}

/// A vertex passes through a triangle. The triangle's corner is known to have been touched; the
/// vertex is not.
TEST(Continuous, ContactsBesideATouchAreReplacedByTheirImpacts) {
  const std::vector<Vector3d> ground{{-4, -4, 0}, {4, -4, 0}, {0, 4, 0}};
  const TriangleMesh a = meshOf({{0, 0, 1}, {1, 0, 3}, {0, 1, 3}},
                                {{0, 0, -0.25}, {1, 0, 2}, {0, 1, 2}}, {{0, 1, 2}}),
                     b = meshOf(ground, ground, {{0, 1, 2}});
  const VertexTriangleContact atEnd{.vertex = 0,
                                    .triangle = 0,
                                    .vertices = {0, 1, 2},
                                    .weights = {0.25, 0.25, 0.5},
                                    .normal = {0, 0, -1},
                                    .distance = 0.25,
                                    .timeOfImpact = 1.0};
  for (const bool swapped : {false, true})
    for (const bool ofVertex : {false, true})
      for (const bool ofCorner : {false, true}) {
        const MeshPair pair{swapped ? b : a, swapped ? a : b, {Method::Auto, 0.5}};
        StepFacts touched;
        auto &vertices = swapped ? touched.verticesB : touched.verticesA,
             &corners = swapped ? touched.verticesA : touched.verticesB;
        if (ofVertex) vertices.push_back(0);
        if (ofCorner) corners.push_back(2);
        ContactBuffers found{}, out{};
        (swapped ? found.triangleVertex : found.vertexTriangle).push_back(atEnd);
        replaceByImpacts(pair, touched, found, out);
        const std::size_t replaced = ofVertex || ofCorner;
        EXPECT_EQ(found.vertexTriangle.size() + found.triangleVertex.size(), 1 - replaced);
        const auto& impacts = swapped ? out.triangleVertex : out.vertexTriangle;
        ASSERT_EQ(impacts.size(), replaced);
        if (replaced) {
          EXPECT_LT(impacts[0].timeOfImpact, 1.0);
        }
      }
}

/// A time of impact may be reported where features only nearly come within the distance. It is no
/// contact, and no earliest time, if their boxes stay apart.
TEST(Continuous, FeaturesThatStopBeforeTheDistanceHaveNoImpact) {
  constexpr double kDistance = 0.125;
  const TriangleMesh ground = meshOf({{-4, -4, 0}, {4, -4, 0}, {0, 4, 0}},
                                     {{-4, -4, 0}, {4, -4, 0}, {0, 4, 0}}, {{0, 1, 2}});
  int reported = 0;
  for (int exponent = -52; exponent < -20; ++exponent) {
    const double end = kDistance + std::ldexp(1.0, exponent);
    const TriangleMesh falling =
        meshOf({{0, 0, 1}, {1, 0, 3}, {0, 1, 3}}, {{0, 0, end}, {1, 0, 2 + end}, {0, 1, 2 + end}},
               {{0, 1, 2}});
    const MeshPair pair{falling, ground, {Method::Continuous, kDistance, Contacts::All}};
    ContactBuffers counts{}, found{};
    EXPECT_EQ(findEarliestImpact(pair, everyPair(falling, ground), kUnbounded, counts), kUnbounded);
    findContinuous(pair, everyPair(falling, ground), found);
    EXPECT_TRUE(found.vertexTriangle.empty());
    reported += vertexTriangleTimeOfImpact(falling.before[0], ground.before[0], ground.before[1],
                                           ground.before[2], falling.now[0], ground.now[0],
                                           ground.now[1], ground.now[2], {kDistance})
                    .has_value();
  }
  EXPECT_GT(reported, 0);
}

/// Two triangles that share an edge and fold flat onto each other: their unshared features touch.
TEST(Continuous, NeighboursTouchOnlyInUnsharedFeatures) {
  const std::vector<Vector3d> before{{0, 0, 0}, {1, 0, 0}, {0.5, 1, 0}, {0.5, -0.5, 1}},
      now{{0, 0, 0}, {1, 0, 0}, {0.5, 1, 0}, {0.5, 0.5, -1}};
  const TriangleMesh mesh = meshOf(before, now, {{0, 1, 2}, {1, 0, 3}});
  ContactBuffers found{};
  const std::vector<ElementPair> candidates{{0, 1}};
  findContinuous({mesh, mesh, {Method::Continuous, 0.0, Contacts::All}}, candidates, found);
  ASSERT_EQ(found.vertexTriangle.size(), 1u);
  EXPECT_EQ(found.vertexTriangle[0].vertex, 3u);
  EXPECT_EQ(found.vertexTriangle[0].triangle, 0u);
}

}  // namespace
}  // namespace palpate
