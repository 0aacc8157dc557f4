// One-sided constraints, on particles, rigid bodies and against what does not move.
#include "Scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace {

palpate::PalpateSettings within(double thickness) {
  palpate::PalpateSettings settings;
  settings.thickness = thickness;
  return settings;
}

TEST(PalpateCH, PushesToTheGapAndNeverPulls) {
  for (const double start : {0.05, 0.15}) {
    TestScene test;
    const auto cloth = test.deformable("cloth", sheet({0, start, 0}));
    test.collide(cloth, test.floor(sheet({0, 0, 0}, 3, 4)), within(0.2));  // the gap is 0.1
    test.scene->initialize();
    test.step();
    for (size_t i = 0; i < 9; ++i)
      EXPECT_NEAR(particle(*cloth, i).y(), std::max(start, 0.1), 1e-9) << start;
    EXPECT_TRUE(logged().empty());
  }
}

TEST(PalpateCH, AClothRestsOnAFloorUnderGravity) {
  TestScene test;
  test.config().m_gravity = {0, -9.81, 0};
  const auto cloth = test.deformable("cloth", sheet({0, 0.3, 0}));
  test.collide(test.floor(sheet({0, 0, 0}, 3, 4)), cloth, within(0.2));
  test.scene->initialize();
  test.step(100);
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(particle(*cloth, i).y(), 0.1, 1e-3);
    EXPECT_NEAR(velocity(*cloth, i).y(), 0, 1e-4);
  }
  EXPECT_TRUE(logged().empty());
}

TEST(PalpateCH, FrictionIsCoulombs) {
  // Deceleration is the coefficient times gravity, until the cloth stops.
  TestScene test;
  test.config().m_gravity = {0, -10, 0};
  const auto cloth = test.deformable("cloth", triangle({0.3, 0.1, 0.2}, 0.1));
  test.collide(cloth, test.floor(sheet({0, 0, 0}, 1, 10)), within(0.2))->setFriction(0.5);
  test.scene->initialize();
  test.setVelocity(*cloth, {1, 0, 0});
  test.step(10);
  EXPECT_NEAR(velocity(*cloth).x(), 1 - 0.5 * 10 * 10 * test.config().m_dt, 1e-6);
  test.step(30);
  EXPECT_NEAR(velocity(*cloth).x(), 0, 1e-9);
}

TEST(PalpateCH, AToolThatSlidesDragsByFriction) {
  TestScene test;
  test.config().m_gravity = {0, -10, 0};
  const auto plane = std::make_shared<imstk::Plane>();
  const auto cloth = test.deformable("cloth", triangle({0.3, 0.1, 0.2}, 0.1));
  test.collide(cloth, test.tool(plane), within(0.2))->setFriction(0.5);
  test.scene->initialize();
  for (int i = 1; i <= 60; ++i) {
    plane->setPosition({0.01 * i, 0, 0});  // at speed 1
    test.step();
  }
  EXPECT_NEAR(velocity(*cloth).x(), 1, 1e-6);
  EXPECT_NEAR(particle(*cloth).y(), 0.1, 1e-6);
}

TEST(PalpateCH, AToolAtRestThatTheGuardHoldsDoesNotDrag) {
  // A wall stops a plate on which a cloth lies. The program leads the plate on and lets it rest.
  TestScene test;
  test.config().m_gravity = {0, -10, 0};
  const auto plate = std::make_shared<imstk::OrientedBox>(Vec3d(0, -0.1, 0), Vec3d(1, 0.1, 1));
  const auto wall = std::make_shared<imstk::SurfaceMesh>();
  wall->initialize(positionArray({{1.3, -1, -1}, {1.3, -1, 1}, {1.3, -0.05, 0}}),
                   cellArray<3>({{0, 1, 2}}));
  const auto cloth = test.deformable("cloth", triangle({0, 0.1, 0}, 0.1));
  const auto tool = test.tool(plate);
  test.collide(cloth, tool, within(0.2))->setFriction(0.2);
  test.guardOnly(test.floor(wall), tool);
  test.scene->initialize();
  for (int i = 1; i <= 40; ++i) {
    plate->setPosition({0.02 * i, -0.1, 0});
    test.step();
  }
  EXPECT_GT(velocity(*cloth).x(), 0.5);
  test.step(80);
  EXPECT_EQ(test.palpateScene.held(), 1u);
  EXPECT_NEAR(velocity(*cloth).x(), 0, 1e-6);
}

