#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/PairRun.h"
#include "Common/QueryCalls.h"
#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

namespace palpate {
namespace {

/// A triangle at height z, and the two ends of its step.
class Step : public ::testing::Test {
 protected:
  static std::vector<Eigen::Vector3d> at(double z) { return {{0, 0, z}, {1, 0, z}, {0, 1, z}}; }
  static std::vector<Triangle> triangle() { return {{0, 1, 2}}; }

  void expect(double before, double now) {
    const CollisionProblem problem = m_detection.problem();
    EXPECT_EQ(problem.geometries[0].before, at(before));
    EXPECT_EQ(problem.geometries[0].now, at(now));
  }
  /// Sets both ends of the step and ends it.
  void expectLast(double before, double now) {
    expect(before, now);
    m_detection.advance();
    expect(now, now);
  }

  OctreeBasedCD m_detection;
  GeometryId m_id = m_detection.addTriangleMesh(at(0), triangle());
};

TEST_F(Step, NewGeometryIsAtRest) {
  m_detection.setPositions(m_id, at(1));
  expect(1, 1);
  m_detection.setPositions(m_id, at(2));
  expectLast(2, 2);
}

TEST_F(Step, NewGeometryMayHaveBothEndsGiven) {
  m_detection.setPositions(m_id, at(1), at(2));
  m_detection.setPositions(m_id, at(3));
  expectLast(1, 3);
}

TEST_F(Step, BeginsWhereTheLastOneEnded) {
  expectLast(0, 0);
  m_detection.setPositions(m_id, at(1));
  expectLast(0, 1);
  m_detection.setPositions(m_id, at(2));
  expectLast(1, 2);
}

TEST_F(Step, WithoutPositionsIsAtRest) {
  m_detection.advance();
  m_detection.setPositions(m_id, at(1));
  m_detection.advance();
  m_detection.advance();
  expect(1, 1);
}

/// No detection, update, query or batch of candidates ends a step.
TEST_F(Step, EndsByAdvanceOnly) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.5), triangle());
  m_detection.addCollisionPair(m_id, other, {.method = Method::Continuous});
  m_detection.advance();
  m_detection.setPositions(m_id, at(1));
  const auto candidates = [&] {
    std::size_t count = 0;
    m_detection.forEachCandidate(m_id, other, [&](auto batch) { count += batch.size(); });
    return count;
  };
  for (int round = 0; round < 3; ++round) {
    EXPECT_EQ(candidates(), 1u);
    m_detection.update();
    EXPECT_EQ(m_detection.candidatePairs(m_id, other).size(), 1u);
    m_detection.detectCollision();
    EXPECT_EQ(m_detection.collisionData(m_id, other).vertexTriangle().size(), 3u);
    expect(0, 1);
  }
  m_detection.advance();
  EXPECT_EQ(candidates(), 0u);
  expect(1, 1);
}

/// With candidates alone, `before` becomes the last `now`, as with every other call.
TEST_F(Step, AdvanceAppliesToCandidatesInBatches) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.5), triangle());
  m_detection.addCollisionPair(m_id, other, {.method = Method::Continuous});
  m_detection.advance();
  for (const double z : {1.0, 0.0, 1.0}) {
    m_detection.setPositions(m_id, at(z));
    std::size_t count = 0;
    m_detection.forEachCandidate(m_id, other, [&](auto batch) { count += batch.size(); });
    EXPECT_EQ(count, 1u);
    m_detection.advance();
  }
}

TEST_F(Step, ContactsDependOnTheLastValuesOnly) {
  m_detection.advance();
  m_detection.setPositions(m_id, at(1));
  m_detection.update();
  m_detection.setPositions(m_id, at(2));
  expectLast(0, 2);
  m_detection.setPositions(m_id, at(7), at(8));
  m_detection.setPositions(m_id, at(3));
  expectLast(7, 3);
  m_detection.setPositions(m_id, at(4));
  m_detection.setPositions(m_id, at(7), at(8));
  expectLast(7, 8);
  m_detection.setPositions(m_id, at(1), at(2));
  m_detection.setPositions(m_id, at(5), at(6));
  m_detection.setPositions(m_id, at(9));
  expectLast(5, 9);
}

TEST_F(Step, NewTopologyIsAtRest) {
  m_detection.advance();
  m_detection.setTriangles(m_id, at(5), triangle());
  expect(5, 5);
  m_detection.setPositions(m_id, at(6));
  expectLast(6, 6);
  m_detection.setPositions(m_id, at(7), at(8));
  m_detection.setTriangles(m_id, at(1), triangle());
  expect(1, 1);
  m_detection.setPositions(m_id, at(2), at(3));
  m_detection.setPositions(m_id, at(4));
  expectLast(2, 4);
}

