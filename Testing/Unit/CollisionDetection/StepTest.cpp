#include <palpate/Capture.h>

#include "Common/DegenerateCases.h"
#include "Common/ExpectRefused.h"
#include "Common/PairRun.h"
#include "Common/QueryCalls.h"

#include <atomic>
#include <utility>

namespace palpate::testing {
namespace {

const PairSettings kNear{Method::Proximity, 0.5};

/// A triangle at height z, and the two ends of its step. Random histories (Common/History.h)
/// compare steps after any calls with those of a model.
class Step : public ::testing::Test {
 protected:
  static std::vector<Eigen::Vector3d> at(double z) { return {{0, 0, z}, {1, 0, z}, {0, 1, z}}; }
  static std::vector<Triangle> triangle() { return {{0, 1, 2}}; }

  void set(double z) { m_detection.setPositions(m_id, at(z)); }
  void set(double before, double now) { m_detection.setPositions(m_id, at(before), at(now)); }

  void expect(double before, double now) {
    const CollisionProblem problem = m_detection.problem();
    EXPECT_EQ(problem.geometries[0].before, at(before));
    EXPECT_EQ(problem.geometries[0].now, at(now));
  }
  /// Another triangle, in a pair with the first.
  GeometryId add(double z, const PairSettings& settings) {
    const GeometryId other = m_detection.addTriangleMesh(at(z), triangle());
    m_detection.addCollisionPair(m_id, other, settings);
    return other;
  }
  const CollisionData& detect(GeometryId other) {
    m_detection.detectCollision();
    return m_detection.collisionData(m_id, other);
  }

