#include "CollisionDetection/Detection.h"

#include "CollisionDetection/PairOrder.h"
#include "CollisionDetection/Planning.h"
#include "Search/BruteForce.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <cstddef>

namespace palpate {

FrameStatistics Detection::run(StopScope::Token token, Trace* traced, FrameStatistics& last) {
  const MemoryScope memory(MemoryStage::Pairs);
  for (const auto& record : m_pairs.records()) {
    const PairMoment moment = record->momentIn(m_geometries.stepNumber());
    record->memory.forEach([&](auto& part) { part.startStep(moment); });
  }
  m_octrees.update(SceneOctrees::UpdateFor::Frame, traced);
  FrameStatistics next = m_octrees.counts();
  const auto records = outdatedPairs();
  for (const auto& record : m_pairs.records()) {
    record->found.statistics = {};
    if (record->isCurrent()) planByFieldIfProven(*record, m_settings.engine);
  }
  if (token) orderByUrgency(m_selected);
  completePlans(records, token);
  Stopwatch watch;
  const bool built = updateProxies(records);
  if (built) next.milliseconds.octree += watch.lap();
  {
    const StopScope scope(token);
    findContacts(records, next, traced);
    next.freeMotionUnfinished =
        !m_freeMotions.find(m_geometries, m_pairs, m_settings.engine, m_threads, m_frame.jobs());
  }
  watch.lap();
  completeAnswers(records, token);
  next.milliseconds.order += watch.lap();
  // Nothing below throws.
  if (token) keepUnfinished(records, next, last);
  m_freeMotions.commit(m_geometries);
  commit(records);
  countContacts(next);
  for (const auto& geometry : m_geometries.all())
    geometry->step.recordDetection(geometry->body.mesh);
  return next;
}

void Detection::run(SeparateSearches searches) {
  const MemoryScope memory(MemoryStage::Pairs);
  m_octrees.update(SceneOctrees::UpdateFor::Separate, nullptr, searches);
  m_outdatedSearches.clear();
  for (const auto& own : searches)
    if (own->a->meets(*own->b) && !own->version.isCurrent(own->state())) {
      own->version.invalidate();
      m_outdatedSearches.push_back(own->search());
    }
  FrameStatistics unused;
  m_frame.detect(m_outdatedSearches, context(unused, nullptr));
  for (const auto& own : searches)
    if (own->a->meets(*own->b)) own->version.commit(own->state());
}

void Detection::forEachCandidateBatch(const PairRecord* only, Frame::BatchFunction function,
                                      void* context) {
  m_selected.clear();
  for (const auto& record : m_pairs.records())
    if ((!only || record.get() == only) && record->collides()) m_selected.push_back(record.get());
  if (m_settings.engine == Engine::Octree) {
    // If one thread has refitted the octrees and few candidates are expected, other threads would
    // wait for the data longer than they could help.
    constexpr std::size_t kFew = 16384;
    std::size_t found = 0;
    for (const PairRecord* record : m_selected) found += record->found.candidateCount;
    const bool byOne = m_octrees.wereUpdatedByOneThread() && found < kFew;
    return m_frame.forEach(m_selected, byOne ? m_singleThread : m_threads, function, context);
  }
  Buffer<ElementPair> candidates;
  for (const PairRecord* record : m_selected) {
    if (!record->hasCandidates()) continue;
    findCandidatesByBruteForce(record->meshes(), candidates);
    if (!candidates.empty()) function(context, record->pair, candidates);
  }
}

/// Pairs that do not collide are not among them: their result is empty.
std::span<PairRecord* const> Detection::outdatedPairs() {
  m_selected.clear();
  for (const auto& record : m_pairs.records())
    if (record->collides() && !record->isCurrent()) m_selected.push_back(record.get());
  return m_selected;
}

/// Completes the plans of pairs. Those for which no time is left become Urgency::isUnfinished.
void Detection::completePlans(std::span<PairRecord* const> records, StopScope::Token token) {
  for (PairRecord* record : records) {
    bool& isUnfinished = record->memory.urgency.isUnfinished;
    isUnfinished = token && token->isOver();
    if (!isUnfinished) completePlan(*record, m_settings.engine);
  }
}

bool Detection::updateProxies(std::span<PairRecord* const> records) {
  const MemoryScope memory(MemoryStage::Octrees);
  bool built = false;
  for (PairRecord* record : records) {
    if (record->support->kind != PairKind::Proxy) continue;
    ProxyMemory& own = record->memory.proxy;
    built |= own.update(*record, m_pairs.records(), m_threads);
    record->question->proxy = own.proxy.get();
  }
  return built;
}

void Detection::findContacts(std::span<PairRecord* const> records, FrameStatistics& next,
                             Trace* traced) {
  if (!isTimed()) return m_frame.detect(records, context(next, traced));
  const auto end = std::find_if(records.begin(), records.end(), [](const PairRecord* record) {
    return record->memory.urgency.isUnfinished;
  });
  m_frame.detectInTime(m_geometries.stepNumber(),
                       records.first(static_cast<std::size_t>(end - records.begin())),
                       context(next, traced));
}

/// Completes the answers by what they take over from earlier ones, and lists unfinished pairs.
void Detection::completeAnswers(std::span<PairRecord* const> records, bool hasDeadline) {
  const MemoryScope memory(MemoryStage::Results);
  // With a deadline, pairs of other answers were tracked one by one.
  for (const auto& record : m_pairs.records())
    if (!hasDeadline || !record->collides() || record->isCurrent())
      m_frame.track(*record, m_geometries.stepNumber());
  for (PairRecord* record : records)
    if (!record->memory.urgency.isUnfinished) record->addTags();
  if (hasDeadline) listUnfinished(records);
}

void Detection::listUnfinished(std::span<PairRecord* const> records) {
  const PairRecord* const exceeding = findExceeding(records);
  m_unfinished.clear();
  for (const auto& record : m_pairs.records()) {
    const Urgency& urgency = record->memory.urgency;
    if (!urgency.isUnfinished) continue;
    const Validity& kept = CollisionData::Contents::of(record->last.data).validity;  // makes it
    m_unfinished.push_back({record->pair.a, record->pair.b, urgency.distanceBound, kept.age + 1,
                            record.get() == exceeding});
  }
}

void Detection::keepUnfinished(std::span<PairRecord* const> records, FrameStatistics& next,
                               FrameStatistics& last) noexcept {
  const PairRecord* const exceeding = findExceeding(records);
  for (PairRecord* record : records) {
    Urgency& urgency = record->memory.urgency;
    urgency.yields = record == exceeding;
    if (urgency.isUnfinished) record->keepLastAnswer(m_geometries.stepNumber());
  }
  next.unfinishedPairs.swap(m_unfinished);
  m_unfinished.swap(last.unfinishedPairs);  // for its memory
}

void Detection::commit(std::span<PairRecord* const> records) noexcept {
  const std::uint64_t step = m_geometries.stepNumber();
  for (PairRecord* record : records) {
    if (record->memory.urgency.isUnfinished) continue;
    record->commit(step);
    CollisionData::Contents::of(record->last.data).validity.advanceMayBeMissing =
        record->a->step.setsAddUp() || record->b->step.setsAddUp();
  }
  for (const auto& record : m_pairs.records()) {
    if (!record->collides() && !record->isCurrent()) record->commit(step);
    record->memory.tracker.keep(record->last.data);
  }
}

void Detection::countContacts(FrameStatistics& statistics) const {
  for (const auto& record : m_pairs.records()) {
    const CollisionData& data = record->last.data;
    record->found.statistics.contacts = data.validity().atImpact + data.validity().atEnd;
    statistics.contacts += record->found.statistics.contacts;
    statistics.intersectingTriangles += data.intersectingTriangles().size();
  }
}

}  // namespace palpate
