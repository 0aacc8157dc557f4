#pragma once

#include <palpate/imstk/PalpateCH.h>
#include <palpate/imstk/PalpateScene.h>

#include <imstkCapsule.h>
#include <imstkCollisionHandling.h>
#include <imstkCylinder.h>
#include <imstkLineMesh.h>
#include <imstkLogger.h>
#include <imstkOrientedBox.h>
#include <imstkPbdModel.h>
#include <imstkPbdModelConfig.h>
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
#include <imstkVecDataArray.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

using imstk::Vec3d;

template <int N>
using CellArray = std::shared_ptr<imstk::VecDataArray<int, N>>;

template <class T, int N, class Values>
std::shared_ptr<imstk::VecDataArray<T, N>> arrayOf(const Values& values) {
  auto array = std::make_shared<imstk::VecDataArray<T, N>>();
  for (const auto& value : values) array->push_back(value);
  return array;
}
inline std::shared_ptr<imstk::VecDataArray<double, 3>> positionArray(
    const std::vector<Vec3d>& positions) {
  return arrayOf<double, 3>(positions);
}
template <int N>
CellArray<N> cellArray(const std::vector<Eigen::Matrix<int, N, 1>>& cells) {
  return arrayOf<int, N>(cells);
}
/// The elements of an array of iMSTK, to read and write.
template <class Array>
auto valuesOf(const std::shared_ptr<Array>& array) {
  struct Range {
    typename Array::ValueType *first, *last;
    auto begin() const { return first; }
    auto end() const { return last; }
  };
  auto* const first = array->getPointer();
  return Range{first, first + array->size()};
}
inline auto positionsIn(const imstk::PointSet& mesh) { return valuesOf(mesh.getVertexPositions()); }

// iMSTK's logger has one output. With g3log it writes from a thread of its own.
#ifndef iMSTK_SYNCHRONOUS_LOGGING
#error "The tests read iMSTK's log: build iMSTK with iMSTK_SYNCHRONOUS_LOGGING."
#endif
struct PalpateWarnings : imstk::LogOutput {
  std::vector<std::string> texts;
  bool writeMessage(const std::string& message) override {
    const std::size_t start = message.find("Palpate: ");  // after the time and the level
    if (start != std::string::npos) texts.push_back(message.substr(start));
    return true;
  }
};
/// The warnings of the adapter since the last clear().
inline std::vector<std::string>& logged() {
  static const auto warnings = [] {
    auto output = std::make_shared<PalpateWarnings>();
    imstk::LoggerSynchronous::instance()->setOutput(output);
    return output;
  }();
  return warnings->texts;
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

/// A box of nx x ny x nz cells of six tetrahedra each.
inline std::shared_ptr<imstk::TetrahedralMesh> block(int nx, int ny, int nz, const Vec3d& corner,
                                                     const Vec3d& size) {
  std::vector<Vec3d> positions;
  std::vector<Eigen::Vector4i> tetrahedra;
  const auto vertex = [&](const Eigen::Vector3i& i) {
    return (i[0] * (ny + 1) + i[1]) * (nz + 1) + i[2];
  };
  for (int i = 0; i <= nx; ++i)
    for (int j = 0; j <= ny; ++j)
      for (int k = 0; k <= nz; ++k)
        positions.push_back(corner +
                            Vec3d(size.x() * i / nx, size.y() * j / ny, size.z() * k / nz));
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j)
      for (int k = 0; k < nz; ++k) {
        int axes[] = {0, 1, 2};
        do {  // from corner to corner along the edges
          Eigen::Vector3i at(i, j, k);
          Eigen::Vector4i cell;
          cell[0] = vertex(at);
          for (int n = 0; n < 3; ++n) {
            ++at[axes[n]];
            cell[n + 1] = vertex(at);
          }
          if ((axes[1] - axes[0] + 3) % 3 != 1) std::swap(cell[2], cell[3]);  // an odd order
          tetrahedra.push_back(cell);
        } while (std::next_permutation(axes, axes + 3));
      }
  auto mesh = std::make_shared<imstk::TetrahedralMesh>();
  mesh->initialize(positionArray(positions), cellArray<4>(tetrahedra));
  return mesh;
}

