// iMSTK's own classes over PalpateCD: pickers, needles, cuts, removed cells, stitches, grasps, and
// the text of forces.
#include "Scenes.h"

#include <imstkCDObjectFactory.h>
#include <imstkCellPicker.h>
#include <imstkControllerForceText.h>
#include <imstkDummyClient.h>
#include <imstkNeedleInteraction.h>
#include <imstkPbdObjectCellRemoval.h>
#include <imstkPbdObjectController.h>
#include <imstkPbdObjectCutting.h>
#include <imstkPbdObjectGrasping.h>
#include <imstkPbdObjectStitching.h>
#include <imstkPuncturable.h>
#include <imstkRenderMaterial.h>
#include <imstkTextVisualModel.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

namespace {

using Real = long double;
using Vector = Eigen::Matrix<Real, 3, 1>;

/// The distance of a point from a triangle, the least of its interior and its edges.
Real distanceToSegment(const Vector& p, const Vector& a, const Vector& b) {
  const Vector ab = b - a;
  const Real t = std::clamp(ab.dot(p - a) / ab.squaredNorm(), Real(0), Real(1));
  return (p - a - t * ab).norm();
}
Real distanceToTriangle(const Vector& p, const Vector& a, const Vector& b, const Vector& c) {
  Real least = std::min(
      {distanceToSegment(p, a, b), distanceToSegment(p, b, c), distanceToSegment(p, c, a)});
  const Vector n = (b - a).cross(c - a);
  const Real side[] = {n.dot((b - a).cross(p - a)), n.dot((c - b).cross(p - b)),
                       n.dot((a - c).cross(p - c))};
  if (side[0] >= 0 && side[1] >= 0 && side[2] >= 0)
    least = std::min(least, std::abs(n.dot(p - a)) / n.norm());
  return least;
}

std::vector<imstk::PickData> picked(const std::shared_ptr<imstk::Geometry>& body,
                                    const std::shared_ptr<imstk::Geometry>& shape) {
  imstk::CellPicker picker;
  picker.setPickingGeometry(shape);
  picker.setCollisionDetection(imstk::CDObjectFactory::makeCollisionDetection("PalpateCD"));
  return picker.pick(body);
}

TEST(Classes, APickerPicksEachCellThatASphereTouchesOnce) {
  std::size_t cells = 0;
  for (int i = 0; i < 200; ++i) {
    const auto mesh = sheet({0, 0, 0}, 8);
    for (Vec3d& p : positionsIn(*mesh)) p.y() = 0.1 * std::sin(5 * p.x()) * std::cos(3 * p.z());
    const Vec3d centre(0.9 * std::sin(1.7 * i), 0.2 * std::sin(2.9 * i), 0.9 * std::cos(2.3 * i));
    const double radius = 0.05 + 0.4 * (i % 7) / 7;
    std::set<int> expected, found;
    int index = 0;
    for (const Eigen::Vector3i& cell : valuesOf(mesh->getCells())) {
      const auto corner = [&](int k) -> Vector {
        return (*mesh->getVertexPositions())[cell[k]].cast<Real>();
      };
      if (distanceToTriangle(centre.cast<Real>(), corner(0), corner(1), corner(2)) <= radius)
        expected.insert(index);
      ++index;
    }
    for (const imstk::PickData& data :
         picked(mesh, std::make_shared<imstk::Sphere>(centre, radius))) {
      EXPECT_GE(data.cellId, 0) << i;
      EXPECT_TRUE(found.insert(data.cellId).second) << i << ": cell " << data.cellId << " twice";
    }
    EXPECT_EQ(found, expected) << i;
    cells += expected.size();
  }
  EXPECT_GT(cells, 1000u);
}

/// A tetrahedron's surface that slants through the plane y = 0. The contact of its tip has the cell
/// next to the tip, and not the cells that its sides pierce.
std::shared_ptr<imstk::SurfaceMesh> spike(int i) {
  const double s = std::sin(1.7 * i), c = std::cos(1.7 * i);
  const Vec3d top(0.3 * s, 0.5, 0.2 * c);
  auto mesh = std::make_shared<imstk::SurfaceMesh>();
  mesh->initialize(positionArray({top, top + 0.1 * Vec3d(c, 0, s), top + 0.1 * Vec3d(-s, 0, c),
                                  Vec3d(0.5 * c, -0.6, 0.4 * s)}),
                   cellArray<3>({{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}}));
  return mesh;
}

TEST(Classes, APickerPicksEachCellThatASurfaceIntersectsOnce) {
  std::size_t cells = 0;
  for (int i = 0; i < 60; ++i) {
    const bool isSpike = i >= 30;
    const auto mesh = sheet({0, 0, 0}, 8),
               blade = isSpike ? spike(i) : sheet({0.03, 0.01, 0.02}, 5, 1.3);
    if (!isSpike) {
      for (Vec3d& p : positionsIn(*mesh))
        p.y() = 0.2 * std::sin(5 * p.x() + i) * std::cos(3 * p.z());
      for (Vec3d& p : positionsIn(*blade))
        p.y() = 0.3 * std::cos(4 * p.x() - i) * std::sin(2 * p.z() + i);
    }
    const auto cornersOf = [](imstk::SurfaceMesh& of, const Eigen::Vector3i& cell) {
      std::array<Vector, 3> corners;
      for (int k = 0; k < 3; ++k)
        corners[static_cast<size_t>(k)] = (*of.getVertexPositions())[cell[k]].cast<Real>();
      return corners;
    };
    const auto pierces = [](const std::array<Vector, 3>& edges, const std::array<Vector, 3>& t) {
      const auto volume = [](const Vector& a, const Vector& b, const Vector& c, const Vector& d) {
        return (b - a).cross(c - a).dot(d - a);
      };
      for (int k = 0; k < 3; ++k) {
        const Vector &p = edges[static_cast<size_t>(k)],
                     &q = edges[static_cast<size_t>((k + 1) % 3)];
        const Real sides[] = {volume(p, q, t[0], t[1]), volume(p, q, t[1], t[2]),
                              volume(p, q, t[2], t[0])};
        if (volume(t[0], t[1], t[2], p) * volume(t[0], t[1], t[2], q) < 0 &&
            sides[0] * sides[1] > 0 && sides[1] * sides[2] > 0)
          return true;
      }
      return false;
    };
    std::set<int> expected, found;
    for (int a = 0; a < mesh->getNumCells(); ++a)
      for (const Eigen::Vector3i& b : valuesOf(blade->getCells())) {
        const auto x = cornersOf(*mesh, (*mesh->getCells())[a]), y = cornersOf(*blade, b);
        if (pierces(x, y) || pierces(y, x)) expected.insert(a);
      }
    for (const imstk::PickData& data : picked(mesh, blade))
      EXPECT_TRUE(found.insert(data.cellId).second) << i << ": cell " << data.cellId << " twice";
    for (const int cell : expected) EXPECT_EQ(found.count(cell), 1u) << i << ": cell " << cell;
    cells += expected.size();
  }
  EXPECT_GT(cells, 200u);
}

TEST(Classes, APickerPicksCellsOfEveryMeshByEveryShape) {
  const auto line = std::make_shared<imstk::LineMesh>();
  line->initialize(positionArray({{-1, 0, 0}, {0, 0, 0}, {1, 0, 0}}),
                   cellArray<2>({{0, 1}, {1, 2}}));
  const std::shared_ptr<imstk::Geometry> shapes[] = {
      std::make_shared<imstk::Sphere>(Vec3d(0.5, 0, 0), 0.3),
      std::make_shared<imstk::Capsule>(Vec3d(0.5, 0, 0), 0.2, 0.3),
      std::make_shared<imstk::Cylinder>(Vec3d(0.5, 0, 0), 0.2, 0.6),
      std::make_shared<imstk::OrientedBox>(Vec3d(0.5, 0, 0), Vec3d(0.2, 0.2, 0.2))};
  const auto solid = block(2, 2, 2, {-1, -1, -1}, {2, 1.1, 2});
  for (const auto& shape : shapes) {
    const auto ofLine = picked(line, shape);
    ASSERT_EQ(ofLine.size(), 1u) << shape->getTypeName();
    EXPECT_EQ(ofLine[0].cellId, 1);
    std::set<int> found;
    for (const imstk::PickData& data : picked(solid, shape)) {
      EXPECT_TRUE(found.insert(data.cellId).second) << shape->getTypeName();
      EXPECT_GE(data.cellId, 0);
      EXPECT_LT(data.cellId, solid->getNumCells());
    }
    EXPECT_FALSE(found.empty()) << shape->getTypeName();
  }
  const auto points = std::make_shared<imstk::PointSet>();
  points->initialize(positionArray({{0.5, 0.1, 0}, {0, 0, 5}, {0.45, 0, 0}}));
  std::set<int> vertices;
  for (const imstk::PickData& data : picked(points, shapes[0])) vertices.insert(data.ids[0]);
  EXPECT_EQ(vertices, (std::set<int>{0, 2}));
}

/// Where the line x = x0, z = z0 crosses the surface: the triangles, from above to below.
std::vector<int> trianglesBelow(imstk::SurfaceMesh& surface, double x, double z) {
  std::map<Real, int, std::greater<>> found;
  int index = 0;
  for (const Eigen::Vector3i& cell : valuesOf(surface.getCells())) {
    Vector corners[3];
    for (int k = 0; k < 3; ++k) corners[k] = (*surface.getVertexPositions())[cell[k]].cast<Real>();
    Real areas[3], sum = 0;
    for (int k = 0; k < 3; ++k) {
      const Vector p = corners[(k + 1) % 3], q = corners[(k + 2) % 3];
      areas[k] = (p.x() - x) * (q.z() - z) - (p.z() - z) * (q.x() - x);
      sum += areas[k];
    }
    if (sum != 0 && areas[0] / sum > 0 && areas[1] / sum > 0 && areas[2] / sum > 0)
      found[(areas[0] * corners[0].y() + areas[1] * corners[1].y() + areas[2] * corners[2].y()) /
            sum] = index;
    ++index;
  }
  std::vector<int> triangles;
  for (const auto& [height, triangle] : found) triangles.push_back(triangle);
  return triangles;
}

TEST(Classes, ANeedlePuncturesWhatItsTipMeetsAndSuturesIt) {
  TestScene test;
  const auto solid = block(4, 1, 4, {-1, -0.3, -1}, {2, 0.3, 2});
  const auto tissue = test.tissue(solid, 2000, 0.02);
  for (int i = 0; i < solid->getNumVertices(); ++i)
    if (std::abs(solid->getVertexPosition(i).x()) == 1)
      tissue->getPbdBody()->fixedNodeIds.push_back(i);
  const auto surface =
      std::dynamic_pointer_cast<imstk::SurfaceMesh>(tissue->getCollidingGeometry());
  // The first vertex of the needle is its tail, the last its tip.
  std::vector<Vec3d> nodes;
  std::vector<Eigen::Vector2i> segments;
  for (int i = 0; i <= 8; ++i) nodes.push_back({0, 0.8 - 0.1 * i, 0});
  for (int i = 0; i < 8; ++i) segments.emplace_back(i, i + 1);
  const auto line = std::make_shared<imstk::LineMesh>();
  line->initialize(positionArray(nodes), cellArray<2>(segments));
  const auto needle = test.rigid("needle", line, {0.1, 0.2, 0.07});
  needle->getPbdBody()->bodyGravity = false;
  std::vector<Vec3d> along;
  std::vector<Eigen::Vector2i> ofThread;
  for (int i = 0; i <= 40; ++i) along.push_back({0.1, 1 + 0.1 * i, 0.07});
  for (int i = 0; i < 40; ++i) ofThread.emplace_back(i, i + 1);
  const auto threadLine = std::make_shared<imstk::LineMesh>();
  threadLine->initialize(positionArray(along), cellArray<2>(ofThread));
  const auto thread = test.deformable("thread", threadLine);
  thread->getPbdBody()->uniformMassValue = 0.01;
  test.config().enableConstraint(imstk::PbdModelConfig::ConstraintGenType::Distance, 1e5,
                                 thread->getPbdBody()->bodyHandle);
  test.config().m_linearDampingCoeff = 0.05;

  const auto interaction = std::make_shared<imstk::NeedleInteraction>(tissue, needle, thread);
  palpate::PalpateSettings settings;
  settings.guarded = false;  // it is to pass
  ASSERT_TRUE(test.palpateScene.share(interaction, settings));
  EXPECT_EQ(interaction->getCollisionDetection()->getTypeName(), "PalpateCD");
  test.scene->addInteraction(interaction);
  test.scene->initialize();

  const auto place = [&](double x, double z, double height) {
    imstk::PbdBody& body = *needle->getPbdBody();
    (*body.vertices)[0] = (*body.prevVertices)[0] = {x, height, z};
    (*body.orientations)[0] = (*body.prevOrientations)[0] = imstk::Quatd::Identity();
    (*body.velocities)[0] = (*body.angularVelocities)[0] = Vec3d::Zero();
  };
  std::set<int> punctured;
  for (const auto& [x, z] : {std::pair(0.1, 0.07), std::pair(0.12, 0.41)}) {
    const std::vector<int> below = trianglesBelow(*surface, x, z);
    ASSERT_EQ(below.size(), 2u);
    std::size_t most = 0;
    for (int i = 0; i <= 70; ++i) {
      place(x, z, 0.2 - 0.03 * i);
      test.setVelocity(*needle, {0, -0.03 / test.config().m_dt, 0});
      test.step();
      const auto& data = interaction->getPunctureData();
      for (const auto& puncture : data.needle) {
        EXPECT_NE(std::find(below.begin(), below.end(), puncture.triId), below.end())
            << "step " << i << ": triangle " << puncture.triId;
        punctured.insert(puncture.triId);
      }
      most = std::max(most, data.needle.size());
    }
    EXPECT_EQ(most, 2u) << x;
    EXPECT_EQ(interaction->getPunctureData().needle.size(), 0u);
    place(x, z, -3);  // around the tissue
    test.step();
    place(3, z, -3);
    test.step();
    place(3, z, 2);
    test.step();
  }
  EXPECT_EQ(punctured.size(), 4u);
  EXPECT_EQ(interaction->getPunctureData().thread.size(), 4u);
  interaction->stitch();
  test.step(20);
  EXPECT_EQ(interaction->getPunctureData().stitch.size(), 1u);
  for (const Vec3d& p : valuesOf(tissue->getPbdBody()->vertices)) EXPECT_LT(p.norm(), 3);
  EXPECT_EQ(test.palpateScene.error(), "");
  EXPECT_TRUE(logged().empty()) << logged()[0];
}

TEST(Classes, ANeedleThatDoesNotPunctureIsHandledAsARigidBody) {
  TestScene test;
  const auto tissue = test.tissue(block(4, 1, 4, {-1, -1, -1}, {2, 1, 2}), 2000, 0.02);
  const auto line = std::make_shared<imstk::LineMesh>();
  line->initialize(positionArray({{-0.5, 0, 0}, {0, 0, 0}, {0.5, 0, 0}}),
                   cellArray<2>({{0, 1}, {1, 2}}));
  const auto needle = test.rigid("needle", line, {0.07, 0.1, 0.03});  // it lies
  const auto threadLine = std::make_shared<imstk::LineMesh>();
  threadLine->initialize(positionArray({{-0.4, 0.1, 0}, {-0.5, 0.1, 0}, {-0.6, 0.1, 0}}),
                         cellArray<2>({{0, 1}, {1, 2}}));
  const auto interaction = std::make_shared<imstk::NeedleInteraction>(
      tissue, needle, test.deformable("thread", threadLine));
  palpate::PalpateSettings settings;
  settings.guarded = false;
  ASSERT_TRUE(test.palpateScene.share(interaction, settings));
  test.scene->addInteraction(interaction);
  test.scene->initialize();
  test.setVelocity(*needle, {0, -2, 0});
  test.step(10);
  EXPECT_TRUE(interaction->getPunctureData().needle.empty());
  EXPECT_GT(velocity(*needle).y(), -1.9);
  EXPECT_TRUE(logged().empty()) << logged()[0];
}

TEST(Classes, AClothThatIsCutLetsFallWhatLayOnIt) {
  TestScene test;
  test.config().m_gravity = {0, -10, 0};
  test.config().m_linearDampingCoeff = 0.01;
  const auto mesh = sheet({0, 0, 0}, 8);
  const auto cloth = test.deformable("cloth", mesh);
  for (int i = 0; i < mesh->getNumVertices(); ++i)
    if (std::abs(mesh->getVertexPosition(i).x()) == 1)
      cloth->getPbdBody()->fixedNodeIds.push_back(i);
  cloth->getPbdBody()->uniformMassValue = 0.05;
  test.config().enableConstraint(imstk::PbdModelConfig::ConstraintGenType::Distance, 1e4,
                                 cloth->getPbdBody()->bodyHandle);
  const auto ball =
      test.rigid("ball", std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.15), {0.02, 0.2, 0.03});
  test.collide(cloth, ball, {});
  palpate::PalpateSettings self;
  self.restDistance = 0.3;
  test.collide(cloth, cloth, self);
  test.scene->initialize();
  const auto gapOfBall = [&] {
    Real least = 1;
    for (const Eigen::Vector3i& cell : valuesOf(mesh->getCells())) {
      const auto corner = [&](int k) -> Vector { return particle(*cloth, cell[k]).cast<Real>(); };
      least = std::min(
          least, distanceToTriangle(particle(*ball).cast<Real>(), corner(0), corner(1), corner(2)) -
                     Real(0.15));
    }
    return least;
  };
  for (int i = 0; i < 150; ++i) {
    test.step();
    ASSERT_GT(gapOfBall(), 0) << i;
  }
  EXPECT_GT(particle(*ball).y(), -0.5);
  const auto blade = sheet({0.01, 0, 0}, 1, 6);
  for (Vec3d& p : positionsIn(*blade)) p = {0.01, p.x(), p.z()};
  const auto knife = std::make_shared<imstk::CollidingObject>("knife");
  knife->setCollidingGeometry(blade);
  const int vertices = mesh->getNumVertices();
  const auto cutting = std::make_shared<imstk::PbdObjectCutting>(cloth, knife);
  cutting->apply();
  EXPECT_GT(mesh->getNumVertices(), vertices);
  for (int i = 0; i < 150; ++i) {
    test.step();
    ASSERT_GT(gapOfBall(), 0) << i;
  }
  EXPECT_LT(particle(*ball).y(), -2);
  EXPECT_EQ(test.palpateScene.error(), "");
  // The lips of the cut touch when it is made.
  ASSERT_EQ(logged().size(), 2u);
  EXPECT_NE(logged()[0].find("\"cloth\" touch"), std::string::npos) << logged()[0];
  EXPECT_NE(logged()[1].find("\"cloth\" are apart"), std::string::npos) << logged()[1];
}