  OctreeBasedCD m_detection;
  GeometryId m_id = m_detection.addTriangleMesh(at(0), triangle());
};

/// A loop without advance() sweeps from its first positions, and validity() reports the
/// displacement.
TEST_F(Step, WithoutAdvanceGrowsAndIsNotTrusted) {
  const GeometryId sheet = add(50, {.method = Method::Proximity, .thickness = 1.5});
  detect(sheet);
  m_detection.advance();
  for (int frame = 1; frame < 4; ++frame) {
    set(frame);
    const Validity& validity = detect(sheet).validity();
    EXPECT_NEAR(validity.displacement, frame, 1e-9);
    EXPECT_EQ(validity.displacementOverLimit() > 1, frame > 1);
    EXPECT_EQ(validity.trusted, frame == 1);
  }
}

/// The boxes at the end are further apart than the displacement. Those over the step, which the
/// second pair needs, are not.
TEST_F(Step, TrustInIntersectionDoesNotDependOnOtherPairs) {
  const GeometryId other = add(0.01, {.method = Method::Intersection});
  for (const bool needsWholeStep : {false, true}) {
    if (needsWholeStep) add(10, {.method = Method::Continuous});
    set(0, -0.05);
    EXPECT_TRUE(detect(other).validity().trusted) << needsWholeStep;
    set(0, 0.05);
    EXPECT_FALSE(detect(other).validity().trusted) << needsWholeStep;
  }
}

TEST_F(Step, SamePositionsKeepOctreeAndStaticContacts) {
  const GeometryId other = add(0.1, kNear);
  const std::uint64_t first = detect(other).hash();
  EXPECT_EQ(m_detection.statistics().unchangedOctrees, 0u);
  EXPECT_EQ(detect(other).hash(), first);
  EXPECT_EQ(m_detection.statistics().unchangedOctrees, 2u);
  for (const double z : {1, 1, 0}) {
    m_detection.advance();
    const bool isSame = m_detection.positions(m_id)[0].z() == z;
    set(z);
    EXPECT_EQ(detect(other).hash() == first, z == 0);
    EXPECT_EQ(m_detection.statistics().unchangedOctrees, isSame ? 2u : 1u);
  }
}

TEST(PairStatistics, AddUpToThoseOfTheFrame) {
  const Mesh ball = sphere(12, 16, {0.5, 0.5, 0.3}, 0.3), ground = sheet(12, 0.0, 0.0);
  for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
    OctreeBasedCD collisions(settingsOf(engine, 2));
    const GeometryId a = addMesh(collisions, ball), b = addMesh(collisions, ground),
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
    collisions.setTransform(tool, {.translation = {0.1, 0, 0}});
    collisions.detectCollision();
    EXPECT_EQ(collisions.pairStatistics(a, b).milliseconds, 0.0);
    EXPECT_EQ(collisions.pairStatistics(a, b).contacts, first.contacts);
    EXPECT_GT(collisions.pairStatistics(tool, b).milliseconds, 0.0);
    expectRefused(ErrorCode::UnknownPair, "pair (0, 2) was never added",
                  [&] { collisions.pairStatistics(a, tool); });
  }
}

TEST_F(Step, HasNoContactsBeforeADetection) {
  const GeometryId other = add(0.1, kNear);
  const auto expectNone = [&] {
    expectRefused(ErrorCode::NotAvailable, "", [&] { m_detection.collisionData(m_id, other); });
  };
  expectNone();
  m_detection.candidatePairs(m_id, other);
  expectNone();
  EXPECT_FALSE(detect(other).vertexTriangle().empty());
  m_detection.advance();
  set(9);
  EXPECT_FALSE(m_detection.collisionData(m_id, other).vertexTriangle().empty());  // the last one
  m_detection.removeCollisionPair(m_id, other);
  m_detection.addCollisionPair(m_id, other, kNear);
  expectNone();
}

TEST_F(Step, MovedFromObjectRefusesCalls) {
  OctreeBasedCD other = std::move(m_detection);
  const std::function<void()> calls[] = {[&] { m_detection.advance(); },
                                         [&] { set(1); },
                                         [&] { m_detection.detectCollision(); },
                                         [&] { m_detection.addTriangleMesh(at(1), triangle()); },
                                         [&] { m_detection.statistics(); },
                                         [&] { m_detection.octree(); },
                                         [&] { m_detection.pairs(); },
                                         [&] { m_detection.problem(); }};
  for (const auto& call : calls) expectRefused(ErrorCode::InvalidCall, "", call);
  m_detection = std::move(other);
  set(1);
  expect(1, 1);
}

/// A predicate or callback that calls the object gets an error. The object stays usable.
TEST_F(Step, CannotBeChangedByCallbacks) {
  const GeometryId other = add(0.1, kNear);
  const std::uint64_t hash = detect(other).hash();
  const std::function<void()> calls[] = {
      [&] { m_detection.removeGeometry(other); },
      [&] { m_detection.removeCollisionPair(m_id, other); },
      [&] { m_detection.setContactPredicate(m_id, other, {}); },
      [&] { set(3); },
      [&] { m_detection.advance(); },
      [&] { m_detection.detectCollision(); },
      [&] { m_detection.forEachCandidate(m_id, other, [](auto) {}); },
      [&] { m_detection.collisionData(m_id, other); }};
  for (const auto& call : calls) {
    std::atomic<int> count = 0;
    const auto refused = [&](const auto&) {
      ++count;
      expectRefused(ErrorCode::InvalidCall, "", call);
      return true;
    };
    m_detection.forEachCandidate(m_id, other, [&](auto batch) { refused(batch); });
    EXPECT_GT(count.exchange(0), 0);
    m_detection.setContactPredicate(m_id, other, refused);
    EXPECT_EQ(detect(other).hash(), hash);
    EXPECT_GT(count, 0);
    // The predicate may also let the error pass. Then the error ends the frame.
    m_detection.setContactPredicate(m_id, other, [&](const ContactFeatures&) {
      call();
      return true;
    });
    expectRefused(ErrorCode::InvalidCall, "", [&] { m_detection.detectCollision(); });
    EXPECT_EQ(m_detection.collisionData(m_id, other).hash(), hash);  // of the previous frame
    expectRefused(ErrorCode::InvalidCall, "",
                  [&] { m_detection.forEachCandidate(m_id, other, [&](auto) { call(); }); });
    m_detection.setContactPredicate(m_id, other, {});
    EXPECT_EQ(detect(other).hash(), hash);
  }
}

/// One call without an object has the contacts of a frame.
TEST(OneCall, MatchesAFrame) {
  const Mesh a = spike({0.3, 0.2, 0.01}), b = flat(4, 0);
  const auto ofCall = [&](const PairSettings& settings) {
    return detectCollision({a.positions, a.triangles}, {b.positions, b.triangles}, settings);
  };
  for (const PairSettings& settings : {PairSettings{Method::Proximity, 0.1, Contacts::All},
                                       PairSettings{Method::Auto, 0.1}, PairSettings{}}) {
    PairRun run(settingsOf(Engine::Octree), a, b, settings);
    run.detect();
    expectSameContacts(ofCall(settings), run.data());
    EXPECT_EQ(ofCall(settings).hash(), run.data().hash());
  }
  EXPECT_THROW(ofCall({Method::Continuous}), Error);
}

}  // namespace
}  // namespace palpate::testing
