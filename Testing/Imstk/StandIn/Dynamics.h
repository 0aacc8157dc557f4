#pragma once

// Task graphs, events, scenes' objects and position-based dynamics, as in iMSTK 7.0.

#include "Geometry.h"

#include <algorithm>
#include <list>
#include <unordered_set>

namespace imstk {

class TaskNode {
 public:
  TaskNode() = default;
  explicit TaskNode(std::function<void()> func, std::string name = "none", bool isCritical = false)
      : m_name(std::move(name)), m_func(std::move(func)), m_isCritical(isCritical) {}
  virtual ~TaskNode() = default;
  virtual void execute() {
    if (m_enabled && m_func) m_func();
  }
  void setEnabled(bool enabled) { m_enabled = enabled; }
  bool m_enabled = true;
  std::string m_name;

 protected:
  std::function<void()> m_func;
  bool m_isCritical = false;
};

using TaskNodeVector = std::vector<std::shared_ptr<TaskNode>>;
using TaskNodeSet = std::unordered_set<std::shared_ptr<TaskNode>>;
using TaskNodeAdjList = std::unordered_map<std::shared_ptr<TaskNode>, TaskNodeSet>;

class TaskGraph {
 public:
  TaskNodeVector& getNodes() { return m_nodes; }
  const TaskNodeAdjList& getInvAdjList() const { return m_invAdjList; }
  bool containsNode(std::shared_ptr<TaskNode> node) const {
    return std::find(m_nodes.begin(), m_nodes.end(), node) != m_nodes.end();
  }
  bool addNode(std::shared_ptr<TaskNode> node) {
    if (containsNode(node)) return false;
    m_nodes.push_back(node);
    return true;
  }
  void addEdge(std::shared_ptr<TaskNode> from, std::shared_ptr<TaskNode> to) {
    m_invAdjList[to].insert(from);
  }
  void nest(TaskGraph& other) {
    for (const auto& node : other.m_nodes) addNode(node);
    for (const auto& edges : other.m_invAdjList)
      for (const auto& from : edges.second) addEdge(from, edges.first);
  }
  void clear() {
    m_nodes.clear();
    m_invAdjList.clear();
  }
  /// Every node once, after those that it waits for.
  void run() {
    TaskNodeSet done;
    std::function<void(const std::shared_ptr<TaskNode>&)> visit =
        [&](const std::shared_ptr<TaskNode>& node) {
          if (!done.insert(node).second) return;
          for (const auto& other : m_nodes)  // in the order of addition
            if (m_invAdjList[node].count(other) != 0) visit(other);
          node->execute();
        };
    for (const auto& node : TaskNodeVector(m_nodes)) visit(node);
  }

 private:
  TaskNodeVector m_nodes;
  TaskNodeAdjList m_invAdjList;
};

class Event {
 public:
  virtual ~Event() = default;
};
class EventObject {
 public:
  using Signal = std::string (*)();
  virtual ~EventObject() = default;
  void postEvent(Event event, Signal signal) {
    for (const auto& observer : m_observers)
      if (observer.first == signal()) observer.second(&event);
  }
  std::vector<std::pair<std::string, std::function<void(Event*)>>> m_observers;
};
template <class T>
void connect(std::shared_ptr<EventObject> sender, EventObject::Signal signal,
             std::function<void(T*)> function) {
  sender->m_observers.emplace_back(signal(),
                                   [=](Event* event) { function(static_cast<T*>(event)); });
}

class SceneObject {
 public:
  explicit SceneObject(const std::string& name) : m_name(name) {}
  virtual ~SceneObject() = default;
  const std::string& getName() const { return m_name; }
  std::shared_ptr<TaskGraph> getTaskGraph() const { return m_taskGraph; }
  virtual bool initialize() { return true; }
  virtual void updateGeometries() {}
  virtual void initGraphEdges() {}
  virtual void reset() {}

 protected:
  std::string m_name;
  std::shared_ptr<TaskGraph> m_taskGraph = std::make_shared<TaskGraph>();
};

class CollidingObject : public SceneObject {
 public:
  explicit CollidingObject(const std::string& name = "CollidingObject") : SceneObject(name) {}
  std::shared_ptr<Geometry> getCollidingGeometry() const { return m_collidingGeometry; }
  void setCollidingGeometry(std::shared_ptr<Geometry> geometry) { m_collidingGeometry = geometry; }

 protected:
  std::shared_ptr<Geometry> m_collidingGeometry;
};

struct PbdBody {
  enum class Type { DEFORMABLE, DEFORMABLE_ORIENTED, RIGID };
  int bodyHandle = -1;
  Type bodyType = Type::DEFORMABLE;
  std::shared_ptr<VecDataArray<double, 3>> prevVertices, vertices, velocities, angularVelocities;
  std::shared_ptr<DataArray<double>> invMasses;
  std::shared_ptr<StdVectorOfQuatd> prevOrientations, orientations;
  std::shared_ptr<StdVectorOfMat3d> invInertias;
  std::vector<int> fixedNodeIds;
  double uniformMassValue = 1.0;

