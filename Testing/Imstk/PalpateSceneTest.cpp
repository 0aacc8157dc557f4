// The step of a scene: one detection, the guard, and what else moves bodies.
#include "Scenes.h"

#include <gtest/gtest.h>

#include <limits>

namespace {

TEST(PalpateScene, OneNodeDetectsBeforeAllInteractions) {
  TestScene test;
  const auto cloth = test.deformable("cloth", sheet({0, 1, 0}));
  const auto a = test.collide(cloth, test.floor(sheet({0, 0, 0})), {});
  const auto b =
      test.collide(cloth, test.tool(std::make_shared<imstk::Sphere>(Vec3d(0, 9, 0))), {});
  test.scene->initialize();
  const auto graph = test.scene->getTaskGraph();
  std::shared_ptr<imstk::TaskNode> node;
  for (const auto& other : graph->getNodes())
    if (other->m_name == "Palpate_Detection") {
      EXPECT_EQ(node, nullptr);
      node = other;
    }
  ASSERT_NE(node, nullptr);
  for (const auto& interaction : {a, b})
    EXPECT_EQ(graph->getInvAdjList().at(interaction->getCollisionDetectionNode()).count(node), 1u);
  EXPECT_EQ(graph->getInvAdjList().at(node).size(), 2u);  // both updates of geometries
  test.step(3);
  EXPECT_TRUE(test.palpateScene.trusted());
  EXPECT_TRUE(logged().empty());
}

TEST(PalpateScene, NothingPassesInTheFirstStepAndLater) {
  for (const int freeSteps : {0, 3}) {
    TestScene test;
    const auto floor = test.floor(sheet({0, 0, 0}));
    const auto falling = test.deformable("falling", triangle({0.1, 1, 0.1}, 0.2));
    test.guardOnly(falling, floor);
    test.scene->initialize();
    test.step(freeSteps);
    test.setVelocity(*falling, {0, -1000, 0});  // ten units in a step
    test.step();
    EXPECT_EQ(test.palpateScene.held(), 3u);
    EXPECT_TRUE(logged().empty());
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_GT(particle(*falling, i).y(), 0) << freeSteps;
      // Velocities are those of the steps that were made.
      EXPECT_NEAR(velocity(*falling, i).y(), (particle(*falling, i).y() - 1) / test.config().m_dt,
                  1e-9);
    }
    test.step(5);
    for (size_t i = 0; i < 3; ++i) EXPECT_GT(particle(*falling, i).y(), 0);
  }
}

TEST(PalpateScene, ADisabledInteractionIsNotGuarded) {
  TestScene test;
  const auto falling = test.deformable("falling", triangle({0.1, 1, 0.1}, 0.2));
  const auto interaction = test.guardOnly(falling, test.floor(sheet({0, 0, 0})));
  test.scene->initialize();
  interaction->setEnabled(false);
  test.setVelocity(*falling, {0, -1000, 0});
  test.step();
  EXPECT_LT(particle(*falling).y(), -8);
}

TEST(PalpateScene, ABodyThatWasMovedBeginsWhereItIs) {
  TestScene test;
  const auto falling = test.deformable("falling", triangle({0.1, 1, 0.1}, 0.2));
  test.guardOnly(falling, test.floor(sheet({0, 0, 0})));
  test.scene->initialize();
  test.step(2);
  for (Vec3d& p : valuesOf(falling->getPbdBody()->vertices)) p.y() = -3;  // to the other side
  test.step();
  EXPECT_EQ(particle(*falling).y(), -3);
  EXPECT_EQ(test.palpateScene.held(), 0u);
  test.setVelocity(*falling, {0, 1000, 0});
  test.step();
  EXPECT_LT(particle(*falling).y(), 0);
  test.scene->reset();
  test.palpateScene.restart();
  test.step();
  EXPECT_EQ(particle(*falling).y(), 1);
  EXPECT_EQ(test.palpateScene.held(), 0u);
  EXPECT_TRUE(logged().empty());
}

TEST(PalpateScene, AToolIsHeldInsideAndRestartLetsItJump) {
  for (const bool restarts : {false, true}) {
    TestScene test;
    const auto sphere = std::make_shared<imstk::Sphere>(Vec3d(0.1, 3, 0.1), 0.5);
    const auto floor = test.floor(sheet({0, 0, 0}));
    test.guardOnly(floor, test.tool(sphere));
    test.scene->initialize();
    test.step();
    sphere->setPosition({0.1, -3, 0.1});
    if (restarts) test.palpateScene.restart();
    test.step();
    EXPECT_EQ(test.palpateScene.held(), restarts ? 0u : 1u);
    EXPECT_EQ(sphere->getPosition(), Vec3d(0.1, -3, 0.1));
    test.step();  // the tool still is where the program put it, and still does not reach that
    EXPECT_EQ(test.palpateScene.held(), restarts ? 0u : 1u);
    EXPECT_TRUE(logged().empty());
  }
}

TEST(PalpateScene, AMovingMeshThatIsNoPbdObjectIsHeldAsOne) {
  TestScene test;
  const auto blade = triangle({0.1, 3, 0.1}, 0.2);
  test.guardOnly(test.floor(sheet({0, 0, 0})), test.tool(blade));
  test.scene->initialize();
  test.step();
  for (Vec3d& p : positionsIn(*blade)) p.y() = -3;
  test.step();
  EXPECT_EQ(test.palpateScene.held(), 3u);
  EXPECT_TRUE(logged().empty());
}

