#include "iMSTK/SceneStep.h"

#include <palpate/imstk/PalpateCD.h>
#include <palpate/imstk/PalpateCH.h>

#include <Eigen/Geometry>

#include <imstkCapsule.h>
#include <imstkCollidingObject.h>
#include <imstkCollisionHandling.h>
#include <imstkCollisionInteraction.h>
#include <imstkCylinder.h>
#include <imstkDataArray.h>
#include <imstkLineMesh.h>
#include <imstkLogger.h>
#include <imstkOrientedBox.h>
#include <imstkPbdModel.h>
#include <imstkPbdModelConfig.h>
#include <imstkPbdObject.h>
#include <imstkPlane.h>
#include <imstkPointwiseMap.h>
#include <imstkSphere.h>
#include <imstkSurfaceMesh.h>
#include <imstkTetrahedralMesh.h>
#include <imstkVecDataArray.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <optional>
#include <stdexcept>

namespace palpate {

using DataType = imstk::Geometry::DataType;

namespace {

// The cells of a mesh, flat. A point set has none.
struct Cells {
  const int* indices = nullptr;
  std::size_t count = 0;
  int vertices = 1;
};

template <int N>
Cells cellsIn(imstk::CellMesh<N>& mesh) {
  const std::shared_ptr<imstk::VecDataArray<int, N>> cells = mesh.getCells();
  if (cells->size() == 0) return {nullptr, 0, N};
  return {cells->getPointer()->data(), static_cast<std::size_t>(cells->size()), N};
}

Cells cellsOf(imstk::PointSet& mesh) {
  if (auto* tetrahedra = dynamic_cast<imstk::TetrahedralMesh*>(&mesh))
    return cellsIn<4>(*tetrahedra);
  if (auto* triangles = dynamic_cast<imstk::SurfaceMesh*>(&mesh)) return cellsIn<3>(*triangles);
  if (auto* segments = dynamic_cast<imstk::LineMesh*>(&mesh)) return cellsIn<2>(*segments);
  if (dynamic_cast<imstk::AbstractCellMesh*>(&mesh) != nullptr)
    throw std::invalid_argument("A " + mesh.getTypeName() + " does not collide.");
  return {};
}

BodyPose poseOf(const imstk::Quatd& rotation, const imstk::Vec3d& translation) {
  return {rotation.normalized().toRotationMatrix(), translation};
}

// Where a shape is, before or after its geometry's transform.
BodyPose poseOf(imstk::Geometry& shape, DataType type) {
  if (auto* plane = dynamic_cast<imstk::Plane*>(&shape))
    return poseOf(imstk::Quatd::FromTwoVectors(imstk::Vec3d::UnitY(), plane->getNormal(type)),
                  plane->getPosition(type));
  auto& analytical = dynamic_cast<imstk::AnalyticalGeometry&>(shape);
  return poseOf(analytical.getOrientation(type), analytical.getPosition(type));
}

ShapeMeasures measuresOf(imstk::Geometry& shape) {
  if (auto* sphere = dynamic_cast<imstk::Sphere*>(&shape))
    return {ShapeMeasures::Kind::Sphere, sphere->getRadius()};
  if (auto* capsule = dynamic_cast<imstk::Capsule*>(&shape))
    return {ShapeMeasures::Kind::Capsule, capsule->getRadius(), capsule->getLength()};
  if (auto* cylinder = dynamic_cast<imstk::Cylinder*>(&shape))
    return {ShapeMeasures::Kind::Cylinder, cylinder->getRadius(), cylinder->getLength()};
  if (auto* box = dynamic_cast<imstk::OrientedBox*>(&shape))
    return {ShapeMeasures::Kind::Box, 0.0, 0.0, box->getExtents()};
  if (dynamic_cast<imstk::Plane*>(&shape) != nullptr) return {ShapeMeasures::Kind::Plane};
  throw std::invalid_argument("A " + shape.getTypeName() + " does not collide.");
}

BodyPose operator*(const BodyPose& outer, const BodyPose& inner) {
  return {outer.rotation * inner.rotation, outer.rotation * inner.translation + outer.translation};
}
BodyPose inverseOf(const BodyPose& pose) {
  const Eigen::Matrix3d rotation = pose.rotation.transpose();
  return {rotation, -(rotation * pose.translation)};
}

CollisionStep::Method methodOf(const PalpateSettings& settings, int verticesOfA, int verticesOfB) {
  switch (settings.method) {
    case PalpateMethod::Auto:
      return CollisionStep::Method::Auto;
    case PalpateMethod::Intersection:
      return CollisionStep::Method::Intersection;
    case PalpateMethod::Proximity:
      return CollisionStep::Method::Proximity;
    case PalpateMethod::Continuous:
      return CollisionStep::Method::Continuous;
    case PalpateMethod::Default:
      break;
  }
  if (settings.thickness > 0) return CollisionStep::Method::Auto;
  if (verticesOfA == 0 || verticesOfB == 0) return CollisionStep::Method::Proximity;
  return verticesOfA >= 3 && verticesOfB >= 3 ? CollisionStep::Method::Intersection
                                              : CollisionStep::Method::Continuous;
}

}  // namespace

namespace {

// See Body::size. Infinite for a plane.
double sizeOf(const std::vector<Eigen::Vector3d>& positions, const std::vector<int>& cells,
              int verticesPerCell) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& p : positions) box.extend(p);
  double edges = 0;
  std::size_t count = 0;
  const auto corners = static_cast<std::size_t>(verticesPerCell);
  for (std::size_t first = 0; first < cells.size(); first += corners)
    for (std::size_t i = 0; i < corners; ++i)
      for (std::size_t k = 0; k < i; ++k, ++count)
        edges += (positions.at(static_cast<std::size_t>(cells[first + i])) -
                  positions.at(static_cast<std::size_t>(cells[first + k])))
                     .norm();
  const double whole = box.isEmpty() ? 0.0 : box.diagonal().norm() / 50;
  return count == 0 ? whole : std::min(whole, 0.5 * edges / static_cast<double>(count));
}
double sizeOf(const ShapeMeasures& shape) {
  switch (shape.kind) {
    case ShapeMeasures::Kind::Plane:
      return std::numeric_limits<double>::infinity();
    case ShapeMeasures::Kind::Box:
      return 2 * shape.halfExtents.norm() / 50;
    case ShapeMeasures::Kind::Sphere:
    case ShapeMeasures::Kind::Capsule:
    case ShapeMeasures::Kind::Cylinder:
      break;
  }
  return (2 * shape.radius + shape.length) / 50;
}

