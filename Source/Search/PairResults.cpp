#include "Search/PairResults.h"

#include "Contact/ContactLists.h"
#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

namespace {

/// Sorts ids, which are below `count`, and keeps each once.
void sortUnique(Buffer<std::uint32_t>& ids, std::size_t count, Buffer<std::uint8_t>& flags) {
  PALPATE_ASSERT(std::all_of(ids.begin(), ids.end(), [&](std::uint32_t id) { return id < count; }));
  if (ids.size() < count) {
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    return;
  }
  flags.assign(count, 0);
  for (const std::uint32_t id : ids) flags[id] = 1;
  ids.clear();
  for (std::uint32_t id = 0; id < count; ++id)
    if (flags[id]) ids.push_back(id);
}

}  // namespace

void PairResults::start(Jobs jobs) {
  m_facts.clear();
  impacts.clear();
  m_found.clear();
  m_intersections.clear();
  for (const auto& job : jobs) {
    m_found.push_back(&job->contacts);
    m_intersections.push_back(&job->intersections);
  }
}

void PairResults::sortFacts(const Question& question) {
  const TriangleMesh &a = question.a.mesh, &b = question.b.mesh;
  sortUnique(m_facts.verticesA, a.now.size(), m_flags);
  sortUnique(m_facts.verticesB, b.now.size(), m_flags);
  sortUnique(m_facts.degenerateA, a.topology.elements.size(), m_flags);
  sortUnique(m_facts.degenerateB, b.topology.elements.size(), m_flags);
}

std::size_t PairResults::order(const Search& search, std::size_t preferred) {
  PALPATE_ASSERT(preferred <= m_found.size());
  return orderContacts(m_found, preferred, m_orderScratch, search.answer->contents());
}

void PairResults::assess(const Search& search, bool nearby, FrameStatistics& statistics) {
  const Question& question = *search.question;
  CollisionData::Contents& contents = search.answer->contents();
  PALPATE_ASSERT(std::is_sorted(m_facts.verticesA.begin(), m_facts.verticesA.end()));
  contents.earliestTimeOfImpact = search.answer->earliest.load();
  if (contents.earliestTimeOfImpact <= 1.0) m_facts.clearance = 0.0;
  if (search.trust)
    search.trust->finish(question.settings(), question.aInStep, question.bInStep, question.plan,
                         m_facts, nearby, question.meshes(), contents, impacts);
  statistics.exactDecisions += impacts.exactDecisions;
  statistics.validityPairs += impacts.validityPairs;
}

void PairResults::keepFirstImpacts(const Search& search, double end) {
  const MeshPair pair = search.question->meshes();
  if (!pair.reportsDistinct()) return;
  m_firstImpacts.keep(pair, end, m_orderScratch, search.answer->contents());
}

void keepDistinct(const Question& question, DistinctShapeContacts& distinct,
                  CountedVector<ShapeContact>& contacts) {
  PALPATE_ASSERT(question.plan.kind == PairKind::MeshAndShape);
  const Body& shape = question.shape();
  contacts.resize(distinct.keep(question.mesh().mesh, shape.shape->now,
                                shape.mesh.before.transform(), shape.mesh.now.transform(),
                                question.meshes().settings, contacts));
}

void takeEarliest(const Search& search, ContactBuffers& contacts) {
  PALPATE_ASSERT(search.question->settings().continuous.earliestTimeOnly);
  std::atomic<double>& earliest = search.answer->earliest;
  forEachContactList(contacts, [&](ContactKind, auto& list) {
    for (const auto& contact : list) earliest = std::min(earliest.load(), contact.timeOfImpact);
    list.clear();
  });
}

void describeExact(CollisionData::Contents& contents) {
  Validity& validity = contents.validity;
  validity.outsideBand.clear();
  validity.nearThreshold.clear();
  validity.unreliableSign.clear();
  validity.proxyDepth = contents.errorBound = 0.0;
  contents.step.endRows.clear();
}

void countContacts(std::size_t atImpact, CollisionData::Contents& contents) {
  PALPATE_ASSERT(atImpact <= contactCount(contents));
  contents.validity.atImpact = atImpact;
  contents.validity.atEnd = contactCount(contents) - atImpact;
}

}  // namespace palpate