  void setRigid(const Vec3d& pos, const double mass = 1.0,
                const Quatd& orientation = Quatd::Identity(),
                const Mat3d& inertia = Mat3d::Identity()) {
    bodyType = Type::RIGID;
    uniformMassValue = mass;
    vertices = std::make_shared<VecDataArray<double, 3>>(std::vector<Vec3d>{pos});
    orientations = std::make_shared<StdVectorOfQuatd>(1, orientation);
    invInertias = std::make_shared<StdVectorOfMat3d>(1, Mat3d(inertia.inverse()));
  }
};

using PbdParticleId = std::pair<int, int>;
struct PbdState {
  std::vector<std::shared_ptr<PbdBody>> m_bodies;
  const PbdBody& body(const PbdParticleId& id) const {
    return *m_bodies[static_cast<size_t>(id.first)];
  }
  static size_t index(const PbdParticleId& id) { return static_cast<size_t>(id.second); }
  Vec3d& getPosition(const PbdParticleId& id) const { return (*body(id).vertices)[index(id)]; }
  Vec3d& getVelocity(const PbdParticleId& id) const { return (*body(id).velocities)[index(id)]; }
  Quatd& getOrientation(const PbdParticleId& id) const {
    return (*body(id).orientations)[index(id)];
  }
  Vec3d& getAngularVelocity(const PbdParticleId& id) const {
    return (*body(id).angularVelocities)[index(id)];
  }
  double getInvMass(const PbdParticleId& id) const { return (*body(id).invMasses)[index(id)]; }
  Mat3d& getInvInertia(const PbdParticleId& id) const { return (*body(id).invInertias)[index(id)]; }
};

class PbdConstraint {
 public:
  enum class SolverType { xPBD = 0, PBD };
  virtual ~PbdConstraint() = default;
  virtual const std::string getTypeName() const = 0;
  virtual bool computeValueAndGradient(PbdState& bodies, double& c, std::vector<Vec3d>& dcdx) = 0;
  std::vector<PbdParticleId>& getParticles() { return m_particles; }
  double getFriction() const { return m_friction; }
  void setFriction(const double friction) { m_friction = friction; }
  virtual void projectConstraint(PbdState& bodies, const double dt, const SolverType& type) = 0;
  virtual void correctVelocity(PbdState& bodies, const double dt) = 0;

 protected:
  explicit PbdConstraint(const size_t particles) : m_particles(particles), m_dcdx(particles) {}
  std::vector<PbdParticleId> m_particles;
  std::vector<Vec3d> m_dcdx;
  double m_friction = 0.0;
};

class PbdSolver {
 public:
  void addConstraints(std::vector<PbdConstraint*>* constraints) { m_lists.push_back(constraints); }
  const std::list<std::vector<PbdConstraint*>*>& getConstraintLists() const { return m_lists; }
  void clearConstraintLists() { m_lists.clear(); }

 private:
  std::list<std::vector<PbdConstraint*>*> m_lists;
};

/// Free flight with gravity, and the constraints of collisions.
class PbdModel {
 public:
  PbdModel() {
    for (const auto& node : {m_integrate, m_solve, m_update}) m_graph.addNode(node);
    m_graph.addEdge(m_integrate, m_solve);
    m_graph.addEdge(m_solve, m_update);
  }
  std::shared_ptr<PbdBody> addBody() {
    m_state.m_bodies.push_back(std::make_shared<PbdBody>());
    m_state.m_bodies.back()->bodyHandle = static_cast<int>(m_state.m_bodies.size()) - 1;
    return m_state.m_bodies.back();
  }
  PbdState& getBodies() { return m_state; }
  std::shared_ptr<PbdSolver> getSolver() const { return m_solver; }
  std::shared_ptr<TaskNode> getIntegratePositionNode() const { return m_integrate; }
  std::shared_ptr<TaskNode> getSolveNode() const { return m_solve; }
  std::shared_ptr<TaskNode> getUpdateVelocityNode() const { return m_update; }
  TaskGraph m_graph;
  Vec3d m_gravity = Vec3d::Zero();
  double m_dt = 0.01;
  int m_iterations = 10;

