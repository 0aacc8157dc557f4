// PalpateCD without a PalpateScene, as pickers use it, and its elements.
#include "Scenes.h"

#include <imstkCDObjectFactory.h>
#include <imstkHexahedralMesh.h>

#include <gtest/gtest.h>

namespace {

using imstk::CollisionElementType;

std::shared_ptr<palpate::PalpateCD> detection(std::shared_ptr<imstk::Geometry> a,
                                              std::shared_ptr<imstk::Geometry> b) {
  const auto made = std::dynamic_pointer_cast<palpate::PalpateCD>(
      imstk::CDObjectFactory::makeCollisionDetection("PalpateCD"));
  made->setInput(a, 0);
  made->setInput(b, 1);
  return made;
}

std::shared_ptr<imstk::PointSet> point(const Vec3d& at) {
  auto set = std::make_shared<imstk::PointSet>();
  set->initialize(positionArray({at}));
  return set;
}

std::shared_ptr<imstk::LineMesh> segment(const Vec3d& p, const Vec3d& q) {
  auto mesh = std::make_shared<imstk::LineMesh>();
  mesh->initialize(positionArray({p, q}), cellArray<2>({{0, 1}}));
  return mesh;
}

std::shared_ptr<imstk::TetrahedralMesh> tetrahedron(const Vec3d& at) {
  auto mesh = std::make_shared<imstk::TetrahedralMesh>();
  mesh->initialize(
      positionArray({at, at + Vec3d(1, 0, 0), at + Vec3d(0, 1, 0), at + Vec3d(0, 0, 1)}),
      cellArray<4>({{0, 1, 2, 3}}));
  return mesh;
}

TEST(PalpateCD, IsRegistered) {
  ASSERT_TRUE(imstk::CDObjectFactory::contains("PalpateCD"));
  EXPECT_EQ(detection(point({0, 0, 0}), point({1, 0, 0}))->getTypeName(), "PalpateCD");
}

TEST(PalpateCD, VertexInASphereIsAPointWithItsWayOut) {
  const auto sphere = std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 1.0);
  for (const bool sphereFirst : {false, true}) {
    const auto cd = sphereFirst ? detection(sphere, point({0, 0.75, 0}))
                                : detection(point({0, 0.75, 0}), sphere);
    cd->update();
    const auto data = cd->getCollisionData();
    ASSERT_EQ(data->elementsA.size(), 1u);
    const auto& ofPoint = (sphereFirst ? data->elementsB : data->elementsA)[0];
    const auto& ofSphere = (sphereFirst ? data->elementsA : data->elementsB)[0];
    ASSERT_EQ(ofPoint.m_type, CollisionElementType::PointIndexDirection);
    ASSERT_EQ(ofSphere.m_type, CollisionElementType::PointDirection);
    EXPECT_EQ(ofPoint.m_element.m_PointIndexDirectionElement.dir, Vec3d(0, 1, 0));
    EXPECT_DOUBLE_EQ(ofPoint.m_element.m_PointIndexDirectionElement.penetrationDepth, 0.25);
    EXPECT_EQ(ofSphere.m_element.m_PointDirectionElement.pt, Vec3d(0, 1, 0));
    EXPECT_EQ(ofSphere.m_element.m_PointDirectionElement.dir, Vec3d(0, -1, 0));
  }
}

TEST(PalpateCD, SurfacesGiveCellsOfVertices) {
  const auto blade = triangle({0, 0, 0}, 0.25);
  for (Vec3d& p : positionsIn(*blade)) p = Vec3d(p.x() + 0.1, p.z(), 0.1);  // upright
  const auto cd = detection(sheet({0, 0, 0}), blade);
  cd->update();
  const auto data = cd->getCollisionData();
  ASSERT_FALSE(data->elementsA.empty());
  ASSERT_EQ(data->elementsA.size(), data->elementsB.size());
  for (size_t i = 0; i < data->elementsA.size(); ++i)
    for (const auto* element : {&data->elementsA[i], &data->elementsB[i]}) {
      ASSERT_EQ(element->m_type, CollisionElementType::CellIndex);
      const imstk::CellIndexElement& cell = element->m_element.m_CellIndexElement;
      EXPECT_EQ(cell.idCount, static_cast<int>(cell.cellType) + 1);
      for (int k = 0; k < 3; ++k) EXPECT_EQ(cell.ids[k] >= 0, k < cell.idCount);
    }
}

