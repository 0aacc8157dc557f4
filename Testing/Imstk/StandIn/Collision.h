#pragma once

// Detection, handling, interactions and the scene, as in iMSTK 7.0.

#include "Dynamics.h"

namespace imstk {

struct EmptyElement {};
struct CellIndexElement {
  int ids[4] = {-1, -1, -1, -1};
  int idCount = 0;
  CellTypeId cellType = IMSTK_VERTEX;
};
struct PointDirectionElement {
  Vec3d pt = Vec3d::Zero();
  Vec3d dir = Vec3d::Zero();
  double penetrationDepth = 0.0;
};
struct PointIndexDirectionElement {
  int ptIndex = 0;
  Vec3d dir = Vec3d::Zero();
  double penetrationDepth = 0.0;
};
enum class CollisionElementType {
  Empty,
  CellVertex,
  CellIndex,
  PointDirection,
  PointIndexDirection
};
struct CollisionElement {  // iMSTK's m_element is a union
  explicit CollisionElement(const CellIndexElement& element)
      : m_type(CollisionElementType::CellIndex) {
    m_element.m_CellIndexElement = element;
  }
  explicit CollisionElement(const PointDirectionElement& element)
      : m_type(CollisionElementType::PointDirection) {
    m_element.m_PointDirectionElement = element;
  }
  explicit CollisionElement(const PointIndexDirectionElement& element)
      : m_type(CollisionElementType::PointIndexDirection) {
    m_element.m_PointIndexDirectionElement = element;
  }
  struct Element {
    CellIndexElement m_CellIndexElement;
    PointDirectionElement m_PointDirectionElement;
    PointIndexDirectionElement m_PointIndexDirectionElement;
  } m_element;
  CollisionElementType m_type;
  bool m_ccdData = false;
};
class CollisionData {
 public:
  std::vector<CollisionElement> elementsA, elementsB;
  std::shared_ptr<Geometry> geomA, geomB, prevGeomA, prevGeomB;
};

class CollisionDetectionAlgorithm {
 public:
  virtual ~CollisionDetectionAlgorithm() = default;
  virtual const std::string getTypeName() const = 0;
  const std::shared_ptr<CollisionData> getCollisionData() const { return m_colData; }
  std::shared_ptr<Geometry> getInput(size_t port = 0) const { return m_inputs[port]; }
  void setInput(std::shared_ptr<Geometry> geometry, size_t port = 0) { m_inputs[port] = geometry; }
  void update() {
    if (m_checks[0](m_inputs[0].get()) && m_checks[1](m_inputs[1].get())) requestUpdate();
  }

 protected:
  template <class T>
  void setRequiredInputType(size_t port) {
    m_checks[port] = [](Geometry* p) { return dynamic_cast<T*>(p) != nullptr; };
  }
  virtual void requestUpdate() {
    m_colData->geomA = m_inputs[0];
    m_colData->geomB = m_inputs[1];
    m_colData->elementsA.clear();
    m_colData->elementsB.clear();
    computeCollisionDataAB(m_inputs[0], m_inputs[1], m_colData->elementsA, m_colData->elementsB);
  }
  virtual void computeCollisionDataAB(std::shared_ptr<Geometry>, std::shared_ptr<Geometry>,
                                      std::vector<CollisionElement>&,
                                      std::vector<CollisionElement>&) {}

 private:
  std::shared_ptr<CollisionData> m_colData = std::make_shared<CollisionData>();
  std::shared_ptr<Geometry> m_inputs[2];
  std::function<bool(Geometry*)> m_checks[2];
};

class CCDAlgorithm : public CollisionDetectionAlgorithm {
 public:
  virtual void updatePreviousTimestepGeometry(std::shared_ptr<const Geometry> geomA,
                                              std::shared_ptr<const Geometry> geomB) = 0;

 protected:
  CCDAlgorithm() = default;
};

template <class T, class... Args>
class ObjectFactory {
 public:
  using Creator = std::function<T(Args...)>;
  static T create(const std::string& name) { return registry().at(name)(); }
  static void add(const std::string& name, Creator creator) { registry()[name] = creator; }
  static bool contains(const std::string& name) { return registry().count(name) != 0; }

 private:
  static std::unordered_map<std::string, Creator>& registry() {
    static std::unordered_map<std::string, Creator> creators;
    return creators;
  }
};
class CDObjectFactory : public ObjectFactory<std::shared_ptr<CollisionDetectionAlgorithm>> {
 public:
  static std::shared_ptr<CollisionDetectionAlgorithm> makeCollisionDetection(
      const std::string name) {
    return create(name);
  }
};
template <class T>
struct CDObjectRegistrar {
  explicit CDObjectRegistrar(std::string name) {
    CDObjectFactory::add(name, [] { return std::make_shared<T>(); });
  }
};

class CollisionHandling {
 public:
  virtual ~CollisionHandling() = default;
  virtual const std::string getTypeName() const = 0;
  void setInputObjectA(std::shared_ptr<CollidingObject> a) { m_a = a; }
  void setInputObjectB(std::shared_ptr<CollidingObject> b) { m_b = b; }
  std::shared_ptr<CollidingObject> getInputObjectA() const { return m_a; }
  std::shared_ptr<CollidingObject> getInputObjectB() const { return m_b; }
  void setInputCollisionData(std::shared_ptr<CollisionData> data) { m_colData = data; }
  void update() {
    if (m_colData != nullptr) handle(m_colData->elementsA, m_colData->elementsB);
  }

