#include "CollisionDetection/OctreeBasedCDImplementation.h"

#include "CollisionDetection/PairOrder.h"
#include "CollisionDetection/SettingsCheck.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

#include <algorithm>
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
    if (!std::exchange(record->countIsPending, false)) continue;
    const Geometry &a = *record->a, &b = *record->b;
    const std::size_t count =
        record->kept.countCandidates(a.body.mesh.topology, a.step.cutsSinceDetection(),
                                     b.body.mesh.topology, b.step.cutsSinceDetection());
    record->statistics.candidatePairs += count;
    statistics.candidatePairs += count;
  }
}

void OctreeBasedCD::Implementation::releaseMemory() {
  countCandidates();
  frame = Frame();
  freeMotions = FreeMotionSearch();
  for (const auto& geometry : geometries.all()) {
    geometry->body.tree.releaseMemory();
    geometry->step.releaseMemory();
  }
  for (const auto& record : pairs.records()) record->releaseMemory();
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

void OctreeBasedCD::Implementation::update(std::span<const std::unique_ptr<PairRecord>> records,
                                           bool explicitly, bool detecting, bool skips,
                                           Trace* traced) {
  const MemoryScope memory(MemoryStage::Octrees);
  using Update = LooseOctree::Update;
  const bool isFrame = detecting && records.data() == pairs.records().data();
  if (!isFrame) countCandidates();
  octreesState = 0;
  shownOctrees.trees.clear();  // they are invalid until the update is complete
  if (!hasUpdates) updates = {};
  const bool isFirst = explicitly || !std::exchange(hasUpdates, true);
  for (const auto& geometry : geometries.all()) {
    if (isFirst) geometry->body.tree.lastUpdate = Update::Unchanged;
    geometry->body.tree.setSwept(false);
    geometry->body.tree.boxMilliseconds = geometry->body.tree.octreeMilliseconds = 0;
  }
  Stopwatch watch;
  const TraceSpan span(traced, "update");
  // Plans measure placed bodies with their octrees.
  bool anyIsPlaced = false;
  for (const auto& geometry : geometries.all())
    if (geometry->body.isPlaced() && geometry->body.tree.isLagging()) {
      geometry->mayLag = false;
      anyIsPlaced = true;
    }
  if (anyIsPlaced) geometries.updateOctrees(settings.octree, threads, traced);
  for (const auto& record : records) {
    planStep(*record, detecting);
    if (record->plan.swept())
      for (Geometry* geometry : {record->a, record->b}) geometry->body.tree.setSwept(true);
  }
  if (isFrame)
    planKeptPairs(geometries, records, settings);
  else
    for (const auto& geometry : geometries.all()) geometry->mayLag = false;
  updates.milliseconds.boxes += watch.lap();
  geometries.updateOctrees(settings.octree, threads, traced);
  const double wall = watch.lap();
  double boxes = 0, octrees = 0;
  updates.rebuiltOctrees = updates.refittedOctrees = updates.unchangedOctrees = 0;
  for (const auto& geometry : geometries.all()) {
    const GeometryOctree& tree = geometry->body.tree;
    ++(tree.lastUpdate == Update::Rebuilt    ? updates.rebuiltOctrees
       : tree.lastUpdate == Update::Refitted ? updates.refittedOctrees
                                             : updates.unchangedOctrees);
    boxes += tree.boxMilliseconds;
    octrees += tree.octreeMilliseconds;
  }
  // Geometries are updated in parallel. The wall-clock time is therefore divided in proportion to
  // the work on boxes and on octrees.
  const double share = boxes + octrees > 0 ? boxes / (boxes + octrees) : 0;
  updates.milliseconds.boxes += wall * share;
  updates.milliseconds.octree += wall * (1 - share);
  updateOctreeView();
  if (!skips && !anyOctreeLags()) octreesState = geometries.state();
#ifdef PALPATE_VALIDATE
  PALPATE_ASSERT(shownOctrees.view.validate().empty());
#endif
  if (explicitly) setStatistics(updates);
}

bool OctreeBasedCD::Implementation::markSkippedOctrees(bool maySkip) {
  for (const auto& geometry : geometries.all()) geometry->skipsOctree = false;
  if (!maySkip) return false;
  for (const auto& record : pairs.records())
    if (needsNoOctree(*record)) record->a->skipsOctree = true;
  for (const auto& record : pairs.records()) {
    if (!needsNoOctree(*record)) record->a->skipsOctree = false;
    if (record->support->kind != PairKind::Proxy) record->b->skipsOctree = false;
  }
  return std::any_of(geometries.all().begin(), geometries.all().end(),
                     [](const auto& geometry) { return geometry->skipsOctree; });
}

bool OctreeBasedCD::Implementation::anyOctreeLags() const {
  return std::any_of(geometries.all().begin(), geometries.all().end(),
                     [](const auto& geometry) { return geometry->body.tree.isLagging(); });
}

void OctreeBasedCD::Implementation::updateOctreeView() {
  shownOctrees.trees.clear();
  for (const auto& geometry : geometries.all()) {
    const GeometryOctree& tree = geometry->body.tree;
    if (geometry->skipsOctree || !tree.isValid() || tree.isLagging() || tree.octree().size() == 0)
      continue;
    shownOctrees.trees.push_back({geometry->body.id, &tree.octree(), tree.frame().origin,
                                  tree.frame().scale, tree.lastUpdate, tree.bytesBesidesOctree()});
  }
}

std::span<PairRecord* const> OctreeBasedCD::Implementation::outdatedPairs() {
  selectedPairs.clear();
  for (const auto& record : pairs.records())
    if (record->collides() && !record->dataVersion.isCurrent(record->state()))
      selectedPairs.push_back(record.get());
  return selectedPairs;
}

const Threads& OctreeBasedCD::Implementation::threadsFor(
    std::span<PairRecord* const> records) const {
  constexpr std::size_t kFew = 16384;
  std::size_t found = 0;
  for (const PairRecord* record : records) found += record->candidateCount;
  return geometries.wasUpdatedByOneThread() && found < kFew ? singleThread : threads;
}

bool OctreeBasedCD::Implementation::updateProxies(std::span<PairRecord* const> records) {
  const MemoryScope memory(MemoryStage::Octrees);
  bool built = false;
  for (PairRecord* record : records)
    if (record->support->kind == PairKind::Proxy)
      built |= record->updateProxy(pairs.records(), threads);
  return built;
}

void OctreeBasedCD::Implementation::detect(const GuardedPairs& guarded) {
  const MemoryScope memory(MemoryStage::Pairs);
  update(guarded, false, true, markSkippedOctrees(false));
  FrameStatistics unused;
  selectedPairs.clear();
  for (const auto& record : guarded)
    if (record->collides() && !record->dataVersion.isCurrent(record->state()))
      selectedPairs.push_back(record.get());
  if (settings.engine == Engine::Octree)
    frame.detect(selectedPairs, threads, unused, nullptr);
  else
    frame.detectByBruteForce(selectedPairs, unused, nullptr);
  for (PairRecord* record : selectedPairs) record->commit();
}

void OctreeBasedCD::Implementation::prepare(std::span<PairRecord* const> records,
                                            StopScope::Token token, Trace* traced) {
  bool mustUpdate = false;
  for (PairRecord* record : records) {
    record->isUnfinished = token && token->isOver();
    if (record->isUnfinished) continue;
    planByFieldIfProven(*record, settings.engine);
    record->trust.start(record->pair.settings, record->a->inStep(), record->b->inStep(),
                        record->plan);
    mustUpdate |= reviewKeptPairs(*record);
  }
  if (!mustUpdate) return;
  geometries.updateOctrees(settings.octree, threads, traced);
  updateOctreeView();
  if (!anyOctreeLags()) octreesState = geometries.state();
}

void OctreeBasedCD::Implementation::findContacts(std::span<PairRecord* const> records,
                                                 FrameStatistics& next, Trace* traced) {
  if (!isTimed())
    return settings.engine == Engine::Octree ? frame.detect(records, threads, next, traced)
                                             : frame.detectByBruteForce(records, next, traced);
  const auto end = std::find_if(records.begin(), records.end(),
                                [](const PairRecord* record) { return record->isUnfinished; });
  const auto prepared = records.first(static_cast<std::size_t>(end - records.begin()));
  const std::uint64_t step = geometries.stepNumber();
  if (settings.engine == Engine::Octree)
    return frame.detectInTime(step, prepared, threads, next, traced);
  for (PairRecord* record : prepared) {
    record->isUnfinished = !endsInTime([&] {
      checkTime();
      frame.detectByBruteForce({&record, 1}, next, traced);
    });
    if (!record->isUnfinished) frame.track(*record, step);
  }
}

void OctreeBasedCD::Implementation::listUnfinished(std::span<PairRecord* const> records) {
  const PairRecord* const exceeding = findExceeding(records);
  unfinishedPairs.clear();
  for (const auto& record : pairs.records()) {
    if (!record->isUnfinished) continue;
    const Validity& kept = CollisionData::Contents::of(record->data).validity;  // makes it
    unfinishedPairs.push_back({record->pair.a, record->pair.b, record->distanceBound, kept.age + 1,
                               record.get() == exceeding});
  }
}

void OctreeBasedCD::Implementation::keepUnfinished(std::span<PairRecord* const> records,
                                                   FrameStatistics& next) noexcept {
  const PairRecord* const exceeding = findExceeding(records);
  for (std::size_t i = 0; i < records.size(); ++i) {
    PairRecord& record = *records[i];
    record.yields = &record == exceeding;
    if (!record.isUnfinished) continue;
    record.trust = trustBefore[i];
    record.keepLastAnswer(geometries.stepNumber());
  }
  next.unfinishedPairs.swap(unfinishedPairs);
  unfinishedPairs.swap(statistics.unfinishedPairs);  // for its memory
}

void OctreeBasedCD::Implementation::commit(std::span<PairRecord* const> records) noexcept {
  for (PairRecord* record : records) {
    if (record->isUnfinished) continue;
    record->commit();
    CollisionData::Contents::of(record->data).validity.advanceMayBeMissing =
        record->a->step.setsAddUp() || record->b->step.setsAddUp();
    reviewLists(*record);
    record->workedPairs = record->searchedCandidates + record->statistics.featurePairs;
  }
}

void OctreeBasedCD::Implementation::reviewMemory() {
  const MemoryUse& held = statistics.memory;
  BurstMemory::Work work{0, statistics.contacts + statistics.intersectingTriangles};
  for (const auto& record : pairs.records()) work.pairs += record->workedPairs;
  if (!burst.isOver(work, held.pairs + held.narrowPhase + held.results)) return;
  countCandidates();
  frame = Frame();
  for (const auto& record : pairs.records()) record->releaseBurst();
  statistics.memory = budget->now();
}

void OctreeBasedCD::Implementation::followSides() {
  unfollowed.clear();
  for (const auto& record : pairs.records()) {
    record->startSides(geometries.stepNumber());
    if (!record->sides || !record->collides() || record->dataVersion.isCurrent(record->state()))
      continue;
    if (!record->atEnd) record->atEnd = std::make_unique<PairRecord>();
    unfollowed.push_back(std::move(record->atEnd));
    PairRecord& own = *unfollowed.back();
    own.guarded = record.get();
    own.a = record->a;
    own.b = record->b;
    own.pair = record->pair;
    own.pair.settings.thickness = own.pair.settings.freeMotionReach = 0.0;
    own.pair.settings.reportCrossings = true;
    own.pair.settings.rememberSides = own.pair.settings.smoothNormals = false;
    own.pair.settings.method = Method::Continuous;  // not Auto, which looks for more than passages
    own.support = supportOf(Method::Continuous, own.a->body.mesh.topology.type,
                            own.b->body.mesh.topology.type, own.a == own.b);
    own.settingsRevision = record->settingsRevision;
    own.dataVersion.invalidate();
  }
  if (unfollowed.empty()) return;
  detect(unfollowed);
  for (const auto& own : unfollowed) {
    PairRecord& record = *pairs.records()[own->guarded->index];
    record.sides->follow(record.meshes(), own->data.crossings());
  }
  for (auto& own : unfollowed) {
    PairRecord& record = *pairs.records()[own->guarded->index];
    record.sides->commit();
    record.dataVersion.invalidate();  // the sides are not those of the last detection
    record.atEnd = std::move(own);
  }
}

bool OctreeBasedCD::Implementation::detect(StopScope::Token token) {
  const MemoryScope memory(MemoryStage::Pairs);
  Trace* const traced = trace ? &*trace : nullptr;
  if (traced) traced->startFrame();
  const TraceSpan span(traced, "detectCollision");
  for (const auto& record : pairs.records()) record->countIsPending = record->isUnfinished = false;
  update(false, true, traced);
  for (const auto& record : pairs.records()) record->startSides(geometries.stepNumber());
  FrameStatistics next = updates;
  const auto records = outdatedPairs();
  for (const auto& record : pairs.records()) {
    record->statistics = {};
    if (record->dataVersion.isCurrent(record->state()))
      planByFieldIfProven(*record, settings.engine);
  }
  if (token) {
    orderByUrgency(selectedPairs);
    trustBefore.clear();
    for (const PairRecord* record : records) trustBefore.push_back(record->trust);
  }
  prepare(records, token, traced);
  Stopwatch watch;
  const bool built = updateProxies(records);
  if (built) next.milliseconds.octree += watch.lap();
  {
    const StopScope scope(token);
    findContacts(records, next, traced);
    next.freeMotionUnfinished = !freeMotions.find(geometries, pairs, settings.engine, threads);
  }
  {
    const MemoryScope results(MemoryStage::Results);
    watch.lap();
    // With a deadline, pairs of other answers were tracked one by one.
    for (const auto& record : pairs.records())
      if (!token || !record->collides() || record->dataVersion.isCurrent(record->state()))
        frame.track(*record, geometries.stepNumber());
    for (PairRecord* record : records)
      if (!record->isUnfinished) record->addTags();
    if (token) listUnfinished(records);
    next.milliseconds.order += watch.lap();
  }
  // Nothing below throws but the audit: a detection that fails leaves the last answers.
  if (token) keepUnfinished(records, next);
  freeMotions.commit(geometries);
  commit(records);
  for (const auto& record : pairs.records()) {
    if (!record->collides() && !record->dataVersion.isCurrent(record->state()))
      record->commitEmpty();
    if (record->tracker && record->tracker->keeps())
      record->tracker->commit(CollisionData::Contents::of(record->data));
    const CollisionData& data = record->data;
    record->statistics.contacts = data.validity().atImpact + data.validity().atEnd;
    next.contacts += record->statistics.contacts;
    next.intersectingTriangles += data.intersectingTriangles().size();
  }
  for (const auto& geometry : geometries.all()) geometry->step.recordDetection(geometry->body.mesh);
  const bool isComplete = next.unfinishedPairs.empty() && !next.freeMotionUnfinished;
  setStatistics(std::move(next));
  hasUpdates = false;
  const TraceSpan auditSpan(traced, "audit");
  auditFrame(settings, geometries, pairs, audit);
  reviewMemory();
  return isComplete;
}

}  // namespace palpate