TEST(PalpateCH, TissueGivesWayToAToolAsWithoutTheGuardAndLetsItGo) {
  // A tool on a spring, as a haptic device holds it, is pressed into tissue, held and drawn back.
  const std::shared_ptr<imstk::Geometry> tools[] = {
      std::make_shared<imstk::Capsule>(
          Vec3d(0, 0, 0), 0.2, 0.6, imstk::Quatd::FromTwoVectors(Vec3d(0, 1, 0), Vec3d(1, 0, 0))),
      std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.2),
      std::make_shared<imstk::OrientedBox>(Vec3d(0, 0, 0), Vec3d(0.2, 0.2, 0.2)),
      cube({0, 0, 0}, 0.2)};
  for (int kind = 0; kind < 4; ++kind) {
    std::vector<double> forces[2];
    for (const bool guarded : {false, true}) {
      TestScene test;
      const auto mesh = block(4, 3, 4, {-1, -1, -1}, {2, 1, 2});
      const auto tissue = test.deformable("tissue", mesh);
      for (int i = 0; i < mesh->getNumVertices(); ++i)
        if (mesh->getVertexPosition(i).y() == -1) tissue->getPbdBody()->fixedNodeIds.push_back(i);
      tissue->getPbdBody()->uniformMassValue = 0.02;
      test.config().m_linearDampingCoeff = 0.03;
      test.config().enableFemConstraint(imstk::PbdFemConstraint::MaterialType::NeoHookean, 5000,
                                        0.4, tissue->getPbdBody()->bodyHandle);
      const auto tool = test.rigid("tool", tools[kind], {0.03, 0.3, 0.02});
      palpate::PalpateSettings settings = within(0.01);
      settings.guarded = guarded;
      test.collide(tissue, tool, settings);
      test.scene->initialize();
      imstk::PbdBody& body = *tool->getPbdBody();
      (*body.invInertias)[0].setZero();  // it does not turn
      constexpr double kStiffness = 500;
      const double damping = 2 * std::sqrt(kStiffness);  // of mass 1
      for (int i = 0; i < 240; ++i) {
        const double way = std::min(1.0, std::min(i, 240 - i) / 80.0);
        const Vec3d device(0.03, 0.3 - 0.45 * way, 0.02), before = particle(*tool);
        body.externalForce = kStiffness * (device - before) - damping * velocity(*tool);
        test.step();
        EXPECT_LT((particle(*tool) - before).norm(), 2 * 0.45 / 80) << kind << ", step " << i;
        EXPECT_TRUE(!guarded || test.palpateScene.trusted()) << kind << ", step " << i;
        forces[guarded].push_back(kStiffness * (device - particle(*tool)).y());
      }
      EXPECT_LT(forces[guarded][120], -60) << kind;
      EXPECT_TRUE(logged().empty());
    }
    for (std::size_t i = 0; i < forces[0].size(); ++i)
      EXPECT_NEAR(forces[1][i], forces[0][i], 0.05 * std::abs(forces[0][120]))
          << kind << ", step " << i;
  }
}

TEST(PalpateCH, ADisabledInteractionDoesNotPush) {
  TestScene test;
  const auto cloth = test.deformable("cloth", sheet({0, 0.05, 0}));
  const auto interaction = test.collide(cloth, test.floor(sheet({0, 0, 0}, 3, 4)), within(0.2));
  test.scene->initialize();
  interaction->setEnabled(false);
  test.step();
  EXPECT_EQ(particle(*cloth).y(), 0.05);
  interaction->setEnabled(true);
  test.step();
  EXPECT_NEAR(particle(*cloth).y(), 0.1, 1e-9);
}

TEST(PalpateCH, WhatHasAnotherMeaningIsNamedOnce) {
  for (const bool isRigid : {false, true}) {
    TestScene test;
    const auto body = isRigid ? test.rigid("body", cube({0, 0, 0}, 0.2), {0, 0.25, 0})
                              : test.deformable("body", sheet({0, 0.05, 0}));
    const auto interaction = test.collide(body, test.floor(sheet({0, 0, 0}, 3, 4)), within(0.2));
    interaction->setRestitution(0.5);
    interaction->setFriction(0.5);
    interaction->setRigidBodyCompliance(1e-4);
    if (!isRigid) interaction->setDeformableStiffnessA(0.9);
    test.scene->initialize();
    test.step(3);
    ASSERT_EQ(logged().size(), isRigid ? 0u : 2u);
    if (isRigid) continue;
    EXPECT_NE(logged()[0].find("stiffness"), std::string::npos) << logged()[0];
    EXPECT_NE(logged()[1].find("Coulomb"), std::string::npos) << logged()[1];
  }
}