// Rounds of rows after iMSTK's solver, while the guard would hold something.
constexpr int kRounds = 2;
// Sweeps over the rows in a round, until none is violated by more than this share of its gap.
constexpr int kSweeps = 20;
constexpr double kViolationLeft = 1.0 / 64;
// Calls of the guard for poses that are rounded as iMSTK's quaternions.
constexpr int kPlacements = 4;

}  // namespace

struct SceneStep::Body {
  struct Placement {
    imstk::Quatd orientation = imstk::Quatd::Identity();
    imstk::Vec3d position = imstk::Vec3d::Zero();
  };

  int id;
  std::shared_ptr<imstk::Geometry> geometry;
  std::string name{};
  std::shared_ptr<imstk::PointSet> mesh{};     // null: a shape
  std::shared_ptr<imstk::PbdObject> object{};  // null: nothing that a solver moves
  BodyRole role = BodyRole::Fixed;
  std::vector<int> cells{}, kept{};         // all of iMSTK's, and those that collide
  std::vector<std::vector<int>> cellsAt{};  // of each vertex; filled when it is read first
  int verticesPerCell = 0;
  std::vector<Eigen::Vector3d> positions{};  // as read last
  BodyPose local{}, pose{};                  // of a shape in its rigid body; as read last
  // A rigid body where the step began, and where the last one ended: its pose in CollisionStep has
  // exactly the rotation of this quaternion.
  Placement start{}, end{};
  std::shared_ptr<imstk::CollidingObject> shown{};  // held where it is drawn, too
  std::optional<BodyPose> drawn{};                  // of a shape, where the last step put it
  double size = 0;  // L, of a fiftieth of its box, or half its mean edge if that is less

