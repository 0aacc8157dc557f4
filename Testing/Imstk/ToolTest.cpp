// A rigid tool that a device leads into tissue: its force, and when the adapter sweeps further.
#include "Trials.h"

#include <imstkPbdConstraint.h>
#include <imstkPbdSolver.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace {

struct Pressed {
  std::vector<double> forces, heights;  // after each step
};

Pressed pressed(const trials::Press& press) {
  const auto trial = trials::toolAndTissue(true, press);
  trial->test.scene->initialize();
  Pressed result;
  for (int step = 0; step < trial->steps; ++step) {
    trial->move(step);
    trial->test.step();
    EXPECT_TRUE(trial->test.palpateScene.trusted()) << press.tool << ", step " << step;
    EXPECT_EQ(trial->test.palpateScene.held(), 0u) << press.tool << ", step " << step;
    result.forces.push_back(trial->force());
    result.heights.push_back(particle(*trial->tool).y());
  }
  EXPECT_TRUE(logged().empty());
  return result;
}

TEST(Tool, FeelsTheConvergedForceWithTenIterations) {
  for (const char* tool : {"mesh", "box", "capsule", "sphere"}) {
    const Pressed few = pressed({tool, true, 10}), many = pressed({tool, true, 50});
    const double most = *std::max_element(many.forces.begin(), many.forces.end());
    EXPECT_GT(most, 190) << tool;  // the device is 0.4 behind a surface that does not yield
    for (std::size_t i = 0; i < 400; ++i) {
      const double converged = many.forces[i];
      // At touch the force is small, and a share of it says little.
      const double allowed = 0.05 * (converged > 0.1 * most ? converged : most);
      EXPECT_NEAR(few.forces[i], converged, allowed) << tool << ", step " << i;
      // No step moves the tool further than the device.
      if (i > 0) {
        EXPECT_LE(std::abs(few.heights[i] - few.heights[i - 1]), trials::kPressPerStep)
            << tool << ", step " << i;
      }
      // In and out at one place of the device.
      if (i > 0 && i < 120 && converged > 0.1 * most) {
        EXPECT_NEAR(few.forces[400 - i], few.forces[i], allowed) << tool << ", step " << i;
      }
    }
    EXPECT_LT(few.forces.back(), 0) << tool;  // it leaves the tissue, behind the device
  }
}

/// In how many of 20 steps further sweeps are in the solver's lists.
int stepsWithSweeps(TestScene& test, const std::function<void()>& lead) {
  int count = 0;
  imstk::connect<imstk::Event>(test.scene, &imstk::Scene::configureTaskGraph, [&](imstk::Event*) {
    const auto look = [&] {
      for (const std::vector<imstk::PbdConstraint*>* list :
           test.model->getSolver()->getConstraintLists())
        count += !list->empty() && list->front()->getTypeName() == "PalpateTissueSweeps";
    };
    test.scene->getTaskGraph()->insertAfter(test.model->getSolveNode(),
                                            std::make_shared<imstk::TaskNode>(look));
  });
  test.scene->initialize();
  for (int i = 0; i < 20; ++i) {
    lead();
    test.step();
  }
  return count;
}

TEST(Tool, OnlyAToolThatAForceLeadsMakesFurtherSweeps) {
  const auto count = [](bool isGuarded, bool isWanted, double force, double height) {
    TestScene test;
    const auto organ = test.tissue(block(4, 2, 4, {-1, -1, -1}, {2, 1, 2}), 5000, 0.02);
    const auto tool = test.rigid("tool", cube({0, 0, 0}, 0.2), {0.03, height, 0.02});
    palpate::PalpateSettings settings;
    settings.thickness = 0.02;
    settings.guarded = isGuarded;
    settings.furtherSweeps = isWanted;
    test.collide(organ, tool, settings);
    return stepsWithSweeps(test, [&] { tool->getPbdBody()->externalForce = Vec3d(0, -force, 0); });
  };
  EXPECT_EQ(count(true, true, 10, 0.21), 20);
  EXPECT_EQ(count(false, true, 10, 0.21), 20);
  EXPECT_EQ(count(true, true, 0, 0.21), 0);
  EXPECT_EQ(count(true, true, 10, 0.8), 0);  // it does not touch
  EXPECT_EQ(count(true, false, 10, 0.21), 0);
}

}  // namespace