TEST(PalpateCH, RestitutionIsTheShareOfTheSpeed) {
  // A ball, a box, a cube of triangles and a cloth meet a floor at speed 2, without gravity and
  // with.
  for (const double gravity : {0.0, 10.0})
    for (int kind = 0; kind < 4; ++kind)
      for (const double restitution : {0.0, 0.3, 1.0}) {
        TestScene test;
        test.config().m_gravity = {0, -gravity, 0};
        const std::shared_ptr<imstk::Geometry> bodies[] = {
            std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.2),
            std::make_shared<imstk::OrientedBox>(Vec3d(0, 0, 0), Vec3d(0.2, 0.2, 0.2)),
            cube({0, 0, 0}, 0.2)};
        const auto body = kind < 3 ? test.rigid("body", bodies[kind], {0.03, 0.4, 0.02})
                                   : test.deformable("body", sheet({0.03, 0.2, 0.02}, 2, 0.5));
        const auto interaction =
            test.collide(body, test.floor(sheet({0, 0, 0}, 3, 4)), within(0.05));
        interaction->setRestitution(restitution);
        test.scene->initialize();
        test.setVelocity(*body, {0, -2, 0});
        double down = 0, up = 0;
        for (int i = 0; i < 30 && (up <= 0 || gravity == 0); ++i) {
          down = std::min(down, velocity(*body).y());
          test.step();
          up = velocity(*body).y();
        }
        const double lost = 2 * gravity * test.config().m_dt;
        // PbdSolver turns a body with several contacts a little.
        const double turned = kind == 1 || kind == 2 ? 0.1 * -down : 1e-6;
        EXPECT_NEAR(up, restitution * -down, turned + lost) << kind << ", " << restitution;
      }
}

TEST(PalpateCH, RestitutionDoesNotKeepARestingBodyAwake) {
  TestScene test;
  test.config().m_gravity = {0, -10, 0};
  const auto body = test.rigid("body", cube({0, 0, 0}, 0.2), {0.03, 0.23, 0.02});
  test.collide(body, test.floor(sheet({0, 0, 0}, 3, 4)), within(0.05))->setRestitution(0.9);
  test.scene->initialize();
  test.step(100);
  EXPECT_LT(velocity(*body).norm(), 10 * test.config().m_dt);
  EXPECT_NEAR(particle(*body).y(), 0.225, 0.01);
}

TEST(PalpateCH, ComplianceIsTheWayThatAForceMakes) {
  for (const double compliance : {0.0, 1e-4, 5e-4}) {
    TestScene test;
    test.config().m_gravity = {0, -10, 0};
    const auto ball =
        test.rigid("ball", std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.2), {0, 0.22, 0});
    test.collide(ball, test.floor(sheet({0, 0, 0}, 1, 4)), within(0.04))
        ->setRigidBodyCompliance(compliance);
    test.scene->initialize();
    test.step(200);
    EXPECT_NEAR(particle(*ball).y(), 0.22 - 10 * compliance, 2e-4) << compliance;  // mass 1
  }
}