  std::shared_ptr<imstk::PointwiseMap> map() const {
    if (object->getPhysicsGeometry() == geometry) return nullptr;
    return std::dynamic_pointer_cast<imstk::PointwiseMap>(object->getPhysicsToCollidingMap());
  }
  // The particle of a vertex, or -1.
  int particleOf(const imstk::PointwiseMap* map, int vertex) const {
    return map == nullptr ? vertex : map->getParentVertexId(vertex);
  }
  bool isPlaced() const { return mesh == nullptr || role == BodyRole::Rigid; }
  // A cell that names a vertex twice is one that PbdObjectCellRemoval removed.
  void setCells(const Cells& from) {
    const auto corners = static_cast<std::size_t>(from.vertices);
    verticesPerCell = from.vertices;
    cells.assign(from.indices, from.indices + from.count * corners);
    kept.clear();
    cellsAt.clear();
    for (std::size_t first = 0; first < cells.size(); first += corners) {
      const int* const cell = &cells[first];
      bool isWhole = true;
      for (std::size_t i = 0; i < corners; ++i)
        isWhole &= std::find(cell, cell + i, cell[i]) == cell + i;
      if (isWhole) kept.insert(kept.end(), cell, cell + corners);
    }
  }
  MeshArrays arrays() const {
    return {positions.data(), positions.size(), kept.data(),
            kept.size() / static_cast<std::size_t>(verticesPerCell), verticesPerCell};
  }
  // The cells that name all vertices of an element, ascending; {-1} without cells.
  std::vector<int> cellsWith(const StepElement& element) {
    if (cells.empty()) return {-1};
    const auto corners = static_cast<std::size_t>(verticesPerCell);
    if (cellsAt.empty()) {
      cellsAt.resize(positions.size());
      for (std::size_t i = 0; i < cells.size(); ++i)
        cellsAt[static_cast<std::size_t>(cells[i])].push_back(static_cast<int>(i / corners));
    }
    std::vector<int> found;
    for (const int index : cellsAt[static_cast<std::size_t>(element.ids[0])]) {
      const int* const cell = &cells[static_cast<std::size_t>(index) * corners];
      if (std::all_of(element.ids.begin(), element.ids.begin() + element.idCount, [&](int vertex) {
            return std::find(cell, cell + corners, vertex) != cell + corners;
          }))
        found.push_back(index);
    }
    return found;
  }
  std::vector<Eigen::Vector3d> positionsOf(DataType type) const {
    const std::shared_ptr<imstk::VecDataArray<double, 3>> array = mesh->getVertexPositions(type);
    return std::vector<Eigen::Vector3d>(array->getPointer(), array->getPointer() + array->size());
  }
};

struct SceneStep::Pair {
  int id, bodyA, bodyB;
  PalpateSettings settings;
  std::weak_ptr<imstk::CollisionInteraction> interaction{};
  std::weak_ptr<PalpateCD> detection{};
  bool isNew = true, isCrossed = false;
  bool isTouching = false;  // when the step began
  bool isPicked = false;    // every cell that touches is an element
};

SceneStep::SceneStep(int threads) : m_step(std::make_unique<CollisionStep>(threads)) {}
SceneStep::~SceneStep() = default;

std::string SceneStep::error() const {
  const std::lock_guard<std::mutex> lock(m_errorLock);
  return m_error;
}

void SceneStep::note(const std::string& message) { LOG(WARNING) << "Palpate: " << message; }

void SceneStep::warn(const std::string& message) {
  m_stepError = message;
  if (!m_isDetected) publishError();
  if (message == m_lastWarning) return;
  m_lastWarning = message;
  note(message);
}

// error() is that of a whole step, also while the next one runs.
void SceneStep::publishError() {
  const std::lock_guard<std::mutex> lock(m_errorLock);
  m_error = m_stepError;
}

// Task graphs end the process on an exception.
template <class F>
bool SceneStep::attempt(F&& f) {
  try {
    f();
    return true;
  } catch (const std::exception& exception) {
    warn(exception.what());
    return false;
  }
}

void SceneStep::setRadius(const std::shared_ptr<imstk::Geometry>& geometry, double radius) {
  m_radii[geometry.get()] = radius;
}

void SceneStep::showHeld(const std::shared_ptr<imstk::CollidingObject>& object) {
  m_shown.insert(object);
}

void SceneStep::share(const std::shared_ptr<imstk::CollisionInteraction>& interaction,
                      const std::shared_ptr<PalpateCD>& detection,
                      const PalpateSettings& settings) {
  m_newPairs.push_back({-1, -1, -1, settings, interaction, detection});
}

std::vector<std::shared_ptr<imstk::CollisionInteraction>> SceneStep::interactions() const {
  std::vector<std::shared_ptr<imstk::CollisionInteraction>> found;
  for (const Pair& pair : m_pairs)
    if (const auto interaction = pair.interaction.lock()) found.push_back(interaction);
  return found;
}

