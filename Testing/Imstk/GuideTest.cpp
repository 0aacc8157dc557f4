// The program of Docs/HowTo/FromIMSTK.md in a scene.
#include "Scenes.h"

#include <gtest/gtest.h>

#include <functional>

palpate::PalpateScene addCollisions(const std::shared_ptr<imstk::Scene>& scene,
                                    const std::shared_ptr<imstk::PbdObject>& liver,
                                    const std::shared_ptr<imstk::PbdObject>& suture,
                                    const std::shared_ptr<imstk::PbdObject>& cloth,
                                    const std::shared_ptr<imstk::CollidingObject>& tool);

void callInEachStep(const std::shared_ptr<imstk::Scene>& scene,
                    const std::shared_ptr<imstk::PbdObject>& liver,
                    const std::function<void()>& step);

namespace {

TEST(Guide, ItsLoopMovesPositionsBeforeVelocities) {
  TestScene test;
  const auto body = test.deformable("body", triangle({0, 0, 0}, 1));
  int steps = 0;
  callInEachStep(test.scene, body, [&] {
    ++steps;
    for (Vec3d& p : valuesOf(body->getPbdBody()->vertices)) p.x() += 0.01;
  });
  test.scene->initialize();
  test.step(3);
  EXPECT_EQ(steps, 3);
  EXPECT_NEAR(velocity(*body).x(), 3 * 0.01 / test.config().m_dt, 1e-9);  // each adds its own
}

TEST(Guide, ItsSceneKeepsTheBodiesApart) {
  TestScene test;
  test.config().m_gravity = {0, -10, 0};
  const auto thread = std::make_shared<imstk::LineMesh>();
  thread->initialize(positionArray({{-2, 1, 0}, {0, 1, 0.1}, {2, 1, 0}}),
                     cellArray<2>({{0, 1}, {1, 2}}));
  const auto liver = test.floor(sheet({0, 0, 0}, 4, 20));
  const auto suture = test.deformable("suture", thread);
  const auto cloth = test.deformable("cloth", sheet({5, 2, 5}, 2, 4));
  const auto capsule = std::make_shared<imstk::Capsule>(Vec3d(-5, 3, -5), 0.5, 2.0);
  const palpate::PalpateScene collisions =
      addCollisions(test.scene, liver, suture, cloth, test.tool(capsule));
  test.scene->initialize();
  for (int i = 0; i < 100; ++i) {
    capsule->setPosition({-5, 3 - 0.01 * i, -5});
    test.step();
    ASSERT_EQ(collisions.error(), "");
  }
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(particle(*suture, i).y(), 0.25 + 0.2, 1e-3);
  for (size_t i = 0; i < 9; ++i) EXPECT_NEAR(particle(*cloth, i).y(), 0.25, 1e-3);
  EXPECT_TRUE(collisions.trusted());
}

}  // namespace
