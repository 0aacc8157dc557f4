#include "CollisionDetection/PairResults.h"

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

void PairResults::sortFacts(const PairRecord& record) {
  const TriangleMesh &a = record.a->body.mesh, &b = record.b->body.mesh;
  sortUnique(m_facts.verticesA, a.now.size(), m_flags);
  sortUnique(m_facts.verticesB, b.now.size(), m_flags);
  sortUnique(m_facts.degenerateA, a.topology.elements.size(), m_flags);
  sortUnique(m_facts.degenerateB, b.topology.elements.size(), m_flags);
}

std::size_t PairResults::order(PairRecord& record, std::size_t preferred) {
  PALPATE_ASSERT(preferred <= m_found.size());
  return orderContacts(m_found, preferred, m_orderScratch,
                       CollisionData::Contents::of(record.next));
}

void PairResults::assess(PairRecord& record, bool nearby, FrameStatistics& statistics) {
  CollisionData::Contents& contents = CollisionData::Contents::of(record.next);
  PALPATE_ASSERT(std::is_sorted(m_facts.verticesA.begin(), m_facts.verticesA.end()));
  contents.earliestTimeOfImpact = record.earliest.load();
  if (contents.earliestTimeOfImpact <= 1.0) m_facts.clearance = 0.0;
  if (!record.guarded)
    record.trust.finish(record.pair.settings, record.a->inStep(), record.b->inStep(), record.plan,
                        m_facts, nearby, record.meshes(), contents, impacts);
  statistics.exactDecisions += impacts.exactDecisions;
  statistics.validityPairs += impacts.validityPairs;
}

void PairResults::keepFirstImpacts(PairRecord& record, double end) {
  const MeshPair pair = record.meshes();
  if (!pair.reportsDistinct()) return;
  m_firstImpacts.keep(pair, end, m_orderScratch, CollisionData::Contents::of(record.next));
}

void keepDistinct(const PairRecord& record, DistinctContacts& distinct,
                  CountedVector<ShapeContact>& contacts) {
  PALPATE_ASSERT(record.plan.kind == PairKind::MeshAndShape);
  const Body& shape = record.shape().body;
  contacts.resize(distinct.keep(record.mesh().body.mesh, shape.shape->now,
                                shape.mesh.before.transform(), shape.mesh.now.transform(),
                                record.meshes().settings, contacts));
}

void takeEarliest(PairRecord& record, ContactBuffers& contacts) {
  PALPATE_ASSERT(record.pair.settings.continuous.earliestTimeOnly);
  const auto take = [&](auto& list, int = 0) {
    for (const auto& contact : list)
      record.earliest = std::min(record.earliest.load(), contact.timeOfImpact);
    list.clear();
  };
  forEachImpactList(contacts, take);
  take(contacts.shapes.shape);
  take(contacts.shapes.shapeShape);
}

void describeExact(CollisionData::Contents& contents) {
  Validity& validity = contents.validity;
  validity.outsideBand.clear();
  validity.nearThreshold.clear();
  validity.unreliableSign.clear();
  validity.proxyDepth = contents.errorBound = 0.0;
  contents.step.endRows.clear();
}

std::size_t sizeOf(const CollisionData::Contents& contents) {
  std::size_t size = 0;
  forEachTimed(contents, [&](const auto& list) { size += list.size(); });
  return size;
}

void countContacts(std::size_t atImpact, CollisionData::Contents& contents) {
  PALPATE_ASSERT(atImpact <= sizeOf(contents));
  contents.validity.atImpact = atImpact;
  contents.validity.atEnd = sizeOf(contents) - atImpact;
}

}  // namespace palpate