int SceneStep::bodyOf(const std::shared_ptr<imstk::Geometry>& geometry,
                      const std::shared_ptr<imstk::CollidingObject>& object) {
  if (geometry == nullptr) throw std::invalid_argument("An object has no colliding geometry.");
  for (std::size_t i = 0; i < m_bodies.size(); ++i)
    if (m_bodies[i].geometry == geometry) return static_cast<int>(i);

  Body body{-1, geometry};
  body.mesh = std::dynamic_pointer_cast<imstk::PointSet>(geometry);
  body.object = std::dynamic_pointer_cast<imstk::PbdObject>(object);
  if (body.object != nullptr)
    body.role = body.object->getPbdBody()->bodyType == imstk::PbdBody::Type::RIGID
                    ? BodyRole::Rigid
                    : BodyRole::Particles;
  body.name = object == nullptr ? geometry->getTypeName() : object->getName();
  if (m_shown.count(object) != 0) body.shown = object;
  if (body.role == BodyRole::Particles && body.map() == nullptr &&
      body.object->getPhysicsGeometry() != geometry) {
    const auto map = body.object->getPhysicsToCollidingMap();
    throw std::invalid_argument("\"" + body.name +
                                "\" does not collide: of maps to a colliding "
                                "geometry, only a PointwiseMap names particles, and it has " +
                                (map == nullptr ? "none." : "a " + map->getTypeName() + "."));
  }
  const bool isRigid = body.role == BodyRole::Rigid;
  if (isRigid) {
    imstk::PbdBody& pbd = *body.object->getPbdBody();
    body.end = {(*pbd.orientations)[0], (*pbd.vertices)[0]};
    body.pose = poseOf(body.end.orientation, body.end.position);
  }
  if (body.mesh != nullptr) {
    const Cells cells = cellsOf(*body.mesh);
    body.setCells(cells);
    body.positions = body.positionsOf(isRigid ? DataType::PreTransform : DataType::PostTransform);
    const auto radius = m_radii.find(geometry.get());
    body.id = m_step->addMesh(body.role, body.arrays(),
                              radius == m_radii.end() ? 0.0 : radius->second, body.pose, body.name);
    body.size = sizeOf(body.positions, body.kept, body.verticesPerCell);  // cells are checked now
  } else {
    if (isRigid) {
      body.local = poseOf(*geometry, DataType::PreTransform);
      body.pose = body.pose * body.local;
    } else {
      body.role = BodyRole::Fixed;
      body.pose = poseOf(*geometry, DataType::PostTransform);
    }
    body.size = sizeOf(measuresOf(*geometry));
    body.id = m_step->addShape(body.role, measuresOf(*geometry), body.pose, body.name);
  }
  m_bodies.push_back(std::move(body));
  return static_cast<int>(m_bodies.size()) - 1;
}

int SceneStep::addPairOfBodies(int a, int b, const PalpateSettings& settings, bool isPicked) {
  const Body &first = m_bodies[static_cast<std::size_t>(a)],
             &second = m_bodies[static_cast<std::size_t>(b)];
  return m_step->addPair(first.id, second.id,
                         {methodOf(settings, first.verticesPerCell, second.verticesPerCell),
                          settings.thickness, settings.restDistance, settings.guarded, isPicked});
}

void SceneStep::addSharedPairs() {
  for (Pair& pair : m_newPairs) {
    const auto interaction = pair.interaction.lock();
    const auto detection = pair.detection.lock();
    if (interaction == nullptr || detection == nullptr) continue;
    attempt([&] {
      const auto handler = interaction->getCollisionHandlingA();
      pair.bodyA = bodyOf(detection->getInput(0), handler->getInputObjectA());
      pair.bodyB = bodyOf(detection->getInput(1), handler->getInputObjectB());
      setDefaults(pair);
      pair.id = addPairOfBodies(pair.bodyA, pair.bodyB, pair.settings, false);
      m_pairs.push_back(pair);
      detection->setPair(static_cast<int>(m_pairs.size()) - 1);
    });
  }
  m_newPairs.clear();
  // Geometries begin at rest: iMSTK predicts before it first detects.
  m_step->advance();
  attempt([&] { findCrossedPairs(); });
}

void SceneStep::setDefaults(Pair& pair) {
  PalpateSettings& settings = pair.settings;
  if (settings.thickness >= 0) return;
  settings.thickness = std::min(m_bodies[static_cast<std::size_t>(pair.bodyA)].size,
                                m_bodies[static_cast<std::size_t>(pair.bodyB)].size);
  if (pair.bodyA == pair.bodyB && settings.restDistance == 0)
    settings.restDistance = 2 * settings.thickness;
}

