#include "CollisionDetection/FieldWork.h"

#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/PairResults.h"
#include "DistanceField/FieldCells.h"
#include "DistanceField/FieldContacts.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"

namespace palpate {

namespace {

/// Jobs of a pair with at least this many elements near the field, where there is more than one
/// thread.
constexpr std::size_t kFieldJobs = 32, kSharedFieldSize = 512;

/// Validity's lists, and the error bound.
void describeField(const PairRecord& record, CollisionData::Contents& contents) {
  describeExact(contents);
  Validity& validity = contents.validity;
  const DistanceField& field = *record.body().body.field;
  contents.errorBound = field.errorBound();
  const PlacedField placed = record.placedField();
  const double thickness = record.meshes().thicknessAtEnd();
  for (std::uint32_t i = 0; i < contents.shape.size(); ++i) {
    const ShapeContact& contact = contents.shape[i];
    if (!placed.lookup().signIsReliable(placed.inField(contact.point)))
      validity.unreliableSign.push_back(i);
    const double value =
        contact.distance + record.mesh().body.mesh.radius(contact.vertices, contact.weights);
    if (value <= -reachOf(field)) validity.outsideBand.push_back(i);
    if (thickness - contact.distance < field.errorBound()) validity.nearThreshold.push_back(i);
  }
}

}  // namespace

std::size_t FieldWork::start(const FrameStart& frame) {
  PALPATE_ASSERT(m_record->usesField());
  const PlacedField placed = m_record->placedField();
  m_record->fieldContacts(placed).start(m_record->mesh().body);
  const std::size_t elements = m_record->fieldScratch->elements.size();
  const bool shared = frame.divides() && elements >= kSharedFieldSize;
  m_jobs = elements == 0 ? 0 : shared ? kFieldJobs : 1;
  return m_jobs;
}

void FieldWork::run(int round, std::size_t job, JobScratch& scratch) const {
  PALPATE_ASSERT(job < m_jobs && round < 3);
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  const PlacedField placed = m_record->placedField();
  FieldContacts found = m_record->fieldContacts(placed);
  const auto share = [&](std::size_t size, std::size_t i) { return size * i / m_jobs; };
  const FieldScratch& near = *m_record->fieldScratch;
  const std::size_t begin = share(near.elements.size(), job),
                    end = share(near.elements.size(), job + 1);
  if (round == 0)
    found.findValues(share(near.vertices.size(), job), share(near.vertices.size(), job + 1));
  else if (round == 1)
    found.findEdges(begin, end, scratch.contacts.shapes);
  else
    found.findFaces(begin, end, scratch.contacts.shapes);
}

void FieldWork::runByBruteForce(JobScratch& scratch) const {
  detectPairByBruteForce(*m_record, scratch.contacts, scratch.intersections);
}

void FieldWork::join(Jobs jobs, const FrameJoin& join) const {
  PairRecord& record = *m_record;
  PairResults& results = join.results;
  results.start(jobs);
  for (const ContactBuffers* found : results.found()) results.facts().add(found->facts);
  results.sortFacts(record);
  results.order(record);
  CollisionData::Contents& contents = CollisionData::Contents::of(record.next);
  describeField(record, contents);
  results.assess(record, false, join.statistics);
  countContacts(0, contents);
}

}  // namespace palpate
