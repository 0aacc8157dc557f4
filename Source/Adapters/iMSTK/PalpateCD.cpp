#include <palpate/imstk/PalpateCD.h>

#include "iMSTK/SceneStep.h"

#include <imstkCDObjectFactory.h>
#include <imstkGeometry.h>
#include <imstkThreadManager.h>

namespace palpate {

namespace {
const imstk::CDObjectRegistrar<PalpateCD> registrar("PalpateCD");
}

PalpateCD::PalpateCD() {
  setRequiredInputType<imstk::Geometry>(0);
  setRequiredInputType<imstk::Geometry>(1);
}

PalpateCD::~PalpateCD() = default;

void PalpateCD::setStep(std::shared_ptr<SceneStep> step) {
  m_step = std::move(step);
  m_ownStep = false;
}

void PalpateCD::computeCollisionDataAB(std::shared_ptr<imstk::Geometry> geometryA,
                                       std::shared_ptr<imstk::Geometry> geometryB,
                                       std::vector<imstk::CollisionElement>& elementsA,
                                       std::vector<imstk::CollisionElement>& elementsB) {
  // Pickers change the inputs of one detection.
  if (m_step == nullptr || (m_ownStep && m_inputs != std::make_pair(geometryA, geometryB))) {
    m_ownStep = true;
    m_inputs = {geometryA, geometryB};
    m_step = std::make_shared<SceneStep>(
        static_cast<int>(imstk::ParallelUtils::ThreadManager::getThreadPoolSize()));
    m_pair = m_step->addPair(geometryA, geometryB, m_settings);
  }
  if (m_pair < 0) {
    m_step->warn("A PalpateCD is in no scene that was initialized, or its pair was refused.");
    return;
  }
  if (m_ownStep || !m_step->isDetected()) m_step->detect();
  m_step->appendElements(m_pair, elementsA, elementsB);
}

void PalpateCD::updatePreviousTimestepGeometry(std::shared_ptr<const imstk::Geometry>,
                                               std::shared_ptr<const imstk::Geometry>) {
  if (m_step != nullptr && !m_ownStep) m_step->end(true);
}

}  // namespace palpate
