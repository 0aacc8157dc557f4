#include "CollisionDetection/ShapeWork.h"

#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/PairResults.h"
#include "Queries/ElementsNearShape.h"
#include "Shapes/ShapeContacts.h"
#include "Shapes/ShapeNearings.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

namespace palpate {

void findWithShape(const PairRecord& record, std::span<const std::uint32_t> elements,
                   ShapeContactBuffers& out) {
  const auto &a = record.a->body.shape, &b = record.b->body.shape;
  const MeshPair meshes = record.meshes();
  const PairSettings& settings = meshes.settings;
  PALPATE_ASSERT(a || b);
  if (a && b)
    meshes.keepsApart ? findShapePairNearing(*a, *b, settings.continuous.timeTolerance, out)
                      : findShapePair(*a, *b, settings, out);
  else if (meshes.keepsApart)
    findShapeNearings(record.mesh().body.mesh, a ? *a : *b, settings.continuous.timeTolerance,
                      elements, out);
  else
    findShapeContacts(record.mesh().body.mesh, a ? *a : *b, settings, elements, out);
}

std::size_t ShapeWork::start(const FrameStart&) const {
  const Geometry& mesh = m_record->mesh();
  return mesh.body.shape || mesh.body.tree.octree().size() > 0 ? 1 : 0;
}

void ShapeWork::run(int, std::size_t, JobScratch& scratch) const {
  const PairRecord& record = *m_record;
  PALPATE_ASSERT(record.shape().body.shape);
  if (record.plan.kind == PairKind::MeshAndShape) {
    const PlacedShape& shape = *record.shape().body.shape;
    findElementsNear(record.mesh().body, record.plan.swept() ? shape.before : shape.now, shape.now,
                     record.meshes().maxFeatureDistance(), scratch.elements);
    scratch.candidateCount = scratch.elements.size();
  } else {
    scratch.candidateCount = 1;
  }
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  const auto find = [&](std::span<const std::uint32_t> elements) {
    findWithShape(record, elements, scratch.contacts.shapes);
  };
  if (record.plan.kind == PairKind::MeshAndShape)
    forEachPart(std::span<const std::uint32_t>(scratch.elements), find);
  else
    find({});
  if (record.pair.settings.continuous.earliestTimeOnly) takeEarliest(*m_record, scratch.contacts);
}

void ShapeWork::runByBruteForce(JobScratch& scratch) const {
  detectPairByBruteForce(*m_record, scratch.contacts, scratch.intersections);
  if (m_record->pair.settings.continuous.earliestTimeOnly)
    takeEarliest(*m_record, scratch.contacts);
}

void ShapeWork::join(Jobs jobs, const FrameJoin& join) const {
  PairRecord& record = *m_record;
  PairResults& results = join.results;
  const bool continuous = record.plan.method == Method::Continuous;
  results.start(jobs);
  for (const ContactBuffers* found : results.found()) {
    results.facts().add(found->facts);
    results.facts().addShape(found->shapes, continuous);
  }
  results.sortFacts(record);
  results.order(record);
  CollisionData::Contents& contents = CollisionData::Contents::of(record.next);
  describeExact(contents);
  results.assess(record, false, join.statistics);
  if (record.plan.kind == PairKind::MeshAndShape) results.keepDistinct(record);
  countContacts(continuous ? sizeOf(contents) : 0, contents);
}

}  // namespace palpate
