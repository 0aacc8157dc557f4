#include "Common/PairRun.h"
#include "Common/DegenerateCases.h"

#include <gtest/gtest.h>

#include <thread>

// The input of a frame: positions before and now, ids, pairs. Some calls change nothing.

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;

const PairSettings kContinuous{Method::Continuous, 0, Contacts::All};

/// A spike whose tip is at a height above a sheet at 0.
std::vector<Vector3d> at(double height) { return spike({0.3, 0.2, height}).positions; }

class FrameSemantics : public ::testing::Test {
 protected:
  OctreeBasedCD m_detection{settingsOf(Engine::Octree)};
  const Mesh m_sheet = flat(4, 0), m_spike = spike({0.3, 0.2, 1});
  const GeometryId m_a = m_detection.addTriangleMesh(m_spike.positions, m_spike.triangles);
  const GeometryId m_b = m_detection.addTriangleMesh(m_sheet.positions, m_sheet.triangles);

  void SetUp() override { m_detection.addCollisionPair(m_a, m_b, kContinuous); }
  /// Sets both ends of the step, detects, and ends the step.
  double time() {
    m_detection.detectCollision();
    m_detection.advance();
    return m_detection.collisionData(m_a, m_b).earliestTimeOfImpact();
  }
};

constexpr double kTolerance = 1e-6, kNever = std::numeric_limits<double>::infinity();

TEST_F(FrameSemantics, BeforeIsNowOfThePreviousStep) {
  EXPECT_EQ(time(), kNever);
  m_detection.setPositions(m_a, at(-1));
  EXPECT_NEAR(time(), 0.5, kTolerance);
  EXPECT_EQ(time(), kNever);  // at rest below the sheet
  m_detection.setPositions(m_a, at(3));
  EXPECT_LT(time(), 0.25 + kTolerance);  // by then the tip has passed
  m_detection.setPositions(m_a, at(3));
  EXPECT_EQ(time(), kNever);
}

TEST_F(FrameSemantics, LastOfSeveralCallsCounts) {
  EXPECT_EQ(time(), kNever);
  m_detection.setPositions(m_a, at(-1));
  m_detection.setPositions(m_a, at(2));
  EXPECT_EQ(time(), kNever);
  m_detection.setPositions(m_a, at(-2));
  m_detection.setPositions(m_a, at(3), at(-1));
  EXPECT_NEAR(time(), 0.75, kTolerance);
}

TEST_F(FrameSemantics, NewTrianglesAreAtRest) {
  m_detection.setTriangles(m_a, at(-2), m_spike.triangles);
  EXPECT_EQ(time(), kNever);
  m_detection.setPositions(m_a, at(2));
  EXPECT_LT(time(), 1.0);
}

TEST_F(FrameSemantics, UnchangedFrameKeepsContactsAndOctrees) {
  m_detection.setPositions(m_a, at(1), at(-1));
  m_detection.detectCollision();
  const std::uint64_t hash = m_detection.collisionData(m_a, m_b).hash();
  EXPECT_EQ(m_detection.statistics().unchangedOctrees, 0u);
  m_detection.detectCollision();
  EXPECT_EQ(m_detection.collisionData(m_a, m_b).hash(), hash);
  EXPECT_EQ(m_detection.statistics().unchangedOctrees, 2u);
}

TEST_F(FrameSemantics, RemovedIdsAreNotReused) {
  m_detection.detectCollision();
  m_detection.removeGeometry(m_a);
  EXPECT_TRUE(m_detection.pairs().empty());
  const GeometryId next = m_detection.addTriangleMesh(at(0.001), m_spike.triangles);
  EXPECT_GT(next, m_b);
  EXPECT_THROW(m_detection.setPositions(m_a, at(0)), Error);
  EXPECT_THROW(m_detection.collisionData(m_a, m_b), Error);
  m_detection.addCollisionPair(next, m_b, {Method::Proximity, 0.01, Contacts::Distinct});
  m_detection.detectCollision();
  EXPECT_EQ(m_detection.collisionData(next, m_b).vertexTriangle().size(), 1u);
}

TEST_F(FrameSemantics, OnlyCollisionDataDependsOnTheOrderOfThePair) {
  EXPECT_THROW(m_detection.addCollisionPair(m_b, m_a, kContinuous), Error);
  m_detection.setPairSettings(m_b, m_a, {Method::Proximity, 0.1, Contacts::All});
  EXPECT_EQ(m_detection.pairs().front().settings.method, Method::Proximity);
  EXPECT_EQ(m_detection.candidatePairs(m_b, m_a), m_detection.candidatePairs(m_a, m_b));
  EXPECT_THROW(m_detection.collisionData(m_b, m_a), Error);
  m_detection.removeCollisionPair(m_b, m_a);
  EXPECT_TRUE(m_detection.pairs().empty());
}

TEST_F(FrameSemantics, ConstQueriesWorkFromManyThreads) {
  m_detection.setPairSettings(m_a, m_b, {Method::Proximity, 2, Contacts::All});
  m_detection.detectCollision();
  EXPECT_FALSE(m_detection.candidatePairs(m_a, m_b).empty());
  const OctreeBasedCD& detection = m_detection;
  const std::uint64_t hash = detection.collisionData(m_a, m_b).hash();
  std::vector<std::thread> threads;
  std::array<bool, 4> good{};
  for (bool& each : good)
    threads.emplace_back([&] {
      each = true;
      for (int i = 0; i < 50; ++i) {
        each &= detection.collisionData(m_a, m_b).hash() == hash;
        each &= detection.octree().validate().empty();
      }
    });
  for (std::thread& thread : threads) thread.join();
  for (const bool each : good) EXPECT_TRUE(each);
}

TEST(OneCall, MatchesAFrame) {
  const Mesh a = spike({0.3, 0.2, 0.01}), b = flat(4, 0);
  for (const PairSettings& settings :
       {PairSettings{Method::Proximity, 0.1, Contacts::All},
        PairSettings{Method::Auto, 0.1, Contacts::Distinct}, PairSettings{}}) {
    PairRun run(settingsOf(Engine::Octree), a, b, settings);
    run.detect();
    const CollisionData data =
        detectCollision({a.positions, a.triangles}, {b.positions, b.triangles}, settings);
    expectSameRows(Rows(data), Rows(run.data()));
    EXPECT_EQ(data.hash(), run.data().hash());
  }
  EXPECT_THROW(detectCollision({a.positions, a.triangles}, {b.positions, b.triangles}, kContinuous),
               Error);
}

}  // namespace
}  // namespace palpate