TEST(PalpateCH, AMappedSurfaceMovesItsParticles) {
  TestScene test;
  // The physics mesh has its vertices in another order, and one that the surface does not have.
  const auto surface = triangle({0.3, 0.05, 0.2}, 0.1);
  const auto range = positionsIn(*surface);
  const std::vector<Vec3d> positions(range.begin(), range.end());
  const auto physics = std::make_shared<imstk::PointSet>();
  physics->initialize(positionArray({{0, 5, 0}, positions[2], positions[0], positions[1]}));
  const auto body = std::make_shared<imstk::PbdObject>("mapped");
  body->setPhysicsGeometry(physics);
  body->setCollidingGeometry(surface);
  const auto map = std::make_shared<imstk::PointwiseMap>(physics, surface);
  map->setMap({{0, 2}, {1, 3}, {2, 1}});
  body->setPhysicsToCollidingMap(map);
  body->setDynamicalModel(test.model);
  test.scene->addSceneObject(body);
  test.collide(body, test.floor(sheet({0, 0, 0}, 1, 4)), within(0.2));
  test.scene->initialize();
  test.step();
  EXPECT_EQ(particle(*body, 0), Vec3d(0, 5, 0));
  for (size_t i = 1; i < 4; ++i) EXPECT_NEAR(particle(*body, i).y(), 0.1, 1e-9);
  EXPECT_EQ(particle(*body, 2).x(), positions[0].x());
  // The guard, too, moves particles through the map.
  test.setVelocity(*body, {0, -1000, 0});
  test.step();
  EXPECT_LT(particle(*body, 0).y(), -4);
  for (size_t i = 1; i < 4; ++i) EXPECT_GT(particle(*body, i).y(), 0);
  EXPECT_TRUE(logged().empty());
}

TEST(PalpateCH, ARigidBodyTurnsWhereItIsHit) {
  for (const bool isShape : {false, true}) {
    TestScene test;
    test.config().m_iterations = 100;
    std::shared_ptr<imstk::Geometry> geometry = sheet({0, 0, 0}, 1, 1);
    if (isShape)
      geometry = std::make_shared<imstk::Capsule>(
          Vec3d(0, 0, 0), 0.01, 1.0,
          imstk::Quatd::FromTwoVectors(Vec3d(0, 1, 0), Vec3d(1, 0, 0)));  // along x
    const auto body = test.rigid("body", geometry, {0, 0, 0});
    const auto ball = std::make_shared<imstk::PointSet>();
    ball->initialize(positionArray({{0.4, -0.05, 0}}));
    test.collide(body, test.floor(ball), within(0.4));  // the gap is 0.2
    test.scene->initialize();
    test.step();
    const double arm = 0.4, inverse = 1 / (1 + arm * arm);  // mass and inertia are 1
    const double push = isShape ? 0.2 - 0.04 : 0.15;
    EXPECT_NEAR(particle(*body).y(), push * inverse, 0.1 * push) << isShape;
    const double angle = 2 * (*body->getPbdBody()->orientations)[0].z();
    EXPECT_NEAR(angle, push * arm * inverse, 0.1 * push) << isShape;
    EXPECT_TRUE(logged().empty());
  }
}

TEST(PalpateCH, TwoRigidShapesPart) {
  TestScene test;
  const auto a = test.rigid("a", std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.5), {0, 0, 0});
  const auto b = test.rigid("b", std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.5), {0, 0.9, 0});
  test.collide(a, b, within(0.2));
  test.scene->initialize();
  test.step();
  EXPECT_NEAR(particle(*b).y() - particle(*a).y(), 1.1, 1e-6);
  EXPECT_NEAR(particle(*b).y() + particle(*a).y(), 0.9, 1e-9);
}

TEST(PalpateCH, AClothTouchesItself) {
  TestScene test;
  // Two sheets in one mesh.
  const auto low = sheet({0, 0, 0}, 1, 2), high = sheet({0.1, 0.05, 0.1}, 1, 2);
  const auto positionsOfLow = positionsIn(*low);
  const auto cellsOfLow = valuesOf(low->getCells());
  std::vector<Vec3d> positions(positionsOfLow.begin(), positionsOfLow.end());
  std::vector<Eigen::Vector3i> cells(cellsOfLow.begin(), cellsOfLow.end());
  for (const Vec3d& p : positionsIn(*high)) positions.push_back(p);
  for (const Eigen::Vector3i& cell : valuesOf(high->getCells()))
    cells.push_back(cell + Eigen::Vector3i::Constant(4));
  const auto mesh = std::make_shared<imstk::SurfaceMesh>();
  mesh->initialize(positionArray(positions), cellArray<3>(cells));
  const auto cloth = test.deformable("cloth", mesh);
  test.collide(cloth, cloth, within(0.2));
  test.config().m_iterations = 50;
  test.scene->initialize();
  test.step();
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_LT(particle(*cloth, i).y(), -0.01) << i;
    EXPECT_GT(particle(*cloth, i + 4).y(), 0.06) << i;
  }
  EXPECT_TRUE(logged().empty());
}

}  // namespace
