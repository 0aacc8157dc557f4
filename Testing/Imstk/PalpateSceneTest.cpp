// The step of a scene: one detection, the guard, and what else moves bodies.
#include "Scenes.h"

#include <imstkPointToTetMap.h>
#include <imstkTriangleToTetMap.h>

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <string>
#include <thread>

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
  test.scene->reset();  // at the end of the next step
  test.palpateScene.restart();
  test.step();
  EXPECT_EQ(particle(*falling).y(), 1);
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

// The geometry of the tool is that which is drawn.
TEST(PalpateScene, AToolIsHeldWhereItIsDrawn) {
  for (const std::string kind : {"sphere", "turned box", "plane", "mesh"}) {
    TestScene test;
    const imstk::Quatd turn = imstk::Quatd(Eigen::AngleAxisd(0.3, Vec3d(1, 2, 3).normalized()));
    std::shared_ptr<imstk::Geometry> geometry =
        std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.5);
    if (kind == "turned box") {
      geometry =
          std::make_shared<imstk::OrientedBox>(Vec3d(0.02, 0, 0.01), Vec3d(0.2, 0.3, 0.4), turn);
      geometry->rotate(Vec3d(0, 1, 0), 0.4, imstk::Geometry::TransformType::ConcatenateToTransform);
    }
    if (kind == "plane")
      geometry = std::make_shared<imstk::Plane>(Vec3d(0, 0, 0), Vec3d(0.2, -1, 0.1));
    if (kind == "mesh") geometry = cube({0, 0, 0}, 0.3);
    const auto tool = test.tool(geometry);
    const auto floor = test.floor(sheet({0, 0, 0}));
    test.guardOnly(floor, tool);
    test.palpateScene.showHeld(tool);
    const auto at = [&] {
      if (kind == "mesh")
        return Vec3d(*positionsIn(dynamic_cast<imstk::PointSet&>(*geometry)).begin());
      if (kind == "plane") return dynamic_cast<imstk::Plane&>(*geometry).getPosition();
      return dynamic_cast<imstk::AnalyticalGeometry&>(*geometry).getPosition();
    };
    const auto put = [&](double height) {  // as a device does
      const Vec3d way(0, height - at().y(), 0);
      if (kind == "mesh") {
        for (Vec3d& p : positionsIn(dynamic_cast<imstk::PointSet&>(*geometry))) p += way;
      } else {
        auto& shape = dynamic_cast<imstk::AnalyticalGeometry&>(*geometry);
        shape.setPosition(shape.getPosition(imstk::Geometry::DataType::PreTransform) + way);
      }
    };
    put(1.5);
    test.scene->initialize();
    test.step();
    EXPECT_EQ(at().y(), 1.5) << kind;
    double last = 1.5;
    for (int i = 1; i <= 20; ++i) {
      put(1.5 - 0.2 * i);
      test.step();
      EXPECT_LE(at().y(), last) << kind;
      EXPECT_GT(at().y(), kind == "plane" ? 0.3 : kind == "mesh" ? -0.001 : 0.2) << kind;
      last = at().y();
    }
    EXPECT_GT(test.palpateScene.held(), 0u) << kind;
    EXPECT_LT(last, 0.7) << kind;
    test.step(3);  // the program does not move it
    EXPECT_EQ(test.palpateScene.held(), 0u) << kind;
    EXPECT_EQ(at().y(), last) << kind;
    put(2);
    test.step();
    EXPECT_EQ(test.palpateScene.held(), 0u) << kind;
    EXPECT_NEAR(at().y(), 2, 1e-12) << kind;
    EXPECT_TRUE(logged().empty()) << kind;
  }
}

TEST(PalpateScene, WhatItSaysMayBeReadFromOtherThreads) {
  TestScene test;
  const auto falling = test.deformable("falling", triangle({0.1, 1, 0.1}, 0.2));
  test.guardOnly(falling, test.floor(sheet({0, 0, 0})));
  test.scene->initialize();
  test.step();
  particle(*falling) = Vec3d::Constant(std::numeric_limits<double>::quiet_NaN());
  test.step();
  const std::string expected = test.palpateScene.error();
  EXPECT_NE(expected, "");
  std::atomic<bool> ends{false};
  std::size_t looks = 0, others = 0;
  std::thread other([&] {
    while (!ends) {
      ++looks;
      others += test.palpateScene.error() == expected && !test.palpateScene.trusted() ? 0u : 1u;
      test.palpateScene.restart();
    }
  });
  for (int i = 0; i < 200 || looks < 1000; ++i) test.step();
  ends = true;
  other.join();
  EXPECT_EQ(others, 0u);  // each step has this error: it never vanishes in between
  EXPECT_EQ(logged().size(), 1u);
}