/// A tool passes through z = 0 in one step and is not set again. A sheet is placed at z = 0 in the
/// next step: nothing touches.
TEST_F(Step, DoesNotRepeatMotionThatHasEnded) {
  const GeometryId sheet = m_detection.addTriangleMesh(at(50), triangle());
  m_detection.addCollisionPair(m_id, sheet, {.method = Method::Continuous});
  m_detection.setPositions(m_id, at(-1), at(1));
  m_detection.detectCollision();
  m_detection.advance();
  m_detection.setPositions(sheet, at(0), at(0));
  m_detection.detectCollision();
  EXPECT_TRUE(m_detection.collisionData(m_id, sheet).vertexTriangle().empty());
  EXPECT_EQ(m_detection.collisionData(m_id, sheet).earliestTimeOfImpact(), INFINITY);
  EXPECT_EQ(m_detection.collisionData(m_id, sheet).validity().displacement, 0.0);
}

/// A loop without advance() sweeps from its first positions, and validity() reports the
/// displacement.
TEST_F(Step, WithoutAdvanceGrowsAndIsNotTrusted) {
  const GeometryId sheet = m_detection.addTriangleMesh(at(50), triangle());
  m_detection.addCollisionPair(m_id, sheet, {.method = Method::Proximity, .thickness = 1.5});
  m_detection.detectCollision();
  m_detection.advance();
  for (int frame = 1; frame < 4; ++frame) {
    m_detection.setPositions(m_id, at(frame));
    m_detection.detectCollision();
    const Validity& validity = m_detection.collisionData(m_id, sheet).validity();
    EXPECT_NEAR(validity.displacement, frame, 1e-9);
    EXPECT_EQ(validity.displacementOverLimit() > 1, frame > 1);
    EXPECT_EQ(validity.trusted, frame == 1);
  }
}

/// Intersection measures no distances, so a thickness does not bound the distance of its meshes.
TEST_F(Step, StartedApartOfIntersectionNeedsTheSamePositions) {
  const std::vector<Eigen::Vector3d> wall{{0.2, 0.2, -1}, {0.2, 0.2, 1}, {0.3, 0.2, 1}};
  const GeometryId id = m_detection.addTriangleMesh(wall, triangle());
  m_detection.addCollisionPair(m_id, id, {.method = Method::Intersection, .thickness = 5});
  m_detection.setPositions(m_id, at(2), at(2));
  m_detection.detectCollision();
  m_detection.advance();
  m_detection.setPositions(m_id, at(0.5), at(0.5));
  m_detection.detectCollision();
  EXPECT_EQ(m_detection.collisionData(m_id, id).intersectingTriangles().size(), 1u);
  EXPECT_FALSE(m_detection.collisionData(m_id, id).validity().startedApart);
}

/// A solver with several detections in a step: `before` stays, and positions are corrected in
/// between.
/// The boxes at the end are further apart than the displacement. Those over the step, which the
/// second pair needs, are not.
TEST_F(Step, TrustInIntersectionDoesNotDependOnOtherPairs) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.01), triangle()),
                   far = m_detection.addTriangleMesh(at(10), triangle());
  m_detection.addCollisionPair(m_id, other, {.method = Method::Intersection});
  for (const bool needsWholeStep : {false, true}) {
    if (needsWholeStep) m_detection.addCollisionPair(m_id, far, {.method = Method::Continuous});
    m_detection.setPositions(m_id, at(0), at(-0.05));
    m_detection.detectCollision();
    EXPECT_TRUE(m_detection.collisionData(m_id, other).validity().trusted) << needsWholeStep;
    m_detection.setPositions(m_id, at(0), at(0.05));
    m_detection.detectCollision();
    EXPECT_FALSE(m_detection.collisionData(m_id, other).validity().trusted) << needsWholeStep;
  }
}

TEST_F(Step, KeepsBeforeThroughSeveralDetections) {
  const GeometryId sheet = m_detection.addTriangleMesh(at(1), triangle());
  m_detection.addCollisionPair(m_id, sheet, {.method = Method::Continuous});
  m_detection.detectCollision();
  m_detection.advance();
  for (int step = 0; step < 20; ++step) {
    for (const double z : {2.0, 1.5, 0.75, 0.5}) {
      m_detection.setPositions(m_id, at(z));
      m_detection.detectCollision();
      const CollisionData& data = m_detection.collisionData(m_id, sheet);
      EXPECT_EQ(data.vertexTriangle().empty(), z < 1);
      EXPECT_EQ(data.validity().startedApart, true) << step << " " << z;
    }
    m_detection.setPositions(m_id, at(0));
    m_detection.advance();
  }
}

