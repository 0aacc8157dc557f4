#include "Search/FieldWork.h"

#include "Search/BruteForce.h"
#include "Search/PairResults.h"
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
void describeField(const Question& question, CollisionData::Contents& contents) {
  describeExact(contents);
  Validity& validity = contents.validity;
  const DistanceField& field = *question.body().field;
  contents.errorBound = field.errorBound();
  const PlacedField placed = question.placedField();
  const double thickness = question.meshes().thicknessAtEnd();
  for (std::uint32_t i = 0; i < contents.shape.size(); ++i) {
    const ShapeContact& contact = contents.shape[i];
    if (!placed.lookup().signIsReliable(placed.inField(contact.point)))
      validity.unreliableSign.push_back(i);
    const double value =
        contact.distance + question.mesh().mesh.radius(contact.vertices, contact.weights);
    if (value <= -reachOf(field)) validity.outsideBand.push_back(i);
    if (thickness - contact.distance < field.errorBound()) validity.nearThreshold.push_back(i);
  }
}

}  // namespace

std::size_t FieldWork::start(const FrameStart& frame) {
  const Question& question = *m_search.question;
  PALPATE_ASSERT(question.usesField());
  m_byBruteForce = frame.engine == Engine::BruteForce;
  if (m_byBruteForce) return m_jobs = 1;
  const PlacedField placed = question.placedField();
  m_search.answer->fieldContacts(question, placed).start(question.mesh());
  const std::size_t elements = m_search.answer->fieldScratch->elements.size();
  const bool shared = frame.divides() && elements >= kSharedFieldSize;
  m_jobs = elements == 0 ? 0 : shared ? kFieldJobs : 1;
  return m_jobs;
}

void FieldWork::run(int round, std::size_t job, JobScratch& scratch) const {
  PALPATE_ASSERT(job < m_jobs && round < 3);
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  const Question& question = *m_search.question;
  if (m_byBruteForce)
    return detectPairByBruteForce(question, scratch.contacts, scratch.intersections);
  const PlacedField placed = question.placedField();
  FieldContacts found = m_search.answer->fieldContacts(question, placed);
  const auto share = [&](std::size_t size, std::size_t i) { return size * i / m_jobs; };
  const FieldScratch& near = *m_search.answer->fieldScratch;
  const std::size_t begin = share(near.elements.size(), job),
                    end = share(near.elements.size(), job + 1);
  if (round == 0)
    found.findValues(share(near.vertices.size(), job), share(near.vertices.size(), job + 1));
  else if (round == 1)
    found.findEdges(begin, end, scratch.contacts.shapes);
  else
    found.findFaces(begin, end, scratch.contacts.shapes);
}

void FieldWork::join(Jobs jobs, const FrameJoin& join) const {
  const Question& question = *m_search.question;
  PairResults& results = join.results;
  results.start(jobs);
  for (const ContactBuffers* found : results.found()) results.facts().add(found->facts);
  results.sortFacts(question);
  results.order(m_search);
  CollisionData::Contents& contents = m_search.answer->contents();
  describeField(question, contents);
  results.assess(m_search, false, join.statistics);
  countContacts(0, contents);
}

}  // namespace palpate