std::string SceneStep::nameOf(int pair) const {
  const Pair& found = m_pairs[static_cast<std::size_t>(pair)];
  const auto name = [&](int body) {
    return "\"" + m_bodies[static_cast<std::size_t>(body)].name + "\"";
  };
  return found.bodyA == found.bodyB ? name(found.bodyA)
                                    : name(found.bodyA) + " and " + name(found.bodyB);
}

bool SceneStep::isEnabled(int pair) const {
  const auto interaction = m_pairs[static_cast<std::size_t>(pair)].interaction.lock();
  return interaction == nullptr || interaction->getEnabled();
}

// The guard would keep what has crossed where it is.
void SceneStep::findCrossedPairs() {
  for (std::size_t i = 0; i < m_pairs.size(); ++i) {
    Pair& pair = m_pairs[i];
    if (!pair.settings.guarded || pair.interaction.expired()) continue;
    const bool isSuspect =
        pair.isNew || pair.isCrossed || (m_hasAnswer && m_step->mayCross(pair.id));
    pair.isNew = false;
    if (!isSuspect || m_step->isCrossed(pair.id, pair.isCrossed) == pair.isCrossed) continue;
    pair.isCrossed = !pair.isCrossed;
    note(nameOf(static_cast<int>(i)) + (pair.isCrossed
                                            ? " cross: they are not guarded until they are apart."
                                            : " are apart: they are guarded from now on."));
  }
}

int SceneStep::addPair(const std::shared_ptr<imstk::Geometry>& a,
                       const std::shared_ptr<imstk::Geometry>& b, const PalpateSettings& settings) {
  const bool isAdded = attempt([&] {
    Pair pair{-1, bodyOf(a, nullptr), bodyOf(b, nullptr), settings};
    pair.isPicked = true;
    pair.id = addPairOfBodies(pair.bodyA, pair.bodyB, settings, true);
    m_pairs.push_back(pair);
  });
  return isAdded ? static_cast<int>(m_pairs.size()) - 1 : -1;
}

// Passes the positions now. At a step's start also `before`: where the last step ended, or for what
// something else moved since, where iMSTK's step began.
void SceneStep::read(Body& body, bool startsStep) {
  const bool rests = startsStep && m_isRestarted;
  if (body.isPlaced()) {
    BodyPose before = m_step->poseBefore(body.id);
    if (body.role == BodyRole::Rigid) {
      const imstk::PbdBody& pbd = *body.object->getPbdBody();
      body.pose = poseOf((*pbd.orientations)[0], (*pbd.vertices)[0]) * body.local;
      if (startsStep) body.start = body.end;
      if (startsStep && pbd.prevVertices != nullptr && pbd.prevOrientations != nullptr &&
          (*pbd.invMasses)[0] > 0) {
        body.start = {(*pbd.prevOrientations)[0], (*pbd.prevVertices)[0]};
        before = poseOf(body.start.orientation, body.start.position) * body.local;
      }
    } else if (startsStep) {
      body.pose = poseOf(*body.geometry, DataType::PostTransform);
      if (rests) before = body.pose;
      if (body.shown != nullptr && body.pose == body.drawn) body.pose = before;  // not moved since
    } else {
      return;
    }
    m_step->setPose(body.id, before, body.pose);
    return;
  }
  if (body.role == BodyRole::Fixed && !startsStep) return;

  std::vector<Eigen::Vector3d> positions = body.positionsOf(DataType::PostTransform);
  const Cells cells = cellsOf(*body.mesh);
  const std::size_t indices = cells.count * static_cast<std::size_t>(cells.vertices);
  const bool isCut = positions.size() != body.positions.size() || indices != body.cells.size() ||
                     !std::equal(body.cells.begin(), body.cells.end(), cells.indices);
  std::vector<Eigen::Vector3d> before;
  if (body.role == BodyRole::Particles) {
    const imstk::PbdBody& pbd = *body.object->getPbdBody();
    const std::shared_ptr<imstk::PointwiseMap> map = body.map();
    std::vector<Eigen::Vector3d> began = positions;
    const std::vector<Eigen::Vector3d>& last = m_step->before(body.id);
    bool isMoved = isCut || rests;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const int particle = body.particleOf(map.get(), static_cast<int>(i));
      if (particle < 0 || particle >= pbd.vertices->size()) continue;
      positions[i] = (*pbd.vertices)[particle];
      began[i] = positions[i];
      if (pbd.prevVertices == nullptr || particle >= pbd.prevVertices->size() ||
          (*pbd.invMasses)[particle] == 0)
        continue;
      began[i] = (*pbd.prevVertices)[particle];
      isMoved |= i < last.size() && began[i] != last[i];
    }
    if (startsStep && isMoved) before = std::move(began);
  }
  body.positions = std::move(positions);
  if (isCut) {
    body.setCells(cells);
    m_step->replaceMesh(body.id, body.arrays());
  }
  if (before.empty()) before = m_step->before(body.id);
  if (rests && body.role == BodyRole::Fixed) before = body.positions;
  m_step->setPositions(body.id, before.data(), body.positions.data(), body.positions.size());
}