TEST_F(Step, SamePositionsKeepOctreeAndStaticContacts) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.1), triangle());
  PairSettings settings;
  settings.method = Method::Proximity;
  settings.thickness = 0.5;
  m_detection.addCollisionPair(m_id, other, settings);
  const auto hash = [&] {
    m_detection.detectCollision();
    const std::uint64_t answer = m_detection.collisionData(m_id, other).hash();
    m_detection.advance();
    return answer;
  };
  const std::uint64_t first = hash();
  m_detection.setPositions(m_id, at(1));
  EXPECT_NE(hash(), first);
  m_detection.setPositions(m_id, at(1));
  hash();
  EXPECT_EQ(m_detection.statistics().unchangedOctrees, 2u);
  m_detection.setPositions(m_id, at(0));
  EXPECT_EQ(hash(), first);
}

TEST_F(Step, SamePositionsAreANewStepForContinuous) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.5), triangle());
  m_detection.addCollisionPair(m_id, other, {.method = Method::Continuous});
  m_detection.advance();
  m_detection.setPositions(m_id, at(1));
  m_detection.detectCollision();
  EXPECT_FALSE(m_detection.collisionData(m_id, other).vertexTriangle().empty());
  m_detection.advance();
  m_detection.setPositions(m_id, at(1));
  m_detection.detectCollision();
  EXPECT_TRUE(m_detection.collisionData(m_id, other).vertexTriangle().empty());
}

/// Statistics are those of the last frame, whatever is called afterwards.
TEST_F(Step, QueriesKeepStatistics) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.1), triangle());
  m_detection.addCollisionPair(m_id, other, {.method = Method::Proximity, .thickness = 0.5});
  m_detection.detectCollision();
  const FrameStatistics before = m_detection.statistics();
  EXPECT_GT(before.contacts, 0u);
  m_detection.setPositions(m_id, at(0.05));
  testing::insideVertices(m_detection, m_id, other, {.rule = InsideRule::WindingNumber});
  m_detection.forEachCandidate(m_id, other, [](auto) {});
  EXPECT_EQ(m_detection.statistics().contacts, before.contacts);
  EXPECT_EQ(m_detection.statistics().candidatePairs, before.candidatePairs);
  EXPECT_EQ(m_detection.statistics().rebuiltOctrees, before.rebuiltOctrees);
  m_detection.detectCollision();  // this counts the octree that a query updated
  EXPECT_EQ(m_detection.statistics().refittedOctrees + m_detection.statistics().rebuiltOctrees, 1u);
}

ErrorCode codeOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.code();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

TEST(PairStatistics, AddUpToThoseOfTheFrame) {
  const testing::Mesh ball = testing::sphere(12, 16, {0.5, 0.5, 0.3}, 0.3),
                      ground = testing::sheet(12, 0.0, 0.0);
  for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
    OctreeBasedCD collisions(testing::settingsOf(engine, 2));
    const GeometryId a = collisions.addTriangleMesh(ball.positions, ball.triangles),
                     b = collisions.addTriangleMesh(ground.positions, ground.triangles),
                     tool = collisions.addAnalyticalGeometry(Sphere{{0.5, 0.5, 0.1}, 0.1});
    collisions.addCollisionPair(a, b, {.thickness = 0.05});
    collisions.addCollisionPair(tool, b, {.thickness = 0.05});
    EXPECT_EQ(collisions.pairStatistics(a, b).contacts, 0u);
    collisions.detectCollision();
    const PairStatistics first = collisions.pairStatistics(a, b),
                         second = collisions.pairStatistics(b, tool);
    const FrameStatistics& frame = collisions.statistics();
    EXPECT_EQ(first.candidatePairs + second.candidatePairs, frame.candidatePairs);
    EXPECT_EQ(first.featurePairs + second.featurePairs, frame.featurePairs);
    EXPECT_EQ(first.exactDecisions + second.exactDecisions, frame.exactDecisions);
    EXPECT_EQ(first.contacts + second.contacts, frame.contacts);
    EXPECT_GT(first.contacts, 0u);
    EXPECT_GT(second.contacts, 0u);
    EXPECT_GT(first.milliseconds, 0.0);
    EXPECT_GT(second.milliseconds, 0.0);

    // The answer of the mesh, which does not move, still holds.
    collisions.advance();
    collisions.detectCollision();
    collisions.setTransform(tool, {Eigen::Matrix3d::Identity(), {0.1, 0, 0}});
    collisions.detectCollision();
    EXPECT_EQ(collisions.pairStatistics(a, b).milliseconds, 0.0);
    EXPECT_EQ(collisions.pairStatistics(a, b).contacts, first.contacts);
    EXPECT_GT(collisions.pairStatistics(tool, b).milliseconds, 0.0);
    testing::expectRefused(ErrorCode::UnknownPair, "pair (0, 2) was never added",
                           [&] { collisions.pairStatistics(a, tool); });
  }
}

