#include "Search/ShapeWork.h"

#include "Search/BruteForce.h"
#include "Search/PairResults.h"
#include "Queries/ElementsNearShape.h"
#include "Shapes/ShapeContacts.h"
#include "Shapes/ShapeNearings.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

namespace palpate {

void findWithShape(const Question& question, std::span<const std::uint32_t> elements,
                   ShapeContactBuffers& out) {
  const auto &a = question.a.shape, &b = question.b.shape;
  const MeshPair meshes = question.meshes();
  const PairSettings& settings = meshes.settings;
  PALPATE_ASSERT(a || b);
  if (a && b)
    meshes.keepsApart ? findShapePairNearing(*a, *b, settings.continuous.timeTolerance, out)
                      : findShapePair(*a, *b, settings, out);
  else if (meshes.keepsApart)
    findShapeNearings(question.mesh().mesh, a ? *a : *b, settings.continuous.timeTolerance,
                      elements, out);
  else
    findShapeContacts(question.mesh().mesh, a ? *a : *b, settings, elements, out);
}

std::size_t ShapeWork::start(const FrameStart& frame) {
  m_byBruteForce = frame.engine == Engine::BruteForce;
  const Body& mesh = m_search.question->mesh();
  return m_byBruteForce || mesh.shape || mesh.tree.octree().size() > 0 ? 1 : 0;
}

void ShapeWork::run(int, std::size_t, JobScratch& scratch) const {
  const Question& question = *m_search.question;
  PALPATE_ASSERT(question.hasShape());
  if (m_byBruteForce) {
    const AddedTime time(scratch.narrowMilliseconds);
    detectPairByBruteForce(question, scratch.contacts, scratch.intersections);
    if (question.settings().continuous.earliestTimeOnly) takeEarliest(m_search, scratch.contacts);
    return;
  }
  if (question.plan.kind == PairKind::MeshAndShape) {
    const PlacedShape& shape = *question.shape().shape;
    findElementsNear(question.mesh(), question.plan.swept() ? shape.before : shape.now, shape.now,
                     question.meshes().maxFeatureDistance(), scratch.elements);
    scratch.candidateCount = scratch.elements.size();
  } else {
    scratch.candidateCount = 1;
  }
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  const auto find = [&](std::span<const std::uint32_t> elements) {
    findWithShape(question, elements, scratch.contacts.shapes);
  };
  if (question.plan.kind == PairKind::MeshAndShape)
    forEachPart(std::span<const std::uint32_t>(scratch.elements), find);
  else
    find({});
  if (question.settings().continuous.earliestTimeOnly) takeEarliest(m_search, scratch.contacts);
}

void ShapeWork::join(Jobs jobs, const FrameJoin& join) const {
  const Question& question = *m_search.question;
  PairResults& results = join.results;
  const bool continuous = question.plan.method == Method::Continuous;
  results.start(jobs);
  for (const ContactBuffers* found : results.found()) {
    results.facts().add(found->facts);
    results.facts().addShape(found->shapes, continuous);
  }
  results.sortFacts(question);
  results.order(m_search);
  CollisionData::Contents& contents = m_search.answer->contents();
  describeExact(contents);
  results.assess(m_search, false, join.statistics);
  if (question.plan.kind == PairKind::MeshAndShape) results.keepDistinct(m_search);
  countContacts(continuous ? contactCount(contents) : 0, contents);
}

}  // namespace palpate