void SceneStep::detect() {
  end(false);
  m_stepError.clear();
  m_isDetected = true;
  m_handlers.clear();
  // One step less, unless another thread restarts in between.
  int restarts = m_restarts;
  m_isRestarted = restarts > 0;
  if (m_isRestarted) m_restarts.compare_exchange_strong(restarts, restarts - 1);
  m_hasAnswer = attempt([&] {
    for (Body& body : m_bodies) read(body, true);
    for (std::size_t i = 0; i < m_pairs.size(); ++i) {
      const Pair& pair = m_pairs[i];
      if (!pair.interaction.expired())
        m_step->setGuarded(
            pair.id, pair.settings.guarded && !pair.isCrossed && isEnabled(static_cast<int>(i)));
    }
    m_step->detect();
  });
  m_isTrusted = m_hasAnswer && m_step->trusted();
}

// Makes the particles and poses of iMSTK those that the guard left. Returns whether a pose was
// rounded to its quaternion, so that another one is to be guarded. `last`: bodies that the guard
// held stay where they began.
bool SceneStep::write(Body& body, bool last) {
  if (body.role == BodyRole::Particles) {
    const imstk::PbdBody& pbd = *body.object->getPbdBody();
    const std::shared_ptr<imstk::PointwiseMap> map = body.map();
    const std::vector<Eigen::Vector3d>& held = m_step->now(body.id);
    for (std::size_t i = 0; i < held.size(); ++i) {
      const int particle = body.particleOf(map.get(), static_cast<int>(i));
      if (particle >= 0 && held[i] != body.positions[i]) (*pbd.vertices)[particle] = held[i];
    }
    return false;
  }
  const BodyPose &before = m_step->poseBefore(body.id), held = m_step->poseNow(body.id);
  if (!body.isPlaced() || held == body.pose) return false;
  // Room that shrinks without end would end within rounding.
  const double motion = (held.translation - before.translation).norm() +
                        (held.rotation - before.rotation).norm() * 50 * body.size;
  const bool stays = last || motion < std::ldexp(body.size, -20);
  if (stays && !(held == before)) m_step->stay(body.id);
  if (body.role == BodyRole::Fixed) {
    body.pose = m_step->poseNow(body.id);
    return stays && !(held == before);
  }
  imstk::PbdBody& pbd = *body.object->getPbdBody();
  if (stays) {
    (*pbd.vertices)[0] = body.start.position;
    (*pbd.orientations)[0] = body.start.orientation;
    body.pose = before;
    return !(held == before);
  }
  const BodyPose whole = held * inverseOf(body.local);
  (*pbd.vertices)[0] = whole.translation;
  (*pbd.orientations)[0] = imstk::Quatd(whole.rotation).normalized();
  body.pose = poseOf((*pbd.orientations)[0], (*pbd.vertices)[0]) * body.local;
  if (body.pose == held) return false;
  m_step->setPose(body.id, before, body.pose);
  return true;
}

// Moves the geometry of a fixed body to where the guard held it.
void SceneStep::draw(Body& body) {
  if (body.shown == nullptr || body.role != BodyRole::Fixed) return;
  if (body.mesh != nullptr) {
    const std::vector<Eigen::Vector3d>& held = m_step->now(body.id);
    if (held == body.positions) return;
    const std::shared_ptr<imstk::VecDataArray<double, 3>> array = body.mesh->getVertexPositions();
    std::copy(held.begin(), held.end(), array->getPointer());
    body.mesh->postModified();
  } else {
    const BodyPose& held = m_step->poseNow(body.id);
    body.drawn.reset();
    if (held == poseOf(*body.geometry, DataType::PostTransform)) return;
    auto& shape = dynamic_cast<imstk::AnalyticalGeometry&>(*body.geometry);
    shape.setPosition((shape.getTransform().inverse() * held.translation.homogeneous()).head<3>());
    // A plane has a normal in its orientation's frame.
    if (auto* const plane = dynamic_cast<imstk::Plane*>(&shape))
      plane->setNormal(shape.getOrientation(DataType::PreTransform).inverse() *
                       held.rotation.col(1));
    else
      shape.setOrientation(
          imstk::Quatd(imstk::Mat3d(shape.getRotation().transpose() * held.rotation)));
    body.drawn = poseOf(*body.geometry, DataType::PostTransform);
  }
  body.shown->updateGeometries();
}

