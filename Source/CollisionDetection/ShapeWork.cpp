#include "CollisionDetection/ShapeWork.h"

#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/PairResults.h"
#include "Queries/ElementsNearShape.h"
#include "Shapes/ShapeContacts.h"
#include "Shapes/ShapeNearings.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"

namespace palpate {

std::size_t ShapeWork::start(const FrameStart&) const {
  const Geometry& mesh = m_record->mesh();
  return mesh.body.shape || mesh.body.tree.octree().size() > 0 ? 1 : 0;
}

void ShapeWork::run(int, std::size_t, JobScratch& scratch) const {
  const MeshPair meshes = m_record->meshes();
  if (meshes.isShapePair())
    findPair(meshes, scratch);
  else
    findNearMesh(meshes, scratch);
  if (meshes.settings.earliestTimeOnly) takeEarliest(*m_record, scratch.contacts);
}

void ShapeWork::findPair(const MeshPair& meshes, JobScratch& scratch) const {
  PALPATE_ASSERT(meshes.isShapePair());
  if (meshes.keepsApart)
    findShapePairNearing(*meshes.shapeOfA, *meshes.shapeOfB, meshes.settings.timeTolerance,
                         scratch.contacts);
  else
    findShapePair(*meshes.shapeOfA, *meshes.shapeOfB, meshes.settings, scratch.contacts);
}

void ShapeWork::findNearMesh(const MeshPair& meshes, JobScratch& scratch) const {
  PALPATE_ASSERT(meshes.hasShape() && !meshes.isShapePair());
  const auto& [analytical, now, before] = meshes.shape();
  findElementsNear(m_record->mesh().body, m_record->plan.swept() ? before : now, now,
                   meshes.maxFeatureDistance(), scratch.elements);
  const MemoryScope memory(MemoryStage::NarrowPhase);
  Stopwatch watch;
  if (meshes.keepsApart)
    findShapeNearings(meshes.mesh(), meshes.shape(), meshes.settings.timeTolerance,
                      scratch.elements, scratch.contacts);
  else
    findShapeContacts(meshes.mesh(), meshes.shape(), meshes.settings, scratch.elements,
                      scratch.contacts);
  scratch.narrowMilliseconds += watch.lap();
}

void ShapeWork::runByBruteForce(JobScratch& scratch) const {
  detectPairByBruteForce(*m_record, scratch.contacts, scratch.intersections);
  if (m_record->pair.settings.earliestTimeOnly) takeEarliest(*m_record, scratch.contacts);
}

void ShapeWork::join(Jobs jobs, const FrameJoin& join) const {
  PairRecord& record = *m_record;
  PairResults& results = join.results;
  const bool continuous = record.plan.method == Method::Continuous;
  results.start(jobs);
  for (const ContactBuffers* found : results.found()) {
    results.facts().add(found->facts);
    results.facts().addShape(*found, continuous);
  }
  results.sortFacts(record);
  results.order(record);
  CollisionData::Contents& contents = record.next.contents();
  describeExact(contents);
  results.assess(record, false, join.statistics);
  if (record.plan.kind == PairKind::MeshAndShape) results.keepDistinct(record);
  countContacts(continuous ? sizeOf(contents) : 0, contents);
}

}  // namespace palpate