TEST_F(Step, HasNoContactsBeforeADetection) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.1), triangle());
  const auto ask = [&] { m_detection.collisionData(m_id, other); };
  m_detection.addCollisionPair(m_id, other, {.method = Method::Proximity, .thickness = 0.5});
  EXPECT_EQ(codeOf(ask), ErrorCode::NotAvailable);
  m_detection.candidatePairs(m_id, other);
  EXPECT_EQ(codeOf(ask), ErrorCode::NotAvailable);
  m_detection.detectCollision();
  EXPECT_FALSE(m_detection.collisionData(m_id, other).vertexTriangle().empty());
  m_detection.advance();
  m_detection.setPositions(m_id, at(9));
  EXPECT_FALSE(m_detection.collisionData(m_id, other).vertexTriangle().empty());  // the last one
  m_detection.removeCollisionPair(m_id, other);
  m_detection.addCollisionPair(m_id, other, {.method = Method::Proximity, .thickness = 0.5});
  EXPECT_EQ(codeOf(ask), ErrorCode::NotAvailable);
}

TEST_F(Step, MovedFromObjectRefusesCalls) {
  OctreeBasedCD other = std::move(m_detection);
  EXPECT_EQ(codeOf([&] { m_detection.advance(); }), ErrorCode::InvalidCall);
  EXPECT_EQ(codeOf([&] { m_detection.setPositions(m_id, at(1)); }), ErrorCode::InvalidCall);
  EXPECT_EQ(codeOf([&] { m_detection.detectCollision(); }), ErrorCode::InvalidCall);
  EXPECT_EQ(codeOf([&] { m_detection.addTriangleMesh(at(1), triangle()); }),
            ErrorCode::InvalidCall);
  EXPECT_EQ(codeOf([&] { m_detection.statistics(); }), ErrorCode::InvalidCall);
  EXPECT_EQ(codeOf([&] { m_detection.octree(); }), ErrorCode::InvalidCall);
  EXPECT_EQ(codeOf([&] { m_detection.pairs(); }), ErrorCode::InvalidCall);
  EXPECT_EQ(codeOf([&] { m_detection.problem(); }), ErrorCode::InvalidCall);
  m_detection = std::move(other);
  m_detection.setPositions(m_id, at(1));
  expectLast(1, 1);
}

/// A predicate or callback that calls the object gets an error. The object stays usable.
TEST_F(Step, CannotBeChangedByCallbacks) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.1), triangle());
  m_detection.addCollisionPair(m_id, other, {.method = Method::Proximity, .thickness = 0.5});
  m_detection.detectCollision();
  const std::uint64_t hash = m_detection.collisionData(m_id, other).hash();
  const std::vector<std::function<void()>> calls{
      [&] { m_detection.removeGeometry(other); },
      [&] { m_detection.removeCollisionPair(m_id, other); },
      [&] { m_detection.setContactPredicate(m_id, other, {}); },
      [&] { m_detection.setPositions(m_id, at(3)); },
      [&] { m_detection.advance(); },
      [&] { m_detection.detectCollision(); },
      [&] { m_detection.forEachCandidate(m_id, other, [](auto) {}); },
      [&] { m_detection.collisionData(m_id, other); }};
  for (const auto& call : calls) {
    std::atomic<int> refused = 0;
    m_detection.forEachCandidate(m_id, other,
                                 [&](auto) { refused += codeOf(call) == ErrorCode::InvalidCall; });
    EXPECT_GT(refused, 0);
    refused = 0;
    m_detection.setContactPredicate(m_id, other, [&](const ContactFeatures&) {
      refused += codeOf(call) == ErrorCode::InvalidCall;
      return true;
    });
    m_detection.detectCollision();
    EXPECT_GT(refused, 0);
    EXPECT_EQ(m_detection.collisionData(m_id, other).hash(), hash);
    // The predicate may also let the error pass. Then the error ends the frame.
    m_detection.setContactPredicate(m_id, other, [&](const ContactFeatures&) {
      call();
      return true;
    });
    EXPECT_EQ(codeOf([&] { m_detection.detectCollision(); }), ErrorCode::InvalidCall);
    EXPECT_EQ(m_detection.collisionData(m_id, other).hash(),
              hash);  // the contacts of the previous frame
    EXPECT_EQ(codeOf([&] { m_detection.forEachCandidate(m_id, other, [&](auto) { call(); }); }),
              ErrorCode::InvalidCall);
    m_detection.setContactPredicate(m_id, other, {});
    m_detection.detectCollision();
    EXPECT_EQ(m_detection.collisionData(m_id, other).hash(), hash);
  }
}

}  // namespace
}  // namespace palpate