TEST(PalpateScene, ARestartInTheMiddleOfAStepIsOfTwoWholeSteps) {
  TestScene test;
  const auto sphere = std::make_shared<imstk::Sphere>(Vec3d(0.1, 3, 0.1), 0.5);
  test.guardOnly(test.floor(sheet({0, 0, 0})), test.tool(sphere));
  bool restarts = false;
  imstk::connect<imstk::Event>(test.scene, &imstk::Scene::configureTaskGraph, [&](imstk::Event*) {
    test.scene->getTaskGraph()->insertAfter(test.model->getSolveNode(),
                                            std::make_shared<imstk::TaskNode>([&] {
                                              if (restarts) test.palpateScene.restart();
                                            }));
  });
  test.scene->initialize();
  test.step();
  test.palpateScene.restart();
  restarts = true;
  test.step();
  restarts = false;
  for (const double height : {-3.0, 3.0}) {
    sphere->setPosition({0.1, height, 0.1});
    test.step();
    EXPECT_EQ(test.palpateScene.held(), 0u) << height;
  }
  sphere->setPosition({0.1, -3, 0.1});
  test.step();
  EXPECT_EQ(test.palpateScene.held(), 1u);
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

TEST(PalpateScene, ACellThatNamesAVertexTwiceIsRemoved) {
  TestScene test;
  const auto mesh = block(1, 1, 1, {-0.5, -1, -0.5}, {1, 1, 1});
  const auto falling = test.deformable("falling", triangle({0, 1, 0}, 0.1));
  test.guardOnly(falling, test.floor(mesh));
  test.scene->initialize();
  test.setVelocity(*falling, {0, -1000, 0});
  test.step();
  EXPECT_GT(particle(*falling).y(), 0);
  for (Eigen::Vector4i& cell : valuesOf(mesh->getCells())) cell.setZero();
  test.setVelocity(*falling, {0, -1000, 0});
  test.step();
  EXPECT_LT(particle(*falling).y(), -5);
  EXPECT_TRUE(logged().empty());
}

TEST(PalpateScene, AMapOfPointsToTetrahedraIsRefusedAndOneOfTrianglesIsNot) {
  for (const bool ofTriangles : {false, true}) {
    TestScene test;
    const auto solid = block(1, 1, 1, {-0.5, 1, -0.5}, {1, 1, 1});
    const auto surface = solid->extractSurfaceMesh();
    std::shared_ptr<imstk::GeometryMap> map =
        std::make_shared<imstk::PointToTetMap>(solid, surface);
    if (ofTriangles) map = std::make_shared<imstk::TriangleToTetMap>(solid, surface);
    const auto body = test.deformable("mapped", solid);
    body->setCollidingGeometry(surface);
    body->setPhysicsToCollidingMap(map);
    const auto floor = test.floor(sheet({0, 0, 0}));
    test.collide(body, floor, {});
    // Other pairs of the scene are detected and guarded.
    const auto falling = test.deformable("falling", triangle({0.1, 0.5, 0.1}, 0.2));
    test.guardOnly(falling, floor);
    test.scene->initialize();
    test.setVelocity(*falling, {0, -1000, 0});
    test.setVelocity(*body, {0, -1000, 0});
    test.step(2);
    EXPECT_GT(particle(*falling).y(), 0);
    if (ofTriangles) {
      for (const Vec3d& p : valuesOf(body->getPbdBody()->vertices)) EXPECT_GT(p.y(), 0);
      EXPECT_TRUE(logged().empty());
    } else {
      EXPECT_LT(particle(*body).y(), -5);
      ASSERT_FALSE(logged().empty());
      EXPECT_NE(logged()[0].find("\"mapped\" does not collide"), std::string::npos);
      EXPECT_NE(logged()[0].find("PointToTetMap"), std::string::npos);
    }
  }
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

TEST(PalpateScene, WhatCrossesAtTheStartIsNamedAndGuardedOnceItIsApart) {
  for (const std::string kind : {"mesh", "box"}) {
    TestScene test;
    const auto box = std::make_shared<imstk::OrientedBox>(Vec3d(0.1, 0, 0.1));
    std::shared_ptr<imstk::Geometry> geometry = box;
    if (kind == "mesh") geometry = cube({0, 0, 0}, 0.5);
    const auto body = test.rigid("body", geometry, {0.1, 0.1, 0.1});
    const auto other = test.deformable("other", triangle({0.1, 3, 0.1}, 0.2));
    const auto floor = test.floor(sheet({0, 0, 0}));
    test.guardOnly(body, floor);
    test.guardOnly(other, floor);
    test.scene->initialize();
    ASSERT_EQ(logged().size(), 1u) << kind;
    EXPECT_NE(logged()[0].find("\"body\" and \"floor\" cross"), std::string::npos);
    test.setVelocity(*body, {0, 10, 0});
    test.setVelocity(*other, {0, -1000, 0});  // the other pair is guarded
    test.step(8);
    EXPECT_GT(particle(*body).y(), 0.8) << kind;
    EXPECT_GT(particle(*other).y(), 0) << kind;
    EXPECT_EQ(test.palpateScene.error(), "");
    ASSERT_EQ(logged().size(), 2u) << kind;
    EXPECT_NE(logged()[1].find("apart"), std::string::npos);
    test.setVelocity(*body, {0, -1000, 0});
    test.step();
    EXPECT_GT(particle(*body).y(), 0.4) << kind;
  }
}

TEST(PalpateScene, ACubeRestsOnAFloorByDefault) {
  for (const bool isShape : {false, true}) {
    TestScene test;
    test.config().m_gravity = {0, -9.81, 0};
    std::shared_ptr<imstk::Geometry> geometry = cube({0, 0, 0}, 0.25);
    if (isShape)
      geometry = std::make_shared<imstk::OrientedBox>(Vec3d(0, 0, 0), Vec3d(0.25, 0.25, 0.25));
    const auto body = test.rigid("cube", geometry, {0.1, 0.6, 0.1});
    test.collide(body, test.floor(sheet({0, 0, 0}, 4, 4)), {});
    test.scene->initialize();
    int untrusted = 0;
    for (int i = 0; i < 400; ++i) {
      test.step();
      untrusted += test.palpateScene.trusted() ? 0 : 1;
      const imstk::Quatd q = (*body->getPbdBody()->orientations)[0];
      for (int corner = 0; corner < 8; ++corner)
        ASSERT_GT((particle(*body) + q * cornerOf(corner, 0.25)).y(), 0)
            << isShape << ", step " << i;
    }
    EXPECT_EQ(untrusted, 0) << isShape;
    EXPECT_LT(velocity(*body).norm(), 0.5 * 9.81 * test.config().m_dt) << isShape;
    EXPECT_LT(particle(*body).y(), 0.27) << isShape;
    EXPECT_TRUE(logged().empty());
  }
}

TEST(PalpateScene, AToolThatIsHeldRestsWithTrust) {
  TestScene test;
  const auto sphere = std::make_shared<imstk::Sphere>(Vec3d(0.1, 1, 0.1), 0.3);
  palpate::PalpateSettings settings;
  settings.thickness = 0.1;
  test.collide(test.floor(sheet({0, 0, 0})), test.tool(sphere), settings);
  test.scene->initialize();
  test.step();
  sphere->setPosition({0.1, -0.5, 0.1});
  test.step(30);
  EXPECT_EQ(test.palpateScene.held(), 1u);
  for (int i = 0; i < 100; ++i) {
    test.step();
    ASSERT_TRUE(test.palpateScene.trusted()) << i;
  }
}

TEST(PalpateScene, AnInteractionNeedsAPbdObjectAndAHandler) {
  TestScene test;
  EXPECT_EQ(
      test.palpateScene.makeCollision(test.tool(sheet({0, 0, 0})), test.tool(sheet({0, 1, 0}))),
      nullptr);
  EXPECT_EQ(logged().size(), 1u);
  const auto interaction = std::make_shared<imstk::PbdObjectCollision>(
      test.deformable("cloth", sheet({0, 1, 0})), test.floor(sheet({0, 0, 0})));
  interaction->setCollisionHandlingAB(nullptr);
  EXPECT_FALSE(test.palpateScene.share(interaction));
  EXPECT_EQ(logged().size(), 2u);
}

TEST(PalpateScene, MethodsHaveNames) {
  EXPECT_STREQ(palpate::toString(palpate::PalpateMethod::Default), "Default");
  EXPECT_STREQ(palpate::toString(static_cast<palpate::PalpateMethod>(99)), "unknown");
}

}  // namespace