TEST(PalpateScene, ARigidBodyIsHeldWithItsTurn) {
  for (const bool isShape : {false, true}) {
    TestScene test;
    std::shared_ptr<imstk::Geometry> geometry = triangle({0, 0, 0}, 0.2);
    if (isShape) geometry = std::make_shared<imstk::Capsule>(Vec3d(0, 0, 0), 0.1, 0.2);
    const auto body = test.rigid("body", geometry, {0.1, 1, 0.1});
    test.guardOnly(body, test.floor(sheet({0, 0, 0})));
    test.scene->initialize();
    test.setVelocity(*body, {0, -1000, 0});
    (*body->getPbdBody()->angularVelocities)[0] = {20, 0, 0};
    test.step();
    EXPECT_EQ(test.palpateScene.held(), 1u);
    EXPECT_GT(particle(*body).y(), 0);
    const double angle = 2 * std::acos((*body->getPbdBody()->orientations)[0].w());
    EXPECT_GT(angle, 0.0);
    EXPECT_LT(angle, 0.05);  // the whole turn is 0.2
    EXPECT_TRUE(logged().empty());
  }
}

TEST(PalpateScene, ACutIsFollowed) {
  TestScene test;
  const auto mesh = sheet({0, 0, 0});
  const auto falling = test.deformable("falling", triangle({0.45, 1, 0.45}, 0.1));
  test.guardOnly(falling, test.floor(mesh));
  test.scene->initialize();
  test.setVelocity(*falling, {0, -1000, 0});
  test.step();
  EXPECT_GT(particle(*falling).y(), 0);
  // The squares below the body are cut out.
  const Eigen::Vector3i first = (*mesh->getCells())[0], second = (*mesh->getCells())[1];
  mesh->setCells(cellArray<3>({first, second}));
  test.setVelocity(*falling, {0, -1000, 0});
  test.step();
  EXPECT_LT(particle(*falling).y(), -5);
  EXPECT_TRUE(logged().empty());
}

TEST(PalpateScene, ACutSutureIsReplaced) {
  TestScene test;
  const auto suture = std::make_shared<imstk::LineMesh>();
  suture->initialize(positionArray({{-1, 0, 0.2}, {0, 0, 0.2}, {1, 0, 0.2}}),
                     cellArray<2>({{0, 1}, {1, 2}}));
  const auto falling = test.deformable("falling", triangle({0.5, 1, 0.2}, 0.3));
  test.guardOnly(falling, test.floor(suture));
  test.scene->initialize();
  test.setVelocity(*falling, {0, -1000, 0});
  test.step();
  EXPECT_GT(particle(*falling, 1).y(), 0);
  suture->setCells(cellArray<2>({{0, 1}}));
  test.setVelocity(*falling, {0, -1000, 0});
  test.step();
  EXPECT_LT(particle(*falling, 1).y(), -5);
  EXPECT_TRUE(logged().empty());
}

TEST(PalpateScene, ErrorsAreLoggedOnceAndEnd) {
  TestScene test;
  const auto falling = test.deformable("falling", triangle({0.1, 1, 0.1}, 0.2));
  const auto interaction = test.guardOnly(falling, test.floor(sheet({0, 0, 0})));
  test.scene->initialize();
  test.step();
  const Vec3d good = particle(*falling);
  particle(*falling) = Vec3d::Constant(std::numeric_limits<double>::quiet_NaN());
  test.step(3);
  ASSERT_EQ(logged().size(), 1u);
  EXPECT_NE(logged()[0].find("\"falling\""), std::string::npos);
  EXPECT_FALSE(test.palpateScene.trusted());
  EXPECT_NE(test.palpateScene.error(), "");
  EXPECT_TRUE(interaction->getCollisionDetection()->getCollisionData()->elementsA.empty());
  particle(*falling) = good;
  (*falling->getPbdBody()->prevVertices)[0] = good;
  velocity(*falling) = Vec3d::Zero();
  test.step();
  EXPECT_EQ(test.palpateScene.error(), "");
  EXPECT_TRUE(test.palpateScene.trusted());
}

TEST(PalpateScene, AnErrorOfTheGuardIsLoggedOnce) {
  TestScene test;
  const auto box = std::make_shared<imstk::OrientedBox>();  // half of it is below the floor
  test.guardOnly(test.floor(sheet({0, 0, 0})), test.tool(box));
  test.scene->initialize();
  for (int i = 1; i <= 3; ++i) {
    box->setPosition({0, -0.01 * i, 0});
    test.step();
    EXPECT_EQ(test.palpateScene.error(), logged().at(0).substr(9));
  }
  EXPECT_EQ(logged().size(), 1u);
}

TEST(PalpateScene, OnlyInteractionsWithPalpateCDAreShared) {
  TestScene test;
  EXPECT_EQ(
      test.palpateScene.makeCollision(test.tool(sheet({0, 0, 0})), test.tool(sheet({0, 1, 0}))),
      nullptr);
  EXPECT_EQ(logged().size(), 1u);
}

TEST(PalpateScene, MethodsHaveNames) {
  EXPECT_STREQ(palpate::toString(palpate::PalpateMethod::Default), "Default");
  EXPECT_STREQ(palpate::toString(static_cast<palpate::PalpateMethod>(99)), "unknown");
}

}  // namespace