  void integratePosition() {
    for (const auto& body : m_state.m_bodies)
      for (size_t i = 0; i < body->vertices->values.size(); ++i) {
        if ((*body->invMasses)[i] == 0) continue;
        (*body->velocities)[i] += m_dt * m_gravity;
        (*body->prevVertices)[i] = (*body->vertices)[i];
        (*body->vertices)[i] += m_dt * (*body->velocities)[i];
        if (body->orientations == nullptr) continue;
        Quatd& q = (*body->orientations)[i];
        (*body->prevOrientations)[i] = q;
        const Vec3d w = 0.5 * m_dt * (*body->angularVelocities)[i];
        q.coeffs() += (Quatd(0, w[0], w[1], w[2]) * q).coeffs();
        q.normalize();
      }
  }
  void solveConstraints() {
    for (int i = 0; i < m_iterations; ++i)
      for (const auto* list : m_solver->getConstraintLists())
        for (PbdConstraint* constraint : *list)
          constraint->projectConstraint(m_state, m_dt, PbdConstraint::SolverType::xPBD);
  }
  void updateVelocity() {
    for (const auto& body : m_state.m_bodies)
      for (size_t i = 0; i < body->vertices->values.size(); ++i) {
        if ((*body->invMasses)[i] == 0) continue;
        (*body->velocities)[i] = ((*body->vertices)[i] - (*body->prevVertices)[i]) / m_dt;
        if (body->orientations == nullptr) continue;
        const Quatd turn = (*body->orientations)[i] * (*body->prevOrientations)[i].inverse();
        (*body->angularVelocities)[i] = (turn.w() < 0 ? -2 : 2) / m_dt * turn.vec();
      }
    for (const auto* list : m_solver->getConstraintLists())
      for (PbdConstraint* constraint : *list) constraint->correctVelocity(m_state, m_dt);
    m_solver->clearConstraintLists();
  }

 private:
  PbdState m_state;
  std::shared_ptr<PbdSolver> m_solver = std::make_shared<PbdSolver>();
  std::shared_ptr<TaskNode> m_integrate =
      std::make_shared<TaskNode>([this] { integratePosition(); }, "integrate");
  std::shared_ptr<TaskNode> m_solve =
      std::make_shared<TaskNode>([this] { solveConstraints(); }, "solve");
  std::shared_ptr<TaskNode> m_update =
      std::make_shared<TaskNode>([this] { updateVelocity(); }, "velocity");
};

class PbdObject : public CollidingObject {
 public:
  explicit PbdObject(const std::string& name = "PbdObject") : CollidingObject(name) {}
  std::shared_ptr<PbdModel> getPbdModel() { return m_model; }
  std::shared_ptr<PbdBody> getPbdBody() { return m_body; }
  void setDynamicalModel(std::shared_ptr<PbdModel> model) {
    m_model = model;
    m_body = model->addBody();
  }
  std::shared_ptr<Geometry> getPhysicsGeometry() const { return m_physics; }
  void setPhysicsGeometry(std::shared_ptr<Geometry> geometry) { m_physics = geometry; }
  std::shared_ptr<GeometryMap> getPhysicsToCollidingMap() const { return m_map; }
  void setPhysicsToCollidingMap(std::shared_ptr<GeometryMap> map) { m_map = map; }

  bool initialize() override {
    if (m_body->bodyType != PbdBody::Type::RIGID)
      m_body->vertices = std::dynamic_pointer_cast<PointSet>(m_physics)->getVertexPositions();
    const size_t particles = m_body->vertices->values.size();
    m_body->velocities = zeros(particles);
    m_body->invMasses = std::make_shared<DataArray<double>>();
    m_body->invMasses->values.assign(particles, 1.0 / m_body->uniformMassValue);
    for (const int fixed : m_body->fixedNodeIds)
      (*m_body->invMasses)[static_cast<size_t>(fixed)] = 0.0;
    m_body->prevVertices = std::make_shared<VecDataArray<double, 3>>(*m_body->vertices);
    if (m_body->orientations != nullptr) {
      m_body->prevOrientations = std::make_shared<StdVectorOfQuatd>(*m_body->orientations);
      m_body->angularVelocities = zeros(particles);
      m_initialOrientations = *m_body->orientations;
    }
    m_initial = m_body->vertices->values;
    updateGeometries();
    return true;
  }
  void updateGeometries() override {
    if (m_body->bodyType == PbdBody::Type::RIGID)
      for (const auto& geometry : {m_physics, m_collidingGeometry}) {
        geometry->setTranslation((*m_body->vertices)[0]);
        geometry->setRotation((*m_body->orientations)[0]);
      }
    if (m_map != nullptr) m_map->update();
  }
  void reset() override {
    m_body->vertices->values = m_body->prevVertices->values = m_initial;
    if (m_body->orientations != nullptr)
      *m_body->orientations = *m_body->prevOrientations = m_initialOrientations;
    m_body->velocities->values.assign(m_initial.size(), Vec3d::Zero());
    updateGeometries();
  }

 private:
  static std::shared_ptr<VecDataArray<double, 3>> zeros(size_t count) {
    return std::make_shared<VecDataArray<double, 3>>(std::vector<Vec3d>(count, Vec3d::Zero()));
  }
  std::shared_ptr<PbdModel> m_model;
  std::shared_ptr<PbdBody> m_body;
  std::shared_ptr<Geometry> m_physics;
  std::shared_ptr<GeometryMap> m_map;
  std::vector<Vec3d> m_initial;
  StdVectorOfQuatd m_initialOrientations;
};

}  // namespace imstk