TEST(Classes, ATissueWhoseCellsAreRemovedLetsFallWhatLayOnThem) {
  TestScene test;
  test.config().m_gravity = {0, -10, 0};
  const auto solid = block(3, 1, 3, {-1.5, -1, -1.5}, {3, 1, 3});
  const auto tissue = test.tissue(solid, 2000, 0.02);
  for (int i = 0; i < solid->getNumVertices(); ++i) tissue->getPbdBody()->fixedNodeIds.push_back(i);
  const auto removal = std::make_shared<imstk::PbdObjectCellRemoval>(
      tissue, imstk::PbdObjectCellRemoval::OtherMeshUpdateType::Collision);
  const auto falling = test.deformable("falling", triangle({0, 0.3, 0}, 0.1));
  test.collide(tissue, falling, {});
  test.scene->addSceneObject(removal);
  test.scene->initialize();
  test.step(60);
  EXPECT_GT(particle(*falling).y(), 0);
  for (int i = 0; i < solid->getNumCells(); ++i) {
    Vec3d centre = Vec3d::Zero();
    for (int k = 0; k < 4; ++k)
      centre += 0.25 * solid->getVertexPosition(static_cast<size_t>((*solid->getCells())[i][k]));
    if (std::max(std::abs(centre.x()), std::abs(centre.z())) < 0.5) removal->removeCellOnApply(i);
  }
  removal->apply();
  test.step(60);
  EXPECT_LT(particle(*falling).y(), -1);
  EXPECT_EQ(test.palpateScene.error(), "");
  EXPECT_TRUE(logged().empty()) << logged()[0];
}

