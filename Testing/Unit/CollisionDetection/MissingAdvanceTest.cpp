// Validity::advanceMayBeMissing.

#include "Common/TestGeometry.h"

namespace palpate::testing {
namespace {

/// A drop or a tool above a sheet, which is set by setPositions() or setTransform().
class Falling {
 public:
  explicit Falling(bool isPlaced) : m_isPlaced(isPlaced) {
    const Mesh ground = sheet(3, 0.0, 0.0);
    const GeometryId organ = addMesh(m_collisions, ground);
    m_id = m_isPlaced ? m_collisions.addAnalyticalGeometry(Sphere{{0.5, 0.5, 0}, 0.1})
                      : m_collisions.addPointSet(at(m_place));
    m_collisions.addCollisionPair(m_isPlaced ? organ : m_id, m_isPlaced ? m_id : organ,
                                  {.thickness = 0.1});
    set(m_place);
    m_collisions.advance();
  }

  void set(const Vector3d& place) {
    m_place = place;
    if (m_isPlaced)
      m_collisions.setTransform(m_id, {Eigen::Matrix3d::Identity(), place});
    else
      m_collisions.setPositions(m_id, at(place));
  }
  void move(const Vector3d& by) { set(m_place + by); }
  bool detect() {
    m_collisions.detectCollision();
    const CollisionPair& pair = m_collisions.pairs()[0];
    return m_collisions.collisionData(pair.a, pair.b).validity().advanceMayBeMissing;
  }
  OctreeBasedCD& collisions() { return m_collisions; }
  const Vector3d& place() const { return m_place; }

 private:
  static Positions at(const Vector3d& place) {
    return {Vector3d(place + Vector3d(0.3, 0.4, 0)), Vector3d(place + Vector3d(0.6, 0.5, 0))};
  }

  OctreeBasedCD m_collisions;
  GeometryId m_id{};
  bool m_isPlaced;
  Vector3d m_place{0, 0, 1};
};

class MissingAdvance : public ::testing::TestWithParam<bool> {};

TEST_P(MissingAdvance, MotionsThatAddUpAreNoticedWithoutADetection) {
  const Vector3d fall(0.01, 0, -0.1);
  for (int sets = 1; sets < 4; ++sets) {
    Falling falling(GetParam());
    for (int i = 0; i < sets; ++i) falling.move(fall * (1 + 0.2 * i));
    EXPECT_EQ(falling.detect(), sets > 1) << sets;
    // It is the same step until advance(), also in a saved state.
    const std::vector<std::byte> state = falling.collisions().save();
    falling.move(-0.1 * fall);
    EXPECT_EQ(falling.detect(), sets > 1);
    falling.collisions().restore(state);
    falling.move(-0.2 * fall);
    EXPECT_EQ(falling.detect(), sets > 1);
    falling.collisions().advance();
    falling.move(fall);
    EXPECT_FALSE(falling.detect());
  }
}

/// A loop that detects in each frame, too, is noticed after some frames.
TEST_P(MissingAdvance, ALoopThatNeverAdvancesIsNoticed) {
  Falling falling(GetParam());
  for (int frame = 1; frame < 9; ++frame) {
    falling.move({0.01, 0, frame % 2 == 0 ? -0.08 : -0.1});
    EXPECT_EQ(falling.detect(), frame >= 4) << frame;
  }
}

/// A solver sets a prediction and corrections of it, or a hand that hesitates: nothing is missing.
TEST_P(MissingAdvance, CorrectionsAreNotNoticed) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    Falling falling(GetParam());
    const bool detects = i % 2 == 0;
    for (int step = 0; step < 3; ++step) {
      const Vector3d predicted = 0.05 * randomPoint(random, -1, 1);
      falling.move(predicted);
      for (int round = 0; round < 6; ++round) {
        if (detects || round == 5) {
          EXPECT_FALSE(falling.detect());
        }
        // Back along the prediction, less each time, and aside.
        const double back = uniform(random, 0, 0.15);
        const Vector3d aside = randomPoint(random, -1, 1);
        falling.move(-back * predicted + 0.1 * predicted.norm() * aside);
        falling.set(falling.place());  // the same again
      }
      EXPECT_FALSE(falling.detect());
      falling.collisions().advance();
    }
  }
}

/// Both ends that are given begin a step of their own.
TEST(GivenEnds, BeginAStepOfTheirOwn) {
  OctreeBasedCD collisions;
  const GeometryId a = addMesh(collisions, sheet(3, 0.0, 0.0)),
                   b = collisions.addPointSet(Positions{{0.3, 0.4, 1}});
  collisions.addCollisionPair(b, a, {.thickness = 0.1});
  for (int i = 0; i < 6; ++i) {
    const double z = 1 - 0.1 * i;
    collisions.setPositions(b, Positions{{0.3, 0.4, z}}, Positions{{0.3, 0.4, z - 0.1}});
    if (i % 2 == 0) collisions.detectCollision();
    EXPECT_FALSE(collisions.collisionData(b, a).validity().advanceMayBeMissing);
  }
}

INSTANTIATE_TEST_SUITE_P(Ways, MissingAdvance, ::testing::Values(false, true));

}  // namespace
}  // namespace palpate::testing
