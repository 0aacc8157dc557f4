// Scenes of some hundred steps in which bodies fall, judged without Palpate: nothing passes.
#include "Scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace {

using Real = long double;
using Vector = Eigen::Matrix<Real, 3, 1>;

struct PlacedCube {
  Vector centre;
  Eigen::Matrix<Real, 3, 3> axes;
};

PlacedCube placed(imstk::PbdObject& cube) {
  const imstk::Quatd q = (*cube.getPbdBody()->orientations)[0];
  return {particle(cube).cast<Real>(), q.normalized().toRotationMatrix().cast<Real>()};
}

/// The widest gap along the fifteen axes that separate two boxes; negative if they overlap.
Real gapOf(const PlacedCube& a, const PlacedCube& b, Real half) {
  Real widest = -1e30L;
  const auto look = [&](const Vector& axis) {
    if (axis.norm() < 1e-9L) return;
    const Vector n = axis.normalized();
    const Real reach = half * ((a.axes.transpose() * n).cwiseAbs().sum() +
                               (b.axes.transpose() * n).cwiseAbs().sum());
    widest = std::max(widest, std::abs(n.dot(b.centre - a.centre)) - reach);
  };
  for (int i = 0; i < 3; ++i) {
    look(a.axes.col(i));
    look(b.axes.col(i));
    for (int k = 0; k < 3; ++k) look(a.axes.col(i).cross(b.axes.col(k)));
  }
  return widest;
}

TEST(Rest, CubesFallOnAHeap) {
  for (const bool isShape : {false, true}) {
    TestScene test;
    test.config().m_gravity = {0, -9.81, 0};
    test.config().m_linearDampingCoeff = test.config().m_angularDampingCoeff = 0.02;
    const auto floor = test.floor(sheet({0, 0, 0}, 4, 6));
    std::vector<std::shared_ptr<imstk::PbdObject>> cubes;
    for (int i = 0; i < 4; ++i) {
      std::shared_ptr<imstk::Geometry> geometry = cube({0, 0, 0}, 0.25);
      if (isShape)
        geometry = std::make_shared<imstk::OrientedBox>(Vec3d(0, 0, 0), Vec3d(0.25, 0.25, 0.25));
      cubes.push_back(test.rigid("cube", geometry, {0.06 * i, 0.4 + 0.7 * i, 0.04 * i}));
      (*cubes.back()->getPbdBody()->inertias)[0] = imstk::Mat3d::Identity() * 0.25 / 6;
      test.collide(cubes.back(), floor, {})->setFriction(0.5);
      for (int k = 0; k < i; ++k) test.collide(cubes[i], cubes[k], {})->setFriction(0.5);
    }
    test.scene->initialize();
    Real least = 1, lowest = 1;
    int untrusted = 0;
    for (int step = 0; step < 400; ++step) {
      test.step();
      untrusted += test.palpateScene.trusted() ? 0 : 1;
      for (std::size_t i = 0; i < cubes.size(); ++i) {
        const PlacedCube a = placed(*cubes[i]);
        lowest = std::min(lowest, a.centre.y() - 0.25L * a.axes.row(1).cwiseAbs().sum());
        for (std::size_t k = 0; k < i; ++k)
          least = std::min(least, gapOf(a, placed(*cubes[k]), 0.25L));
      }
    }
    double fastest = 0;
    for (const auto& body : cubes) fastest = std::max(fastest, velocity(*body).norm());
    EXPECT_GT(least, 0) << isShape;
    EXPECT_GT(lowest, 0) << isShape;
    EXPECT_EQ(untrusted, 0) << isShape;
    // Two boxes as shapes have one contact, on which they still rock.
    if (!isShape) {
      EXPECT_LT(fastest, 0.01);
    }
    EXPECT_TRUE(logged().empty());
  }
}

TEST(Rest, AClothFallsOnACapsule) {
  TestScene test;
  test.config().m_gravity = {0, -9.81, 0};
  test.config().m_linearDampingCoeff = 0.02;
  const auto mesh = sheet({0, 0.7, 0}, 14);
  const auto cloth = test.deformable("cloth", mesh);
  cloth->getPbdBody()->uniformMassValue = 0.01;
  const int handle = cloth->getPbdBody()->bodyHandle;
  test.config().enableConstraint(imstk::PbdModelConfig::ConstraintGenType::Distance, 1000, handle);
  const Vec3d centre(0.02, 0, 0.03);
  const auto capsule = std::make_shared<imstk::Capsule>(
      centre, 0.3, 1.0, imstk::Quatd::FromTwoVectors(Vec3d(0, 1, 0), Vec3d(1, 0, 0)));
  test.collide(cloth, test.tool(capsule), {})->setFriction(0.6);
  test.scene->initialize();
  double least = 1;
  int untrusted = 0;
  for (int step = 0; step < 200; ++step) {
    test.step();
    untrusted += test.palpateScene.trusted() ? 0 : 1;
    for (const Eigen::Vector3i& cell : valuesOf(mesh->getCells()))
      for (int u = 0; u <= 6; ++u)
        for (int v = 0; u + v <= 6; ++v) {
          const Vec3d p = (u * particle(*cloth, cell[0]) + v * particle(*cloth, cell[1]) +
                           (6 - u - v) * particle(*cloth, cell[2])) /
                          6;
          const double along = std::clamp((p - centre).x(), -0.5, 0.5);
          least = std::min(least, (p - centre - Vec3d(along, 0, 0)).norm() - 0.3);
        }
  }
  EXPECT_GT(least, 0);
  EXPECT_GT(particle(*cloth, 112).y(), 0.3);  // it lies on the capsule
  EXPECT_EQ(untrusted, 0);
  EXPECT_EQ(logged().size(), 1u);  // of friction
}

}  // namespace