TEST(Classes, AStitchClosesTissueThatCollides) {
  // A ray stitches two lips of one tetrahedral mesh, which a ball also touches.
  TestScene test;
  const auto low = block(2, 1, 2, {-1, -1, -1}, {2, 1, 2}),
             high = block(2, 1, 2, {-1, 0.1, -1}, {2, 1, 2});
  std::vector<Vec3d> positions;
  std::vector<Eigen::Vector4i> cells;
  for (const auto& part : {low, high}) {
    const int first = static_cast<int>(positions.size());
    for (const Vec3d& p : positionsIn(*part)) positions.push_back(p);
    for (const Eigen::Vector4i& cell : valuesOf(part->getCells()))
      cells.push_back(cell + Eigen::Vector4i::Constant(first));
  }
  const auto solid = std::make_shared<imstk::TetrahedralMesh>();
  solid->initialize(positionArray(positions), cellArray<4>(cells));
  const auto lips = test.deformable("lips", solid);
  lips->getPbdBody()->uniformMassValue = 0.02;
  test.config().enableFemConstraint(imstk::PbdFemConstraint::MaterialType::NeoHookean, 2000, 0.4,
                                    lips->getPbdBody()->bodyHandle);
  test.config().m_linearDampingCoeff = 0.05;
  const auto ball =
      test.rigid("ball", std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.2), {0.3, 1.35, 0.2});
  palpate::PalpateSettings settings;
  settings.thickness = 0.02;
  test.collide(lips, ball, settings);
  test.collide(lips, lips, settings);
  const auto stitching = std::make_shared<imstk::PbdObjectStitching>(lips);
  test.scene->addInteraction(stitching);
  test.scene->initialize();
  test.setVelocity(*ball, {0, -0.5, 0});
  stitching->beginStitch(Vec3d(0.2, 5, 0.13), Vec3d(0, -1, 0));
  const auto widthOf = [&] {  // between the lips' facing sides
    double highest = -9, lowest = 9;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      if (positions[i].y() == 0) highest = std::max(highest, particle(*lips, i).y());
      if (positions[i].y() == 0.1) lowest = std::min(lowest, particle(*lips, i).y());
    }
    return lowest - highest;
  };
  EXPECT_NEAR(widthOf(), 0.1, 1e-12);
  for (int i = 0; i < 100; ++i) {
    test.step();
    ASSERT_GT(widthOf(), -0.2) << i;
  }
  EXPECT_LT(widthOf(), 0.05);
  EXPECT_EQ(test.palpateScene.error(), "");
  EXPECT_TRUE(logged().empty()) << logged()[0];
}

