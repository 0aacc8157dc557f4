#include "CollisionDetection/OctreeBasedCDImplementation.h"

#include "CollisionDetection/SettingsCheck.h"

#include <utility>

namespace palpate {

void throwMovedFrom() {
  throw Error(ErrorCode::InvalidCall, "this OctreeBasedCD was moved from: it has no geometries");
}

void throwBusy() {
  throw Error(ErrorCode::InvalidCall,
              "a predicate or callback must not call the OctreeBasedCD that calls it");
}

OctreeBasedCD::Implementation::Implementation(const Settings& newSettings)
    : settings(checked(newSettings)),
      budget(MemoryBudget::make(settings.memoryLimit)),
      threads(newSettings.threads, newSettings.executor),
      querySource(std::make_shared<QuerySource>(*this)),
      latestSnapshot(budget) {
  if (settings.traceFrames > 0) {
    const MemoryScope memory(budget, MemoryStage::Results);
    trace.emplace(static_cast<std::size_t>(settings.traceFrames));
  }
}

OctreeBasedCD::Implementation::~Implementation() {
  querySource->close();
  if (guardSource) guardSource->close();
}

void OctreeBasedCD::Implementation::countCandidates() {
  const std::lock_guard lock(filling);
  for (const auto& record : pairs.records()) {
    const std::size_t count = record->memory.kept.countCandidates(*record);
    record->found.statistics.candidatePairs += count;
    statistics.candidatePairs += count;
  }
}

void OctreeBasedCD::Implementation::releaseMemory() {
  countCandidates();
  detection.releaseMemory();
  detection.freeMotions().releaseMemory();
  unfollowed.releaseMemory();
  for (const auto& geometry : geometries.all()) {
    geometry->body.tree.releaseMemory();
    geometry->step.releaseMemory();
  }
  for (const auto& record : pairs.records()) record->releaseMemory(true);
  querySource->releaseScratch();
  latestSnapshot.releaseMemory();
  holdsSpare = false;
}

void OctreeBasedCD::Implementation::setStatistics(FrameStatistics next) {
  next.geometries = next.triangles = next.segments = next.points = next.untestedVertices = 0;
  for (const auto& geometry : geometries.all()) {
    ++next.geometries;
    const MeshTopology& topology = geometry->body.mesh.topology;
    (topology.hasFaces()                    ? next.triangles
     : topology.type == GeometryType::Lines ? next.segments
                                            : next.points) += topology.count();
    next.untestedVertices += topology.untestedVertices;
  }
  next.memory = budget->now();
  next.peakMemory = budget->peak();
  statistics = std::move(next);
}

void OctreeBasedCD::Implementation::update(SceneOctrees::UpdateFor purpose) {
  countCandidates();
  octrees.update(purpose);
  if (purpose == SceneOctrees::UpdateFor::User) setStatistics(octrees.counts());
}

void OctreeBasedCD::Implementation::detect(SeparateSearches searches) {
  countCandidates();
  detection.run(searches);
}

bool OctreeBasedCD::Implementation::detect(StopScope::Token token) {
  Trace* const traced = trace ? &*trace : nullptr;
  if (traced) traced->startFrame();
  const TraceSpan span(traced, "detectCollision");
  FrameStatistics next = detection.run(token, traced, statistics);
  const bool isComplete = next.unfinishedPairs.empty() && !next.freeMotionUnfinished;
  setStatistics(std::move(next));
  octrees.startCounts();
  const TraceSpan auditSpan(traced, "audit");
  auditFrame(settings, geometries, pairs, audit);
  reviewMemory();
  return isComplete;
}

void OctreeBasedCD::Implementation::reviewMemory() {
  const MemoryUse& held = statistics.memory;
  BurstMemory::Work work{0, statistics.contacts + statistics.intersectingTriangles};
  for (const auto& record : pairs.records()) work.pairs += record->memory.kept.workedPairs();
  if (!burst.isOver(work, held.pairs + held.narrowPhase + held.results)) return;
  countCandidates();
  detection.releaseMemory();
  for (const auto& record : pairs.records()) record->releaseMemory(false);
  statistics.memory = budget->now();
}

void OctreeBasedCD::Implementation::followSides() {
  const SeparateSearches searches = unfollowed.find(pairs, geometries.stepNumber());
  if (searches.empty()) return;
  detect(searches);
  unfollowed.follow(pairs);
}

}  // namespace palpate
