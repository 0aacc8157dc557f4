#include <palpate/CollisionProblem.h>
#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

namespace palpate {
namespace {

/// A triangle at height z, and what its step is when a frame has ended.
class Step : public ::testing::Test {
 protected:
  static std::vector<Eigen::Vector3d> at(double z) { return {{0, 0, z}, {1, 0, z}, {0, 1, z}}; }
  static std::vector<Triangle> triangle() { return {{0, 1, 2}}; }

  void expect(double before, double now) {
    m_detection.detectCollision();
    const CollisionProblem problem = m_detection.problem();
    EXPECT_EQ(problem.geometries[0].before, at(before));
    EXPECT_EQ(problem.geometries[0].now, at(now));
  }

  OctreeBasedCD m_detection;
  GeometryId m_id = m_detection.addTriangleMesh(at(0), triangle());
};

TEST_F(Step, AtFirstBeforeIsNow) {
  m_detection.setPositions(m_id, at(1));
  expect(1, 1);
}

TEST_F(Step, BeginsWhereTheLastFrameEnded) {
  expect(0, 0);
  m_detection.setPositions(m_id, at(1));
  expect(0, 1);
  expect(0, 1);  // nothing new: both stay
  m_detection.setPositions(m_id, at(2));
  expect(1, 2);
}

TEST_F(Step, OfSeveralCallsTheLastCounts) {
  expect(0, 0);
  m_detection.setPositions(m_id, at(1));
  m_detection.update();
  m_detection.setPositions(m_id, at(2));
  expect(0, 2);
  m_detection.setPositions(m_id, at(7), at(8));
  m_detection.setPositions(m_id, at(3));
  expect(2, 3);
  m_detection.setPositions(m_id, at(4));
  m_detection.setPositions(m_id, at(7), at(8));
  expect(7, 8);
  m_detection.setPositions(m_id, at(1), at(2));
  m_detection.setPositions(m_id, at(5), at(6));
  m_detection.setPositions(m_id, at(9));
  expect(8, 9);
}

TEST_F(Step, AfterNewTopologyBeforeIsNow) {
  expect(0, 0);
  m_detection.setTriangles(m_id, at(5), triangle());
  expect(5, 5);
  m_detection.setTriangles(m_id, at(1), triangle());
  m_detection.setPositions(m_id, at(2), at(3));
  m_detection.setPositions(m_id, at(4));
  expect(4, 4);
}

TEST_F(Step, WithTheSamePositionsLeavesOctreeAndStaticAnswersAlone) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.1), triangle());
  PairSettings settings;
  settings.method = Method::Proximity;
  settings.thickness = 0.5;
  m_detection.addCollisionPair(m_id, other, settings);
  expect(0, 0);
  const std::uint64_t hash = m_detection.collisionData(m_id, other).hash();
  m_detection.setPositions(m_id, at(1));
  expect(0, 1);
  EXPECT_NE(m_detection.collisionData(m_id, other).hash(), hash);
  m_detection.setPositions(m_id, at(1));
  expect(1, 1);
  EXPECT_EQ(m_detection.statistics().unchangedOctrees, 2u);
  m_detection.setPositions(m_id, at(0));
  expect(1, 0);
  EXPECT_EQ(m_detection.collisionData(m_id, other).hash(), hash);
}

TEST_F(Step, WithTheSamePositionsIsANewOneForContinuous) {
  const GeometryId other = m_detection.addTriangleMesh(at(0.5), triangle());
  PairSettings settings;
  settings.method = Method::Continuous;
  m_detection.addCollisionPair(m_id, other, settings);
  expect(0, 0);
  m_detection.setPositions(m_id, at(1));
  expect(0, 1);
  EXPECT_FALSE(m_detection.collisionData(m_id, other).vertexTriangle().empty());
  m_detection.setPositions(m_id, at(1));
  expect(1, 1);
  EXPECT_TRUE(m_detection.collisionData(m_id, other).vertexTriangle().empty());
}

}  // namespace
}  // namespace palpate