TEST(Classes, AGraspHoldsTheCellsThatAShapeTouches) {
  for (const bool isVertexGrasp : {false, true}) {
    TestScene test;
    test.config().m_linearDampingCoeff = 0.02;
    const auto mesh = sheet({0, 0, 0}, 8);
    const auto cloth = test.deformable("cloth", mesh);
    cloth->getPbdBody()->uniformMassValue = 0.05;
    test.config().enableConstraint(imstk::PbdModelConfig::ConstraintGenType::Distance, 1e4,
                                   cloth->getPbdBody()->bodyHandle);
    test.collide(cloth, test.floor(sheet({0, -0.1, 0}, 1, 6)), {});
    const auto grasping = std::make_shared<imstk::PbdObjectGrasping>(cloth);
    test.scene->addInteraction(grasping);
    test.scene->initialize();
    const auto jaws = std::make_shared<imstk::Sphere>(Vec3d(0.5, 0, 0.5), 0.2);
    if (isVertexGrasp)
      grasping->beginVertexGrasp(jaws);
    else
      grasping->beginCellGrasp(jaws, "PalpateCD");
    test.step();
    EXPECT_TRUE(grasping->hasConstraints());
    for (int i = 1; i <= 60; ++i) {
      jaws->setPosition({0.5, 0.01 * i, 0.5});
      test.step();
    }
    std::size_t grasped = 0;
    for (int i = 0; i < mesh->getNumVertices(); ++i) {
      const Vec3d start = mesh->getVertexPosition(i, imstk::Geometry::DataType::PreTransform);
      if ((start - Vec3d(0.5, 0, 0.5)).norm() > 0.2) continue;
      ++grasped;
      EXPECT_NEAR(particle(*cloth, i).y(), 0.6, 0.05) << i;
    }
    EXPECT_EQ(grasped, 1u);
    grasping->endGrasp();
    test.step(2);
    EXPECT_FALSE(grasping->hasConstraints());
    EXPECT_EQ(test.palpateScene.error(), "");
    EXPECT_TRUE(logged().empty()) << logged()[0];
  }
}