/// A corner of the cube of half the edge `half` around the origin, of 8.
inline Vec3d cornerOf(int corner, double half) {
  return half * Vec3d(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
}
inline std::shared_ptr<imstk::SurfaceMesh> cube(const Vec3d& centre, double half) {
  std::vector<Vec3d> positions;
  for (int i = 0; i < 8; ++i) positions.push_back(centre + cornerOf(i, half));
  auto mesh = std::make_shared<imstk::SurfaceMesh>();
  mesh->initialize(positionArray(positions), cellArray<3>({{0, 2, 1},
                                                           {1, 2, 3},
                                                           {4, 5, 6},
                                                           {5, 7, 6},
                                                           {0, 1, 4},
                                                           {1, 5, 4},
                                                           {2, 6, 3},
                                                           {3, 6, 7},
                                                           {0, 4, 2},
                                                           {2, 4, 6},
                                                           {1, 3, 5},
                                                           {3, 7, 5}}));
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

/// Leaves all to the guard.
struct NoHandling : imstk::CollisionHandling {
  const std::string getTypeName() const override { return "NoHandling"; }

 protected:
  void handle(const std::vector<imstk::CollisionElement>&,
              const std::vector<imstk::CollisionElement>&) override {}
};

/// An iMSTK scene with one PbdModel, without gravity and damping, and a PalpateScene.
struct TestScene {
  std::shared_ptr<imstk::Scene> scene = std::make_shared<imstk::Scene>("scene");
  std::shared_ptr<imstk::PbdModel> model = std::make_shared<imstk::PbdModel>();
  palpate::PalpateScene palpateScene{scene};

  TestScene() {
    logged().clear();
    config().m_gravity = Vec3d::Zero();
    config().m_linearDampingCoeff = config().m_angularDampingCoeff = 0;
  }
  imstk::PbdModelConfig& config() const { return *model->getConfig(); }

  /// NeoHookean tissue with a surface, mapped point by point. Vertices at y = -1 are fixed.
  std::shared_ptr<imstk::PbdObject> tissue(const std::shared_ptr<imstk::TetrahedralMesh>& solid,
                                           double young, double mass) {
    const auto object = std::make_shared<imstk::PbdObject>("tissue");
    const auto surface = solid->extractSurfaceMesh();
    object->setPhysicsGeometry(solid);
    object->setCollidingGeometry(surface);
    object->setVisualGeometry(surface);
    object->setPhysicsToCollidingMap(std::make_shared<imstk::PointwiseMap>(solid, surface));
    object->setDynamicalModel(model);
    scene->addSceneObject(object);
    for (int i = 0; i < solid->getNumVertices(); ++i)
      if (solid->getVertexPosition(i).y() == -1) object->getPbdBody()->fixedNodeIds.push_back(i);
    object->getPbdBody()->uniformMassValue = mass;
    config().enableFemConstraint(imstk::PbdFemConstraint::MaterialType::NeoHookean, young, 0.4,
                                 object->getPbdBody()->bodyHandle);
    return object;
  }

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
  /// Without a handler: the guard alone acts.
  std::shared_ptr<imstk::PbdObjectCollision> guardOnly(std::shared_ptr<imstk::PbdObject> a,
                                                       std::shared_ptr<imstk::CollidingObject> b) {
    const auto interaction = std::make_shared<imstk::PbdObjectCollision>(a, b, "PalpateCD");
    const auto handling = std::make_shared<NoHandling>();
    handling->setInputObjectA(a);
    handling->setInputObjectB(b);
    handling->setInputCollisionData(interaction->getCollisionDetection()->getCollisionData());
    interaction->setCollisionHandlingAB(handling);
    palpateScene.share(interaction);
    scene->addInteraction(interaction);
    return interaction;
  }
  void setVelocity(imstk::PbdObject& object, const Vec3d& velocity) {
    for (Vec3d& v : valuesOf(object.getPbdBody()->velocities)) v = velocity;
  }
  void step(int steps = 1) {
    for (int i = 0; i < steps; ++i) {
      scene->advance(config().m_dt);
      scene->updateVisuals(config().m_dt);
    }
  }
};

inline Vec3d& particle(imstk::PbdObject& object, size_t i = 0) {
  return (*object.getPbdBody()->vertices)[i];
}
inline Vec3d& velocity(imstk::PbdObject& object, size_t i = 0) {
  return (*object.getPbdBody()->velocities)[i];
}