// iMSTK's solver projects internal constraints last, and leaves rows violated.
void SceneStep::project() {
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    bool isViolated = false;
    for (PalpateCH* handler : m_handlers) {
      imstk::PbdModel& model = *modelOf(handler->pair());
      const double most = kViolationLeft * gapOf(handler->pair());
      for (imstk::PbdConstraint* row : handler->getConstraints()) {
        row->projectConstraint(model.getBodies(), model.getTimeStep(),
                               model.getConfig()->m_solverType);
        isViolated |= row->getConstraintC() < -most;
      }
    }
    if (!isViolated) return;
  }
}

// Returns how many vertices and bodies.
std::size_t SceneStep::hold() {
  project();
  std::vector<int> touching;
  const std::size_t held = hold(touching);
  for (std::size_t i = 0; i < m_pairs.size(); ++i) {
    Pair& pair = m_pairs[i];
    const bool touches = std::find(touching.begin(), touching.end(), pair.id) != touching.end();
    if (touches != pair.isTouching)
      note(nameOf(static_cast<int>(i)) + (touches
                                              ? " touch: they are not guarded until they are apart."
                                              : " are apart: they are guarded from now on."));
    pair.isTouching = touches;
  }
  return held;
}

std::size_t SceneStep::hold(std::vector<int>& touching) {
  std::size_t held = 0;
  for (int round = 0;; ++round) {
    for (Body& body : m_bodies) read(body, false);
    held = m_step->hold(touching);
    if (held == 0) return held;
    if (m_handlers.empty() || round == kRounds) break;
    // The solver moved bodies to where the rows do not see what they touch.
    m_step->restoreFixedEnds();
    for (Body& body : m_bodies) read(body, false);
    m_step->detect();
    for (PalpateCH* handler : m_handlers) handler->appendRows();
    project();
  }
  for (int i = 1; i <= kPlacements; ++i) {
    bool isRounded = false;
    for (Body& body : m_bodies) isRounded |= write(body, i == kPlacements);
    if (!isRounded) return held;
    m_step->hold(touching);
  }
  for (Body& body : m_bodies) write(body, false);
  return held;
}

void SceneStep::end(bool guarded) {
  if (!m_isDetected) return;
  std::size_t held = 0;
  if (guarded && m_hasAnswer)
    attempt([&] {
      held = hold();
      for (Body& body : m_bodies) draw(body);
    });
  m_held = held;
  for (Body& body : m_bodies)
    if (body.role == BodyRole::Rigid) {
      const imstk::PbdBody& pbd = *body.object->getPbdBody();
      body.end = {(*pbd.orientations)[0], (*pbd.vertices)[0]};
    }
  m_step->advance();
  if (guarded) attempt([&] { findCrossedPairs(); });
  if (m_stepError.empty()) m_lastWarning.clear();
  publishError();
  m_isDetected = false;
}