TEST(Classes, AGraspOfARigidBodyByARigidBody) {
  TestScene test;
  const auto shape = std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.3);
  const auto grasped = test.rigid("grasped", shape, {0, 0, 0});
  const auto jaws = std::make_shared<imstk::Capsule>(Vec3d(0, 0, 0), 0.1, 0.4);
  const auto grasper = test.rigid("grasper", jaws, {0, 0.45, 0});
  const auto grasping = std::make_shared<imstk::PbdObjectGrasping>(grasped, grasper);
  test.scene->addInteraction(grasping);
  test.scene->initialize();
  grasping->beginCellGrasp(jaws, "PalpateCD");
  test.step();
  EXPECT_TRUE(grasping->hasConstraints());
  for (int i = 0; i < 50; ++i) {
    test.setVelocity(*grasper, {0, 1, 0});
    test.step();
  }
  EXPECT_GT(particle(*grasped).y(), 0.2);
  EXPECT_NEAR((particle(*grasper) - particle(*grasped)).norm(), 0.45, 0.02);
}

struct ForceText : imstk::ControllerForceText {
  Vec3d force() const {
    Vec3d force = Vec3d::Zero(), torque = Vec3d::Zero();
    computePbdContactForceAndTorque(force, torque);
    return force;
  }
  Vec3d torque() const {
    Vec3d force = Vec3d::Zero(), torque = Vec3d::Zero();
    computePbdContactForceAndTorque(force, torque);
    return torque;
  }
};

