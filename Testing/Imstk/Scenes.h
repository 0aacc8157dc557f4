#pragma once

#include <palpate/imstk/PalpateCH.h>
#include <palpate/imstk/PalpateScene.h>

#include <imstkCapsule.h>
#include <imstkCylinder.h>
#include <imstkLineMesh.h>
#include <imstkOrientedBox.h>
#include <imstkPbdModel.h>
#include <imstkPbdObject.h>
#include <imstkPbdObjectCollision.h>
#include <imstkPbdSolver.h>
#include <imstkPlane.h>
#include <imstkPointwiseMap.h>
#include <imstkScene.h>
#include <imstkSphere.h>
#include <imstkSurfaceMesh.h>
#include <imstkTaskGraph.h>
#include <imstkTetrahedralMesh.h>

#include <memory>
#include <string>
#include <vector>

using imstk::Vec3d;

template <int N>
using CellArray = std::shared_ptr<imstk::VecDataArray<int, N>>;

inline std::shared_ptr<imstk::VecDataArray<double, 3>> positionArray(std::vector<Vec3d> positions) {
  return std::make_shared<imstk::VecDataArray<double, 3>>(std::move(positions));
}
template <int N>
CellArray<N> cellArray(std::vector<Eigen::Matrix<int, N, 1>> cells) {
  return std::make_shared<imstk::VecDataArray<int, N>>(std::move(cells));
}

/// A square of 2 x 2 around `centre`, of `n` x `n` squares across the y axis.
inline std::shared_ptr<imstk::SurfaceMesh> sheet(const Vec3d& centre, int n = 2, double size = 2) {
  std::vector<Vec3d> positions;
  std::vector<Eigen::Vector3i> triangles;
  for (int i = 0; i <= n; ++i)
    for (int k = 0; k <= n; ++k)
      positions.push_back(centre + size * Vec3d(1.0 * k / n - 0.5, 0, 1.0 * i / n - 0.5));
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) {
      const int a = i * (n + 1) + k, b = a + n + 1;
      triangles.emplace_back(a, b, a + 1);
      triangles.emplace_back(a + 1, b, b + 1);
    }
  auto mesh = std::make_shared<imstk::SurfaceMesh>();
  mesh->initialize(positionArray(positions), cellArray<3>(triangles));
  return mesh;
}

inline std::shared_ptr<imstk::SurfaceMesh> triangle(const Vec3d& centre, double size) {
  auto mesh = std::make_shared<imstk::SurfaceMesh>();
  mesh->initialize(
      positionArray({centre + size * Vec3d(-1, 0, -0.7), centre + size * Vec3d(0, 0, 1),
                     centre + size * Vec3d(1, 0, -0.7)}),
      cellArray<3>({{0, 1, 2}}));
  return mesh;
}

/// An iMSTK scene with one PbdModel and a PalpateScene.
struct TestScene {
  std::shared_ptr<imstk::Scene> scene = std::make_shared<imstk::Scene>("scene");
  std::shared_ptr<imstk::PbdModel> model = std::make_shared<imstk::PbdModel>();
  palpate::PalpateScene palpateScene{scene};

  TestScene() { imstk::logged().clear(); }

  std::shared_ptr<imstk::PbdObject> deformable(const std::string& name,
                                               std::shared_ptr<imstk::PointSet> mesh) {
    const auto object = std::make_shared<imstk::PbdObject>(name);
    object->setPhysicsGeometry(mesh);
    object->setCollidingGeometry(mesh);
    object->setDynamicalModel(model);
    scene->addSceneObject(object);
    return object;
  }
  /// A deformable body whose vertices are all fixed.
  std::shared_ptr<imstk::PbdObject> floor(std::shared_ptr<imstk::PointSet> mesh) {
    const auto object = deformable("floor", mesh);
    for (int i = 0; i < mesh->getVertexPositions()->size(); ++i)
      object->getPbdBody()->fixedNodeIds.push_back(i);
    return object;
  }
  std::shared_ptr<imstk::PbdObject> rigid(const std::string& name,
                                          std::shared_ptr<imstk::Geometry> geometry,
                                          const Vec3d& position) {
    const auto object = std::make_shared<imstk::PbdObject>(name);
    object->setPhysicsGeometry(geometry);
    object->setCollidingGeometry(geometry);
    object->setDynamicalModel(model);
    object->getPbdBody()->setRigid(position);
    scene->addSceneObject(object);
    return object;
  }
  std::shared_ptr<imstk::CollidingObject> tool(std::shared_ptr<imstk::Geometry> geometry) {
    const auto object = std::make_shared<imstk::CollidingObject>("tool");
    object->setCollidingGeometry(geometry);
    scene->addSceneObject(object);
    return object;
  }
  std::shared_ptr<imstk::PbdObjectCollision> collide(std::shared_ptr<imstk::CollidingObject> a,
                                                     std::shared_ptr<imstk::CollidingObject> b,
                                                     const palpate::PalpateSettings& settings) {
    const auto interaction = palpateScene.makeCollision(a, b, settings);
    scene->addInteraction(interaction);
    return interaction;
  }
  /// With iMSTK's own handler, which here does nothing: the guard alone acts.
  std::shared_ptr<imstk::PbdObjectCollision> guardOnly(std::shared_ptr<imstk::PbdObject> a,
                                                       std::shared_ptr<imstk::CollidingObject> b) {
    const auto interaction = std::make_shared<imstk::PbdObjectCollision>(a, b, "PalpateCD");
    palpateScene.share(interaction);
    scene->addInteraction(interaction);
    return interaction;
  }
  void setVelocity(imstk::PbdObject& object, const Vec3d& velocity) {
    for (Vec3d& v : object.getPbdBody()->velocities->values) v = velocity;
  }
  void step(int steps = 1) {
    for (int i = 0; i < steps; ++i) scene->advance(model->m_dt);
  }
};

inline Vec3d& particle(imstk::PbdObject& object, size_t i = 0) {
  return (*object.getPbdBody()->vertices)[i];
}
inline Vec3d& velocity(imstk::PbdObject& object, size_t i = 0) {
  return (*object.getPbdBody()->velocities)[i];
}