void SceneStep::appendElements(int pair, std::vector<imstk::CollisionElement>& a,
                               std::vector<imstk::CollisionElement>& b) {
  if (!m_hasAnswer || pair < 0) return;
  attempt([&] {
    std::vector<StepElement> sides[2];
    m_step->appendElements(m_pairs[static_cast<std::size_t>(pair)].id, sides[0], sides[1]);
    const imstk::CellTypeId types[] = {IMSTK_VERTEX, IMSTK_EDGE, IMSTK_TRIANGLE};
    const Pair& found = m_pairs[static_cast<std::size_t>(pair)];
    // An element for each cell, of a pair that is not picked for the lowest one alone.
    const auto convert = [&](int body, const StepElement& from, bool otherIsPoint) {
      std::vector<imstk::CollisionElement> elements;
      if (from.idCount == 0) {
        imstk::PointDirectionElement element;
        element.pt = from.point;
        element.dir = from.direction;
        element.penetrationDepth = from.depth;
        elements.emplace_back(element);
      } else if (from.idCount == 1 && otherIsPoint) {
        imstk::PointIndexDirectionElement element;
        element.ptIndex = from.ids[0];
        element.dir = from.direction;
        element.penetrationDepth = from.depth;
        elements.emplace_back(element);
      } else {
        imstk::CellIndexElement element;
        for (int i = 0; i < from.idCount; ++i)
          element.ids[i] = from.ids[static_cast<std::size_t>(i)];
        element.idCount = from.idCount;
        element.cellType = types[from.idCount - 1];
        for (const int cell : m_bodies[static_cast<std::size_t>(body)].cellsWith(from)) {
          element.parentId = cell;
          elements.emplace_back(element);
          if (!found.isPicked) break;
        }
      }
      return elements;
    };
    for (std::size_t i = 0; i < sides[0].size(); ++i)
      for (const auto& ofA : convert(found.bodyA, sides[0][i], sides[1][i].idCount == 0))
        for (const auto& ofB : convert(found.bodyB, sides[1][i], sides[0][i].idCount == 0)) {
          a.push_back(ofA);
          b.push_back(ofB);
        }
  });
}

void SceneStep::appendRows(int pair, std::vector<ParticleRow>& rows) {
  if (!m_hasAnswer || pair < 0) return;
  attempt([&] {
    std::vector<StepRow> stepRows;
    m_step->appendRows(m_pairs[static_cast<std::size_t>(pair)].id, stepRows);
    const auto bodyWithId = [&](int id) -> const Body& {
      return *std::find_if(m_bodies.begin(), m_bodies.end(),
                           [&](const Body& body) { return body.id == id; });
    };
    for (const StepRow& from : stepRows) {
      ParticleRow row{{}, from.normal, from.offset, from.fixedDisplacement};
      for (int i = 0; i < from.termCount; ++i) {
        const StepRow::Term& term = from.terms[static_cast<std::size_t>(i)];
        const Body& body = bodyWithId(term.body);
        const int handle = body.object->getPbdBody()->bodyHandle;
        if (term.vertex < 0) {
          const Eigen::Vector3d inBody = body.local.rotation * term.local + body.local.translation;
          row.terms.push_back({{handle, 0}, term.weight, true, inBody});
          continue;
        }
        const int particle = body.particleOf(body.map().get(), term.vertex);
        if (particle >= 0) {
          row.terms.push_back({{handle, particle}, term.weight, false, Eigen::Vector3d::Zero()});
        } else {
          const auto vertex = static_cast<std::size_t>(term.vertex);
          const Eigen::Vector3d &start = m_step->before(term.body)[vertex],
                                &now = m_step->now(term.body)[vertex];
          row.offset -= term.weight * row.normal.dot(now);
          row.fixedDisplacement += term.weight * (now - start);
        }
      }
      rows.push_back(std::move(row));
    }
  });
}

double SceneStep::gapOf(int pair) const {
  const PalpateSettings& settings = m_pairs[static_cast<std::size_t>(pair)].settings;
  return settings.gap < 0 ? 0.5 * settings.thickness : settings.gap;
}

bool SceneStep::hasRigidBody(int pair) const {
  const Pair& found = m_pairs[static_cast<std::size_t>(pair)];
  return m_bodies[static_cast<std::size_t>(found.bodyA)].role == BodyRole::Rigid ||
         m_bodies[static_cast<std::size_t>(found.bodyB)].role == BodyRole::Rigid;
}

bool SceneStep::sweepsFurther(int pair) const {
  const Pair& found = m_pairs[static_cast<std::size_t>(pair)];
  if (!found.settings.furtherSweeps) return false;
  const Body *tool = &m_bodies[static_cast<std::size_t>(found.bodyA)],
             *tissue = &m_bodies[static_cast<std::size_t>(found.bodyB)];
  if (tool->role != BodyRole::Rigid) std::swap(tool, tissue);
  if (tool->role != BodyRole::Rigid || tissue->role != BodyRole::Particles) return false;
  const imstk::PbdBody& pbd = *tool->object->getPbdBody();
  return !(pbd.externalForce.isZero(0) && pbd.externalTorque.isZero(0));
}

imstk::PbdModel* SceneStep::modelOf(int pair) const {
  const Pair& found = m_pairs[static_cast<std::size_t>(pair)];
  for (const int body : {found.bodyA, found.bodyB})
    if (const auto& object = m_bodies[static_cast<std::size_t>(body)].object)
      return object->getPbdModel().get();
  return nullptr;
}

}  // namespace palpate