TEST(Classes, TheTextOfForcesShowsTheForceOfTheContacts) {
  // A weight of 1 lies on a floor under gravity of 10, and a device pulls it down with a spring.
  const std::shared_ptr<imstk::Geometry> bodies[] = {
      std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.2),
      std::make_shared<imstk::OrientedBox>(Vec3d(0, 0, 0), Vec3d(0.2, 0.2, 0.2)),
      cube({0, 0, 0}, 0.2)};
  for (int kind = 0; kind < 3; ++kind) {
    TestScene test;
    test.config().m_gravity = {0, -10, 0};
    const auto body = test.rigid("body", bodies[kind], {0.03, 0.23, 0.02});
    palpate::PalpateSettings settings;
    settings.thickness = 0.05;
    const auto interaction = test.collide(body, test.floor(sheet({0, 0, 0}, 3, 4)), settings);
    const auto device = std::make_shared<imstk::DummyClient>();
    device->setPosition({0.03, 0.025, 0.02});
    device->setTrackingEnabled(true);
    const auto controller = std::make_shared<imstk::PbdObjectController>();
    controller->setControlledObject(body);
    controller->setDevice(device);
    controller->setLinearKs(100);
    controller->setAngularKs(100);
    controller->setForceScaling(0.5);
    controller->setUseForceSmoothening(false);
    const auto text = std::make_shared<ForceText>();
    text->setController(controller);
    text->setCollision(interaction);
    test.scene->initialize();
    const double spring = 100 * (0.225 - 0.025);
    // The first update places the body. A box as a shape rocks, so that forces are means.
    constexpr int kSteps = 300, kMeanOf = 100;
    Vec3d force = Vec3d::Zero(), torque = Vec3d::Zero();
    for (int i = 0; i < kSteps; ++i) {
      device->setPosition({0.03, i == 0 ? 0.23 : 0.025, 0.02});
      controller->update(test.config().m_dt);
      test.step();
      if (i < kSteps - kMeanOf) continue;
      force += text->force() / kMeanOf;
      torque += text->torque() / kMeanOf;
    }
    EXPECT_NEAR(force.y(), 10 + spring, 0.01 * (10 + spring)) << kind;
    EXPECT_NEAR(force.x(), 0, 0.1) << kind;
    EXPECT_LT(torque.norm(), 0.1) << kind;
    text->visualUpdate(1.0);
    std::istringstream words(text->getText()->getText());
    std::string word;
    double shown = -1;
    while (words >> word)
      if (word == "Contact" && words >> word && word == "Force:") words >> shown;
    EXPECT_NEAR(shown, 0.5 * text->force().norm(), 0.5) << text->getText()->getText();
    EXPECT_TRUE(logged().empty()) << logged()[0];
  }
}

}  // namespace
