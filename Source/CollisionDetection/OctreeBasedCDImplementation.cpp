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
    const std::size_t count = record->memory.kept.countCandidates(*record);
    record->found.statistics.candidatePairs += count;
    statistics.candidatePairs += count;
  }
}

void OctreeBasedCD::Implementation::releaseMemory() {
  countCandidates();
  frame = Frame();
  freeMotions.releaseMemory();
  unfollowed.clear();
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

void OctreeBasedCD::Implementation::update(UpdateFor purpose, Trace* traced) {
  const bool isFrame = purpose == UpdateFor::Frame;
  markSkippedOctrees(isFrame && octreesState != geometries.state());
  update(
      purpose,
      [&] {
        for (const auto& record : pairs.records()) expectPlan(*record, isFrame);
      },
      traced);
}

void OctreeBasedCD::Implementation::update(UpdateFor purpose,
                                           const std::function<void()>& expectPlans,
                                           Trace* traced) {
  const MemoryScope memory(MemoryStage::Octrees);
  using Update = LooseOctree::Update;
  if (purpose != UpdateFor::Frame) countCandidates();
  octreesState = 0;
  shownOctrees.trees.clear();  // they are invalid until the update is complete
  if (!hasUpdates) updates = {};
  const bool isFirst = purpose == UpdateFor::User || !std::exchange(hasUpdates, true);
  for (const auto& geometry : geometries.all()) {
    if (isFirst) geometry->body.tree.lastUpdate = Update::Unchanged;
    geometry->body.tree.setSwept(false);
    geometry->body.tree.boxMilliseconds = geometry->body.tree.octreeMilliseconds = 0;
  }
  Stopwatch watch;
  const TraceSpan span(traced, "update");
  expectPlansAndLag(purpose, expectPlans, traced);
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
  const bool skips = std::any_of(geometries.all().begin(), geometries.all().end(),
                                 [](const auto& geometry) { return geometry->skipsOctree; });
  if (!skips && !anyOctreeLags()) octreesState = geometries.state();
#ifdef PALPATE_VALIDATE
  PALPATE_ASSERT(shownOctrees.view.validate().empty());
#endif
  if (purpose == UpdateFor::User) setStatistics(updates);
}

/// Updates those octrees on which the plans of others depend.
void OctreeBasedCD::Implementation::expectPlansAndLag(UpdateFor purpose,
                                                      const std::function<void()>& expectPlans,
                                                      Trace* traced) {
  const auto updateSome = [&](bool (*isDue)(const Geometry&)) {
    const auto all = geometries.all();
    if (std::any_of(all.begin(), all.end(), [&](const auto& each) { return isDue(*each); }))
      geometries.updateOctrees(settings.octree, threads, traced, isDue);
  };
  // The motion of placed bodies is measured with their octrees.
  for (const auto& geometry : geometries.all())
    if (geometry->body.isPlaced()) geometry->mayLag = false;
  updateSome([](const Geometry& g) { return g.body.isPlaced() && g.body.tree.isLagging(); });
  expectPlans();
  if (purpose != UpdateFor::Frame) {
    for (const auto& geometry : geometries.all()) geometry->mayLag = false;
    return;
  }
  planKeptCandidates(geometries, pairs.records(), settings);
  // A cut that needs a new octree ends lists, so that others must not lag.
  updateSome([](const Geometry& geometry) { return geometry.mayLag && geometry.isCut(); });
  reviewCuts(pairs.records());
}

void OctreeBasedCD::Implementation::markSkippedOctrees(bool maySkip) {
  for (const auto& geometry : geometries.all()) geometry->skipsOctree = false;
  if (!maySkip) return;
  for (const auto& record : pairs.records())
    if (needsNoOctree(*record)) record->a->skipsOctree = true;
  for (const auto& record : pairs.records()) {
    if (!needsNoOctree(*record)) record->a->skipsOctree = false;
    if (record->support->kind != PairKind::Proxy) record->b->skipsOctree = false;
  }
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
    if (record->collides() && !record->isCurrent()) selectedPairs.push_back(record.get());
  return selectedPairs;
}

const Threads& OctreeBasedCD::Implementation::threadsFor(
    std::span<PairRecord* const> records) const {
  constexpr std::size_t kFew = 16384;
  std::size_t found = 0;
  for (const PairRecord* record : records) found += record->found.candidateCount;
  return geometries.wasUpdatedByOneThread() && found < kFew ? singleThread : threads;
}

bool OctreeBasedCD::Implementation::updateProxies(std::span<PairRecord* const> records) {
  const MemoryScope memory(MemoryStage::Octrees);
  bool built = false;
  for (PairRecord* record : records) {
    if (record->support->kind != PairKind::Proxy) continue;
    ProxyMemory& own = record->memory.proxy;
    built |= own.update(*record, pairs.records(), threads);
    record->question->proxy = own.proxy.get();
  }
  return built;
}

Frame::Context OctreeBasedCD::Implementation::context(FrameStatistics& next, Trace* traced) const {
  const Threads& all = settings.engine == Engine::Octree ? threads : singleThread;
  return {all, settings.engine, next, traced};
}

void OctreeBasedCD::Implementation::detect(SeparateSearches all) {
  const MemoryScope memory(MemoryStage::Pairs);
  markSkippedOctrees(false);
  update(UpdateFor::Separate, [&] {
    for (const auto& own : all) expectPlan(*own);
  });
  outdatedSearches.clear();
  for (const auto& own : all)
    if (own->a->meets(*own->b) && !own->version.isCurrent(own->state())) {
      own->version.invalidate();
      outdatedSearches.push_back(own->search());
    }
  FrameStatistics unused;
  frame.detect(outdatedSearches, context(unused, nullptr));
  for (const auto& own : all)
    if (own->a->meets(*own->b)) own->version.commit(own->state());
}

void OctreeBasedCD::Implementation::completePlans(std::span<PairRecord* const> records,
                                                  StopScope::Token token) {
  for (PairRecord* record : records) {
    bool& isUnfinished = record->memory.urgency.isUnfinished;
    isUnfinished = token && token->isOver();
    if (!isUnfinished) completePlan(*record, settings.engine);
  }
}

void OctreeBasedCD::Implementation::findContacts(std::span<PairRecord* const> records,
                                                 FrameStatistics& next, Trace* traced) {
  if (!isTimed()) return frame.detect(records, context(next, traced));
  const auto end = std::find_if(records.begin(), records.end(), [](const PairRecord* record) {
    return record->memory.urgency.isUnfinished;
  });
  frame.detectInTime(geometries.stepNumber(),
                     records.first(static_cast<std::size_t>(end - records.begin())),
                     context(next, traced));
}

void OctreeBasedCD::Implementation::listUnfinished(std::span<PairRecord* const> records) {
  const PairRecord* const exceeding = findExceeding(records);
  unfinishedPairs.clear();
  for (const auto& record : pairs.records()) {
    const Urgency& urgency = record->memory.urgency;
    if (!urgency.isUnfinished) continue;
    const Validity& kept = CollisionData::Contents::of(record->last.data).validity;  // makes it
    unfinishedPairs.push_back({record->pair.a, record->pair.b, urgency.distanceBound, kept.age + 1,
                               record.get() == exceeding});
  }
}

void OctreeBasedCD::Implementation::keepUnfinished(std::span<PairRecord* const> records,
                                                   FrameStatistics& next) noexcept {
  const PairRecord* const exceeding = findExceeding(records);
  for (PairRecord* record : records) {
    Urgency& urgency = record->memory.urgency;
    urgency.yields = record == exceeding;
    if (urgency.isUnfinished) record->keepLastAnswer(geometries.stepNumber());
  }
  next.unfinishedPairs.swap(unfinishedPairs);
  unfinishedPairs.swap(statistics.unfinishedPairs);  // for its memory
}

void OctreeBasedCD::Implementation::commit(std::span<PairRecord* const> records) noexcept {
  for (PairRecord* record : records) {
    if (record->memory.urgency.isUnfinished) continue;
    record->commit(geometries.stepNumber());
    CollisionData::Contents::of(record->last.data).validity.advanceMayBeMissing =
        record->a->step.setsAddUp() || record->b->step.setsAddUp();
  }
  for (const auto& record : pairs.records()) {
    if (!record->collides() && !record->isCurrent()) record->commit(geometries.stepNumber());
    record->memory.tracker.keep(record->last.data);
  }
}

void OctreeBasedCD::Implementation::reviewMemory() {
  const MemoryUse& held = statistics.memory;
  BurstMemory::Work work{0, statistics.contacts + statistics.intersectingTriangles};
  for (const auto& record : pairs.records()) work.pairs += record->memory.kept.workedPairs();
  if (!burst.isOver(work, held.pairs + held.narrowPhase + held.results)) return;
  countCandidates();
  frame = Frame();
  for (const auto& record : pairs.records()) record->releaseMemory(false);
  statistics.memory = budget->now();
}

/// The settings that find the passages of a pair, and nothing else.
static PairSettings passagesOf(PairSettings settings) {
  settings.thickness = settings.freeMotionReach = 0.0;
  settings.reportCrossings = true;
  settings.rememberSides = settings.smoothNormals = false;
  settings.method = Method::Continuous;  // not Auto, which looks for more than passages
  return settings;
}

void OctreeBasedCD::Implementation::followSides() {
  std::size_t count = 0;
  for (const auto& record : pairs.records()) {
    SidesMemory& memory = record->memory.sides;
    const PairMoment moment = record->momentIn(geometries.stepNumber());
    memory.startStep(moment);
    if (!memory.sides) continue;
    if (!SidesMemory::isWanted(moment)) {
      memory.commit(moment);
      continue;
    }
    if (record->isCurrent()) continue;
    if (count == unfollowed.size()) unfollowed.push_back(std::make_unique<SeparateSearch>());
    SeparateSearch& own = *unfollowed[count++];
    own.set(*record, passagesOf(record->pair.settings), false);
    own.version.invalidate();
  }
  if (count == 0) return;
  const SeparateSearches all = std::span(unfollowed).first(count);
  detect(all);
  for (const auto& own : all) {
    PairRecord& record = *pairs.records()[own->of->index];
    record.memory.sides.sides->follow(record.meshes(), own->found.data.crossings());
  }
  for (const auto& own : all) {
    PairRecord& record = *pairs.records()[own->of->index];
    record.memory.sides.sides->commit();
    record.last.version.invalidate();  // the sides are not those of the last detection
  }
}

bool OctreeBasedCD::Implementation::detect(StopScope::Token token) {
  const MemoryScope memory(MemoryStage::Pairs);
  Trace* const traced = trace ? &*trace : nullptr;
  if (traced) traced->startFrame();
  const TraceSpan span(traced, "detectCollision");
  for (const auto& record : pairs.records()) {
    const PairMoment moment = record->momentIn(geometries.stepNumber());
    record->memory.forEach([&](auto& part) { part.startStep(moment); });
  }
  update(UpdateFor::Frame, traced);
  FrameStatistics next = updates;
  const auto records = outdatedPairs();
  for (const auto& record : pairs.records()) {
    record->found.statistics = {};
    if (record->isCurrent()) planByFieldIfProven(*record, settings.engine);
  }
  if (token) orderByUrgency(selectedPairs);
  completePlans(records, token);
  Stopwatch watch;
  const bool built = updateProxies(records);
  if (built) next.milliseconds.octree += watch.lap();
  {
    const StopScope scope(token);
    findContacts(records, next, traced);
    next.freeMotionUnfinished =
        !freeMotions.find(geometries, pairs, settings.engine, threads, frame.jobs());
  }
  {
    const MemoryScope results(MemoryStage::Results);
    watch.lap();
    // With a deadline, pairs of other answers were tracked one by one.
    for (const auto& record : pairs.records())
      if (!token || !record->collides() || record->isCurrent())
        frame.track(*record, geometries.stepNumber());
    for (PairRecord* record : records)
      if (!record->memory.urgency.isUnfinished) record->addTags();
    if (token) listUnfinished(records);
    next.milliseconds.order += watch.lap();
  }
  // Nothing below throws but the audit: a detection that fails leaves the last answers.
  if (token) keepUnfinished(records, next);
  freeMotions.commit(geometries);
  commit(records);
  for (const auto& record : pairs.records()) {
    const CollisionData& data = record->last.data;
    record->found.statistics.contacts = data.validity().atImpact + data.validity().atEnd;
    next.contacts += record->found.statistics.contacts;
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