TEST(PalpateCD, EveryCellElementHasTheCellThatHoldsIt) {
  const auto solid = tetrahedron({0.1, -0.1, 0.1});
  const auto thread = segment({0.2, -0.01, 0.2}, {0.4, 0.01, 0.3});
  const std::shared_ptr<imstk::PointSet> meshes[] = {sheet({0, 0, 0}, 4), solid, thread};
  const auto cellsOf = [](const imstk::PointSet& mesh) {
    std::vector<std::vector<int>> cells;
    const auto add = [&](const auto& array) {
      for (const auto& cell : valuesOf(array)) cells.emplace_back(cell.begin(), cell.end());
    };
    if (const auto* const triangles = dynamic_cast<const imstk::SurfaceMesh*>(&mesh))
      add(const_cast<imstk::SurfaceMesh*>(triangles)->getCells());
    else if (const auto* const tetrahedra = dynamic_cast<const imstk::TetrahedralMesh*>(&mesh))
      add(const_cast<imstk::TetrahedralMesh*>(tetrahedra)->getCells());
    else
      add(const_cast<imstk::LineMesh&>(dynamic_cast<const imstk::LineMesh&>(mesh)).getCells());
    return cells;
  };
  std::size_t elements = 0;
  for (const auto& a : meshes)
    for (const auto& b : meshes) {
      if (a == b) continue;
      const auto cd = detection(a, b);
      palpate::PalpateSettings settings;
      settings.thickness = 0.05;
      cd->setSettings(settings);
      cd->update();
      for (const bool first : {true, false})
        for (const auto& element :
             first ? cd->getCollisionData()->elementsA : cd->getCollisionData()->elementsB) {
          ASSERT_EQ(element.m_type, CollisionElementType::CellIndex);
          const imstk::CellIndexElement& cell = element.m_element.m_CellIndexElement;
          const auto cells = cellsOf(first ? *a : *b);
          ASSERT_GE(cell.parentId, 0);
          ASSERT_LT(cell.parentId, static_cast<int>(cells.size()));
          const std::vector<int>& parent = cells[static_cast<std::size_t>(cell.parentId)];
          for (int k = 0; k < cell.idCount; ++k)
            EXPECT_NE(std::find(parent.begin(), parent.end(), cell.ids[k]), parent.end());
          ++elements;
        }
    }
  EXPECT_GT(elements, 10u);
}

TEST(PalpateCD, EveryPairOfTypesHasAMethod) {
  const std::vector<std::shared_ptr<imstk::Geometry>> types{sheet({0, 0, 0}),
                                                            tetrahedron({0.1, -0.1, 0.1}),
                                                            segment({0.2, -1, 0.2}, {0.2, 1, 0.2}),
                                                            point({0.2, 0, 0.2}),
                                                            std::make_shared<imstk::Sphere>(),
                                                            std::make_shared<imstk::Capsule>(),
                                                            std::make_shared<imstk::Cylinder>(),
                                                            std::make_shared<imstk::OrientedBox>(),
                                                            std::make_shared<imstk::Plane>()};
  logged().clear();
  for (const auto& a : types)
    for (const auto& b : types) {
      if (a == b && std::dynamic_pointer_cast<imstk::PointSet>(a) == nullptr) continue;
      const auto cd = detection(a, b);
      cd->update();
      ASSERT_TRUE(logged().empty())
          << a->getTypeName() << ", " << b->getTypeName() << ": " << logged()[0];
      const bool hasShape = std::dynamic_pointer_cast<imstk::PointSet>(a) == nullptr ||
                            std::dynamic_pointer_cast<imstk::PointSet>(b) == nullptr;
      const bool isTwoPlanes = a->getTypeName() == "Plane" && b->getTypeName() == "Plane";
      if (!hasShape || isTwoPlanes) continue;
      EXPECT_FALSE(cd->getCollisionData()->elementsA.empty())
          << a->getTypeName() << ", " << b->getTypeName();
    }
  const auto hexahedra = std::make_shared<imstk::HexahedralMesh>();
  hexahedra->initialize(positionArray({{0, 0, 0}}), cellArray<8>({}));
  detection(hexahedra, types[0])->update();
  ASSERT_EQ(logged().size(), 1u + 1u);
  EXPECT_EQ(logged()[0], "Palpate: A HexahedralMesh does not collide.");
}

TEST(PalpateCD, StepOfAPickerBeginsAtItsLastUpdate) {
  // A needle passes a sheet between two updates: only Continuous sees that.
  const auto needle = segment({0.2, 3, 0.3}, {0.2, 2, 0.3});
  const auto cd = detection(needle, sheet({0, 0, 0}));
  cd->update();
  EXPECT_TRUE(cd->getCollisionData()->elementsA.empty());
  for (Vec3d& p : positionsIn(*needle)) p.y() -= 10;
  cd->update();
  EXPECT_FALSE(cd->getCollisionData()->elementsA.empty());
  cd->update();
  EXPECT_TRUE(cd->getCollisionData()->elementsA.empty());
  // The inputs of a picker change.
  cd->setInput(segment({0.2, 1, 0.3}, {0.2, -1, 0.3}), 0);
  cd->setInput(std::make_shared<imstk::Sphere>(), 1);
  cd->update();
  EXPECT_FALSE(cd->getCollisionData()->elementsA.empty());
}

}  // namespace