 protected:
  virtual void handle(const std::vector<CollisionElement>& a,
                      const std::vector<CollisionElement>& b) = 0;
  std::shared_ptr<CollidingObject> m_a, m_b;
  std::shared_ptr<const CollisionData> m_colData;
};

class PbdCollisionHandling : public CollisionHandling {
 public:
  IMSTK_TYPE_NAME(PbdCollisionHandling)
  double getFriction() const { return m_friction; }
  void setFriction(const double friction) { m_friction = friction; }

 protected:
  void handle(const std::vector<CollisionElement>&, const std::vector<CollisionElement>&) override {
  }

 private:
  double m_friction = 0.0;
};

class CollisionInteraction : public SceneObject {
 public:
  void setCollisionHandlingAB(std::shared_ptr<CollisionHandling> handling) {
    m_handling = handling;
  }
  std::shared_ptr<CollisionDetectionAlgorithm> getCollisionDetection() const { return m_detection; }
  std::shared_ptr<CollisionHandling> getCollisionHandlingA() const { return m_handling; }
  std::shared_ptr<TaskNode> getCollisionDetectionNode() const { return m_detect; }
  virtual void setEnabled(const bool enabled) { m_detect->setEnabled(enabled); }
  virtual bool getEnabled() const { return m_detect->m_enabled; }

 protected:
  CollisionInteraction(std::string name, std::shared_ptr<CollidingObject> a,
                       std::shared_ptr<CollidingObject> b, const std::string& type)
      : SceneObject(name), m_objA(a), m_objB(b) {
    m_detection = CDObjectFactory::makeCollisionDetection(type);
    m_detection->setInput(a->getCollidingGeometry(), 0);
    m_detection->setInput(b->getCollidingGeometry(), 1);
    for (const auto& node : {m_geometryUpdate, m_detect, m_handle}) m_taskGraph->addNode(node);
  }
  std::shared_ptr<CollidingObject> m_objA, m_objB;
  std::shared_ptr<CollisionDetectionAlgorithm> m_detection;
  std::shared_ptr<CollisionHandling> m_handling;
  std::shared_ptr<TaskNode> m_geometryUpdate = std::make_shared<TaskNode>([this] {
    m_objA->updateGeometries();
    m_objB->updateGeometries();
  });
  std::shared_ptr<TaskNode> m_detect =
      std::make_shared<TaskNode>([this] { m_detection->update(); }, "detection");
  std::shared_ptr<TaskNode> m_handle = std::make_shared<TaskNode>([this] { m_handling->update(); });
};

class PbdObjectCollision : public CollisionInteraction {
 public:
  PbdObjectCollision(std::shared_ptr<PbdObject> a, std::shared_ptr<CollidingObject> b,
                     std::string type = "")
      : CollisionInteraction(a->getName() + "_vs_" + b->getName(), a, b, type) {
    auto handling = std::make_shared<PbdCollisionHandling>();
    handling->setInputObjectA(a);
    handling->setInputObjectB(b);
    handling->setInputCollisionData(m_detection->getCollisionData());
    setCollisionHandlingAB(handling);
    m_taskGraph->addNode(m_updatePrevious);
  }
  void setFriction(const double friction) {
    std::dynamic_pointer_cast<PbdCollisionHandling>(m_handling)->setFriction(friction);
  }
  void initGraphEdges() override {
    const auto model = std::dynamic_pointer_cast<PbdObject>(m_objA)->getPbdModel();
    m_taskGraph->nest(model->m_graph);
    m_taskGraph->addEdge(model->getIntegratePositionNode(), m_geometryUpdate);
    m_taskGraph->addEdge(m_geometryUpdate, m_detect);
    m_taskGraph->addEdge(m_detect, m_handle);
    m_taskGraph->addEdge(m_handle, model->getSolveNode());
    m_taskGraph->addEdge(model->getSolveNode(), m_updatePrevious);
    m_taskGraph->addEdge(m_updatePrevious, model->getUpdateVelocityNode());
  }

 private:
  std::shared_ptr<TaskNode> m_updatePrevious = std::make_shared<TaskNode>([this] {
    if (auto ccd = std::dynamic_pointer_cast<CCDAlgorithm>(m_detection))
      ccd->updatePreviousTimestepGeometry(ccd->getInput(0), ccd->getInput(1));
  });
};

class Scene : public EventObject {
 public:
  explicit Scene(const std::string&) {}
  static std::string configureTaskGraph() { return "configureTaskGraph"; }
  void addSceneObject(std::shared_ptr<SceneObject> object) { m_objects.push_back(object); }
  void addInteraction(std::shared_ptr<SceneObject> interaction) { addSceneObject(interaction); }
  std::shared_ptr<TaskGraph> getTaskGraph() const { return m_taskGraph; }
  bool initialize() {
    for (const auto& object : m_objects) object->initialize();
    m_taskGraph->clear();
    for (const auto& object : m_objects) {
      object->initGraphEdges();
      m_taskGraph->nest(*object->getTaskGraph());
    }
    postEvent(Event(), &Scene::configureTaskGraph);
    return true;
  }
  void reset() { m_resets = true; }
  void advance(const double) {
    if (m_resets)
      for (const auto& object : m_objects) object->reset();
    m_resets = false;
    m_taskGraph->run();
    for (const auto& object : m_objects) object->updateGeometries();
  }

 private:
  std::vector<std::shared_ptr<SceneObject>> m_objects;
  std::shared_ptr<TaskGraph> m_taskGraph = std::make_shared<TaskGraph>();
  bool m_resets = false;
};

}  // namespace imstk
