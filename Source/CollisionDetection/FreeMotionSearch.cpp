#include "CollisionDetection/FreeMotionSearch.h"

#include "CollisionDetection/PairOrder.h"
#include "Search/FreeMotionWork.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace palpate {

namespace {

bool takesPart(const PairRecord& record) {
  return record.pair.settings.freeMotionReach > 0.0 && record.collides();
}

bool isEmpty(const Body& body) { return !body.shape && body.tree.octree().size() == 0; }

/// Whether features may bound the free motions of the pair.
bool isSearched(const PairRecord& record) {
  return takesPart(record) && !isEmpty(record.a->body) && !isEmpty(record.b->body);
}

}  // namespace

bool FreeMotionSearch::isKnown(const PairTable& pairs) const {
  if (!m_holds) return false;
  auto known = m_known.begin();
  for (const auto& record : pairs.records()) {
    if (!takesPart(*record)) continue;
    if (known == m_known.end() || known->pair.a != record->pair.a ||
        known->pair.b != record->pair.b || !(known->state == record->state()))
      return false;
    ++known;
  }
  return known == m_known.end();
}

bool FreeMotionSearch::find(const GeometryTable& geometries, const PairTable& pairs, Engine engine,
                            const Threads& threads, JobRunner& jobs) {
  if (isKnown(pairs)) return true;
  m_holds = false;
  m_known.clear();
  start(geometries, pairs);
  const bool isComplete = endsInTime([&] { search(pairs, engine, threads, jobs); });
  bool allFinished = true;
  for (const auto& record : pairs.records()) {
    if (!takesPart(*record) || (isComplete && !record->memory.urgency.isUnfinished)) continue;
    allFinished = false;
    // The features of an unfinished pair may be in contacts that its answer does not have.
    const double gap = distanceBoundOf(*record) - record->pair.settings.thickness,
                 share = gap > 0.0 ? 0.5 * (1.0 - 0x1p-50) * gap : 0.0;
    for (Geometry* geometry : {record->a, record->b})
      for (double& motion : geometry->nextFreeMotion) motion = std::min(motion, share);
  }
  if (allFinished)
    for (const auto& record : pairs.records())
      if (takesPart(*record)) m_known.push_back({record->pair, record->state()});
  m_holds = allFinished;
  m_isNew = true;
  return isComplete;
}

void FreeMotionSearch::commit(const GeometryTable& geometries) noexcept {
  if (!std::exchange(m_isNew, false)) return;
  for (const auto& geometry : geometries.all()) geometry->freeMotion.swap(geometry->nextFreeMotion);
}

/// Lists the meshes whose elements need boxes, and starts each free motion at the share of the
/// least reach.
void FreeMotionSearch::start(const GeometryTable& geometries, const PairTable& pairs) {
  for (const auto& geometry : geometries.all())
    geometry->nextFreeMotion.assign(geometry->freeMotionCount(),
                                    std::numeric_limits<double>::infinity());
  m_boxed.clear();
  for (const auto& record : pairs.records()) {
    if (!takesPart(*record)) continue;
    const double reach = record->pair.settings.freeMotionReach;
    for (Geometry* geometry : {record->a, record->b})
      for (double& motion : geometry->nextFreeMotion) motion = std::min(motion, 0.5 * reach);
    if (!isSearched(*record) || record->question->hasShape()) continue;
    m_boxed.push_back(record->a);
    m_boxed.push_back(record->b);
  }
  std::sort(m_boxed.begin(), m_boxed.end());
  m_boxed.erase(std::unique(m_boxed.begin(), m_boxed.end()), m_boxed.end());
  for (Geometry* geometry : m_boxed)
    geometry->elementBoxes.resize(geometry->body.mesh.topology.elements.size());
}

void FreeMotionSearch::search(const PairTable& pairs, Engine engine, const Threads& threads,
                              JobRunner& jobs) {
  threads.forEach(m_boxed.size(), [&](std::size_t i) {
    boxElements(m_boxed[i]->body.mesh, m_boxed[i]->elementBoxes);
  });
  jobs.begin();
  for (const auto& record : pairs.records()) {
    if (!isSearched(*record)) continue;
    const FreeMotions motions{record->a->nextFreeMotion, record->b->nextFreeMotion,
                              record->a->elementBoxes, record->b->elementBoxes};
    jobs.add(record->pair, FreeMotionWork(*record->question, motions), threads, engine);
  }
  jobs.run(threads, nullptr);
}

}  // namespace palpate
