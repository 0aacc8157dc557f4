#include <palpate/imstk/PalpateScene.h>

#include "iMSTK/SceneStep.h"

#include <palpate/imstk/PalpateCD.h>
#include <palpate/imstk/PalpateCH.h>

#include <imstkCollidingObject.h>
#include <imstkCollisionHandling.h>
#include <imstkPbdObject.h>
#include <imstkPbdObjectCollision.h>
#include <imstkScene.h>
#include <imstkTaskGraph.h>
#include <imstkThreadManager.h>

namespace palpate {

namespace {

// One node, after all that the detections of interactions wait for, and before these.
void addDetectionTo(imstk::TaskGraph& graph, const std::shared_ptr<SceneStep>& step) {
  const auto node =
      std::make_shared<imstk::TaskNode>([step] { step->detect(); }, "Palpate_Detection");
  std::vector<std::shared_ptr<imstk::TaskNode>> detections;
  for (const auto& interaction : step->interactions())
    if (graph.containsNode(interaction->getCollisionDetectionNode()))
      detections.push_back(interaction->getCollisionDetectionNode());
  if (detections.empty()) return;
  std::vector<std::shared_ptr<imstk::TaskNode>> conditions;
  for (const auto& detection : detections) {
    const auto before = graph.getInvAdjList().find(detection);
    if (before == graph.getInvAdjList().end()) continue;
    conditions.insert(conditions.end(), before->second.begin(), before->second.end());
  }
  graph.addNode(node);
  for (const auto& condition : conditions) graph.addEdge(condition, node);
  for (const auto& detection : detections) graph.addEdge(node, detection);
}

int threadsOf(int threads) {
  return threads > 0 ? threads
                     : static_cast<int>(imstk::ParallelUtils::ThreadManager::getThreadPoolSize());
}

}  // namespace

const char* toString(PalpateMethod method) noexcept {
  switch (method) {
    case PalpateMethod::Default:
      return "Default";
    case PalpateMethod::Auto:
      return "Auto";
    case PalpateMethod::Intersection:
      return "Intersection";
    case PalpateMethod::Proximity:
      return "Proximity";
    case PalpateMethod::Continuous:
      return "Continuous";
  }
  return "unknown";
}

PalpateScene::PalpateScene(const std::shared_ptr<imstk::Scene>& scene, int threads)
    : m_step(std::make_shared<SceneStep>(threadsOf(threads))) {
  // The scene keeps the step, not the other way round.
  const std::weak_ptr<imstk::Scene> owner = scene;
  const std::shared_ptr<SceneStep> step = m_step;
  imstk::connect<imstk::Event>(scene, &imstk::Scene::configureTaskGraph, [=](imstk::Event*) {
    step->addSharedPairs();
    if (const auto configured = owner.lock()) addDetectionTo(*configured->getTaskGraph(), step);
  });
}

PalpateScene::~PalpateScene() = default;

std::shared_ptr<imstk::PbdObjectCollision> PalpateScene::makeCollision(
    const std::shared_ptr<imstk::CollidingObject>& a,
    const std::shared_ptr<imstk::CollidingObject>& b, const PalpateSettings& settings) {
  // iMSTK takes the PbdObject first.
  const bool swaps = std::dynamic_pointer_cast<imstk::PbdObject>(a) == nullptr;
  const auto first = std::dynamic_pointer_cast<imstk::PbdObject>(swaps ? b : a);
  const auto second = swaps ? a : b;
  if (first == nullptr) {
    m_step->warn("makeCollision() needs a PbdObject.");
    return nullptr;
  }
  const auto interaction =
      std::make_shared<imstk::PbdObjectCollision>(first, second, PalpateCD::getStaticTypeName());
  const auto detection = std::dynamic_pointer_cast<PalpateCD>(interaction->getCollisionDetection());
  const auto handler = std::make_shared<PalpateCH>(detection);
  handler->setInputObjectA(first);
  handler->setInputObjectB(second);
  handler->setInputCollisionData(detection->getCollisionData());
  interaction->setCollisionHandlingAB(handler);
  PalpateSettings chosen = settings;
  // Rows without a gap would leave no room but rounding.
  if (chosen.thickness == 0 && chosen.method != PalpateMethod::Intersection) chosen.thickness = -1;
  share(interaction, chosen);
  return interaction;
}

bool PalpateScene::share(const std::shared_ptr<imstk::CollisionInteraction>& interaction,
                         const PalpateSettings& settings) {
  const auto handlerA = interaction->getCollisionHandlingA(),
             handlerB = interaction->getCollisionHandlingB();
  if (handlerA == nullptr) {
    m_step->warn("An interaction without a handler is not shared.");
    return false;
  }
  auto detection = std::dynamic_pointer_cast<PalpateCD>(interaction->getCollisionDetection());
  if (detection == nullptr) {
    detection = std::make_shared<PalpateCD>();
    for (const int side : {0, 1})
      detection->setInput(interaction->getCollisionDetection()->getInput(side), side);
    interaction->setCollisionDetection(detection);
    handlerA->setInputCollisionData(detection->getCollisionData());
    if (handlerB != nullptr) handlerB->setInputCollisionData(detection->getCollisionData());
  }
  detection->setStep(m_step);
  m_step->share(interaction, detection, settings);
  return true;
}

void PalpateScene::showHeld(const std::shared_ptr<imstk::CollidingObject>& object) {
  m_step->showHeld(object);
}
void PalpateScene::setRadius(const std::shared_ptr<imstk::Geometry>& geometry, double radius) {
  m_step->setRadius(geometry, radius);
}

void PalpateScene::restart() { m_step->restart(); }
bool PalpateScene::trusted() const { return m_step->trusted(); }
std::size_t PalpateScene::held() const { return m_step->held(); }
std::string PalpateScene::error() const { return m_step->error(); }

}  // namespace palpate
