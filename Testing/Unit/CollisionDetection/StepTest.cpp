#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/DegenerateCases.h"
#include "Common/ExpectRefused.h"
#include "Common/PairRun.h"
#include "Common/QueryCalls.h"
#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <utility>
#include <vector>

namespace palpate::testing {
namespace {

const PairSettings kNear{Method::Proximity, 0.5};

/// A triangle at height z, and the two ends of its step.
class Step : public ::testing::Test {
 protected:
  static std::vector<Eigen::Vector3d> at(double z) { return {{0, 0, z}, {1, 0, z}, {0, 1, z}}; }
  static std::vector<Triangle> triangle() { return {{0, 1, 2}}; }
  static Pose poseAt(double z) { return {.translation = {0, 0, z}}; }

  void set(double z) { m_detection.setPositions(m_id, at(z)); }
  void set(double before, double now) { m_detection.setPositions(m_id, at(before), at(now)); }
  void place(double z) { m_detection.setTransform(m_id, poseAt(z)); }
  void place(double before, double now) {
    m_detection.setTransform(m_id, poseAt(before), poseAt(now));
  }
  void cut(double z) { m_detection.setTriangles(m_id, at(z), triangle()); }

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

/// The ends in the world after some calls, and that each step begins where the last one ended.
/// Histories (Frame/HistoryTest.cpp) make such calls at random.
TEST_F(Step, HasTheEndsOfTheLastCalls) {
  struct Row {
    const char* calls;
    bool isNew;  ///< in the first step of the geometry
    std::function<void()> call;
    double before, now;
  };
  const Row rows[] = {
      {"new: set 1, 2", true, [&] { set(1), set(2); }, 2, 2},
      {"new: set both, 3", true, [&] { set(1, 2), set(3); }, 1, 3},
      {"new: place", true, [&] { place(1); }, 1, 1},
      {"new: set both, place", true, [&] { set(5, 6), place(10); }, 15, 16},
      {"new: place, set both", true, [&] { place(10), set(5, 6); }, 15, 16},
      {"new: place both, 3", true, [&] { place(1, 2), place(3); }, 1, 3},
      {"new: set both, cut", true, [&] { set(7, 8), cut(1); }, 1, 1},
      {"nothing", false, [] {}, 0, 0},
      {"set", false, [&] { set(1); }, 0, 1},
      {"set 1, update, 2", false, [&] { set(1), m_detection.update(), set(2); }, 0, 2},
      {"set both, 3", false, [&] { set(7, 8), set(3); }, 7, 3},
      {"set 4, both", false, [&] { set(4), set(7, 8); }, 7, 8},
      {"set both twice, 9", false, [&] { set(1, 2), set(5, 6), set(9); }, 5, 9},
      {"cut, set", false, [&] { cut(5), set(6); }, 6, 6},
      {"cut, set both, 4", false, [&] { cut(1), set(2, 3), set(4); }, 2, 4},
      {"place", false, [&] { place(2); }, 0, 2},
      {"place 7, detect, 5", false, [&] { place(7), m_detection.detectCollision(), place(5); }, 0,
       5},
      {"set, place", false, [&] { set(3), place(1); }, 0, 4},
      {"place, set both", false, [&] { place(30), set(7, 8); }, 7, 38},
      {"place both", false, [&] { place(7, 8); }, 7, 8},
      {"set both, place both", false, [&] { set(10, 20), place(1, 2); }, 11, 22},
      {"place, cut, place", false, [&] { place(2), cut(5), place(4); }, 9, 9},
      {"cut, place both", false, [&] { cut(5), place(1, 2); }, 6, 7}};
  for (const Row& row : rows) {
    SCOPED_TRACE(row.calls);
    m_detection = OctreeBasedCD();
    m_id = m_detection.addTriangleMesh(at(0), triangle());
    if (!row.isNew) m_detection.advance();
    row.call();
    expect(row.before, row.now);
    for (int step = 0; step < 2; ++step) {
      m_detection.advance();
      expect(row.now, row.now);
    }
  }
}

/// No detection, update, query or batch of candidates ends a step.
TEST_F(Step, EndsByAdvanceOnly) {
  const GeometryId other = add(0.5, {.method = Method::Continuous});
  m_detection.advance();
  set(1);
  const auto candidates = [&] {
    std::size_t count = 0;
    m_detection.forEachCandidate(m_id, other, [&](auto batch) { count += batch.size(); });
    return count;
  };
  for (int round = 0; round < 3; ++round) {
    EXPECT_EQ(candidates(), 1u);
    m_detection.update();
    EXPECT_EQ(m_detection.candidatePairs(m_id, other).size(), 1u);
    EXPECT_EQ(detect(other).vertexTriangle().size(), 3u);
    expect(0, 1);
  }
  m_detection.advance();
  EXPECT_EQ(candidates(), 0u);
  expect(1, 1);
}

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

/// Intersection measures no distances, so a thickness does not bound the distance of its meshes.
TEST_F(Step, StartedApartOfIntersectionNeedsTheSamePositions) {
  const std::vector<Eigen::Vector3d> wall{{0.2, 0.2, -1}, {0.2, 0.2, 1}, {0.3, 0.2, 1}};
  const GeometryId id = m_detection.addTriangleMesh(wall, triangle());
  m_detection.addCollisionPair(m_id, id, {.method = Method::Intersection, .thickness = 5});
  set(2, 2);
  detect(id);
  m_detection.advance();
  set(0.5, 0.5);
  EXPECT_EQ(detect(id).intersectingTriangles().size(), 1u);
  EXPECT_FALSE(m_detection.collisionData(m_id, id).validity().startedApart);
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

/// Statistics are those of the last frame, whatever is called afterwards.
TEST_F(Step, QueriesKeepStatistics) {
  const GeometryId other = add(0.1, kNear);
  detect(other);
  const FrameStatistics before = m_detection.statistics();
  EXPECT_GT(before.contacts, 0u);
  set(0.05);
  insideVertices(m_detection, m_id, other, {.rule = InsideRule::WindingNumber});
  m_detection.forEachCandidate(m_id, other, [](auto) {});
  EXPECT_EQ(m_detection.statistics().contacts, before.contacts);
  EXPECT_EQ(m_detection.statistics().candidatePairs, before.candidatePairs);
  EXPECT_EQ(m_detection.statistics().rebuiltOctrees, before.rebuiltOctrees);
  detect(other);  // this counts the octree that a query updated
  EXPECT_EQ(m_detection.statistics().refittedOctrees + m_detection.statistics().rebuiltOctrees, 1u);
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
