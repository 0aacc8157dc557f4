#include "CollisionDetection/MeshWork.h"

#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/Planning.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/ElementBoxes.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Meeting.h"
#include "NarrowPhase/StepCheck.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <iterator>
#include <limits>

namespace palpate {

namespace {

/// Node pairs and jobs for each collision pair, where there is a deadline or more than one thread.
constexpr std::size_t kNodePairsWanted = 256, kJobsPerPair = 32;
/// Below this many elements, splitting a pair among threads costs more than it saves. With a
/// deadline it is split into so many node pairs, as the search from each asks no deadline.
constexpr std::size_t kSharedSize = 8192, kFewNodePairs = 8;

/// Whether the traversal may skip neighbours that UnfoldedStars proves not to touch. It may if the
/// method reports nothing but touching features: Continuous, without a thickness.
bool reportsOnlyTouching(const PairRecord& record) {
  return record.a == record.b && record.plan.method == Method::Continuous &&
         record.a->body.mesh.topology.hasFaces() && record.meshes().maxFeatureDistance() == 0.0;
}

/// L: by how much more than the thickness Continuous may report features (TimeOfImpactSettings).
/// Their boxes in the world overlap at the thickness, but those in another frame may not.
double approachSlack(const PairRecord& record, double thickness) {
  if (!record.plan.swept()) return 0.0;
  const double motion = record.plan.motion,
               largestDifference = record.a->inStep().extent + record.b->inStep().extent + motion;
  return record.pair.settings.continuous.timeTolerance * motion +
         kApproachError * (largestDifference + 2.0 * thickness);
}

FloatPair floatsOf(const PairRecord& record, const TreePair& trees) {
  FloatPair floats{record.a->body.tree.floats(),
                   record.b->body.tree.floats(),
                   nullptr,
                   nullptr,
                   trees.shiftLower,
                   trees.shiftUpper};
  if (record.plan.swept()) {
    floats.beforeA = record.a->body.tree.floatsAtStart();
    floats.beforeB = record.b->body.tree.floatsAtStart();
  }
  return floats;
}

}  // namespace

std::size_t MeshWork::start(const FrameStart& frame) {
  if (m_record->keeps) return startKept(frame);
  m_searchJobs = startTraversal(frame, true, BoxFrame::Body);
  return m_searchJobs + (m_record->gathers ? startGathering(frame) : 0);
}

static bool hasElements(const PairRecord& record) {
  return record.a->body.tree.octree().size() > 0 && record.b->body.tree.octree().size() > 0;
}

std::size_t MeshWork::startKept(const FrameStart& frame) {
  PairRecord& record = *m_record;
  const Body &a = record.a->body, &b = record.b->body;
  if (!hasElements(record)) return 0;
  const std::size_t jobs =
      record.kept.start(a, b, reachOfKept(record), frame.divides() ? kJobsPerPair : 1);
  m_thickness = record.meshes().maxFeatureDistance();
  m_floats = record.kept.floats();
  return jobs;
}

std::size_t MeshWork::startGathering(const FrameStart& frame) {
  PairRecord& record = *m_record;
  if (!hasElements(record)) return 0;
  const KeptPairs::Reach reach = reachOfKept(record);
  return record.kept.startGathering(record.a->body, record.b->body, reach,
                                    detectionsToGather(record, reach),
                                    frame.divides() ? kJobsPerPair : 1);
}

void MeshWork::runKept(std::size_t job, JobScratch& scratch) const {
  const MeshPair meshes = m_record->meshes(&m_floats);
  scratch.near.clear();
  m_record->kept.run(job, meshes, scratch, scratch.near);
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  const auto enabled = [&](std::span<const ElementPair> pairs, Buffer<ElementPair>& kept) {
    const MeshTopology &a = meshes.a.topology, &b = meshes.b.topology;
    kept.assign(pairs.begin(), pairs.end());
    std::erase_if(kept,
                  [&](const ElementPair& p) { return !a.isEnabled(p.a) || !b.isEnabled(p.b); });
    return std::span<const ElementPair>(kept);
  };
  const bool anyDisabled = m_record->anyDisabled();
  // Those that meet at the step's start have boxes within the motion at its end, and are listed.
  if (meshes.step.checksStart)
    m_record->kept.forEachList(
        job, meshes.step.apartBelow, [&](std::span<const ElementPair> pairs) {
          forEachPart(anyDisabled ? enabled(pairs, scratch.kept) : pairs,
                      [&](const auto& part) { checkStart(meshes, part, scratch); });
        });
  if (anyDisabled) {
    enabled(scratch.near, scratch.kept);
    scratch.near.swap(scratch.kept);
  }
  forEachPart(std::span<const ElementPair>(scratch.near),
              [&](const auto& part) { findContacts(meshes, part, scratch.contacts); });
}

std::size_t MeshWork::startCandidates(const FrameStart& frame) {
  return startTraversal(frame, false, BoxFrame::World);
}

std::size_t MeshWork::startTraversal(const FrameStart& frame, bool adjacentPairs,
                                     BoxFrame boxFrame) {
  PairRecord& record = *m_record;
  GeometryOctree &ofA = record.a->body.tree, &ofB = record.b->body.tree;
  const std::size_t elements = ofA.octree().size() + ofB.octree().size();
  if (!hasElements(record)) return 0;
  const Triangle* const unfolded = adjacentPairs && reportsOnlyTouching(record)
                                       ? ofA.findUnfoldedStars(record.a->body.mesh, frame.threads)
                                       : nullptr;
  m_thickness =
      record.plan.method == Method::Intersection ? 0.0 : record.meshes().maxFeatureDistance();
  const auto treesIn = [&](BoxFrame in, double distance) {
    if (in == BoxFrame::Body) distance += approachSlack(record, m_thickness);
    TreePair trees = treesOf(record.a->body, record.b->body, distance, record.plan.swept(), in);
    if (trees.self() && !adjacentPairs) trees.adjacency = ofA.ordered().data();
    if (unfolded) trees.adjacency = unfolded;
    return trees;
  };
  m_floats = floatsOf(record, treesIn(BoxFrame::World, m_thickness));
  // A search at the searchDistance is for boxes in the world.
  const bool searches = adjacentPairs && record.plan.searchDistance > 0.0,
             inWorld = searches || !record.a->body.isPlaced() || !record.b->body.isPlaced();
  m_trees = treesIn(inWorld ? BoxFrame::World : boxFrame,
                    searches ? std::max(m_thickness, record.plan.searchDistance) : m_thickness);
  const bool shared = frame.divides() && elements >= kSharedSize;
  startPairs(m_trees, shared ? kNodePairsWanted : isTimed() ? kFewNodePairs : 1, frame.stack);
  m_nodePairs = &frame.nodePairs;
  m_first = frame.nodePairs.size(), m_count = frame.stack.pairs.size();
  frame.nodePairs.insert(frame.nodePairs.end(), frame.stack.pairs.begin(), frame.stack.pairs.end());
  m_grain = std::max<std::size_t>(1, (m_count + kJobsPerPair - 1) / kJobsPerPair);
  return (m_count + m_grain - 1) / m_grain;
}

void MeshWork::traverseJob(std::size_t job, JobScratch& scratch) const {
  PALPATE_ASSERT(m_nodePairs && job * m_grain < m_count);
  const std::size_t begin = job * m_grain, size = std::min(m_count - begin, m_grain);
  traverse(m_trees, std::span(*m_nodePairs).subspan(m_first + begin, size), scratch.stack,
           scratch.sink);
  scratch.sink.flush();
}

/// Whether the boxes of the traversal may be larger than those of the pair's method.
bool MeshWork::hasWiderBoxes() const {
  return m_record->hasWiderBoxes() || m_record->plan.searchDistance > 0.0;
}

bool MeshWork::isFiltered() const {
  return hasWiderBoxes() || m_record->anyDisabled() || m_trees.isMapped();
}

/// Keeps the candidates of a batch of the traversal.
std::span<const ElementPair> MeshWork::candidatesAmong(std::span<const ElementPair> pairs,
                                                       JobScratch& scratch) const {
  if (!isFiltered()) {
    scratch.nearby = true;
    return pairs;
  }
  const PairPlan& plan = m_record->plan;
  const bool searches = plan.searchDistance > 0.0;
  Buffer<ElementPair>& kept = scratch.kept;
  kept.assign(pairs.begin(), pairs.end());
  // First, pairs whose boxes overlap at the thickness of the traversal. That of mapped trees finds
  // other pairs as well. So does a search if other pairs of the geometries need boxes over the
  // step.
  if (m_trees.isMapped() || (searches && m_record->hasWiderBoxes()))
    keepInWorld(searches ? std::max(plan.step.motionWithRounding, m_thickness) : m_thickness,
                scratch);
  scratch.nearby |= !kept.empty();
  const MeshTopology &a = m_record->a->body.mesh.topology, &b = m_record->b->body.mesh.topology;
  if (m_record->anyDisabled())
    std::erase_if(kept,
                  [&](const ElementPair& p) { return !a.isEnabled(p.a) || !b.isEnabled(p.b); });
  // Then those whose boxes overlap at the pair's own thickness. The boxes are those of the pair's
  // method: at the step's end, or over the whole step.
  if (m_trees.isMapped()) {
    if (plan.searchDistance > m_thickness) keepInWorld(m_thickness, scratch);
  } else if (hasWiderBoxes()) {
    keepOverlapping(a, b, m_floats, kept);
  }
  return kept;
}

void MeshWork::keepInWorld(double distance, JobScratch& scratch) const {
  keepOverlapping(m_record->meshes(), m_record->plan.swept(), distance, scratch.kept);
}

bool MeshWork::repeats(const JobScratch& job) const {
  return job.intersectionsMissed && m_record->plan.runsIntersection;
}

bool MeshWork::hasRound(int round, Jobs jobs) const {
  if (round != 1) return round == 0;
  bool startsIntersecting = m_record->plan.startsIntersecting, missed = false;
  for (const auto& job : jobs) {
    startsIntersecting |= job->contacts.facts.startsPiercing();
    missed |= repeats(*job);
  }
  return startsIntersecting && missed;
}

void MeshWork::run(int round, std::size_t job, JobScratch& scratch) const {
  if (round == 0 && m_record->keeps) {
    runKept(job, scratch);
  } else if (job >= m_searchJobs) {
    if (round == 0) m_record->kept.gather(job - m_searchJobs, m_record->meshes(&m_floats), scratch);
  } else if (round == 0) {
    forEachBatch(job, scratch, [&](std::span<const ElementPair> pairs) {
      forEachPart(pairs, [&](const auto& part) { detect(part, scratch); });
    });
    scratch.candidateCount = scratch.sink.total();
  } else if (repeats(scratch)) {
    const AddedTime time(scratch.narrowMilliseconds);
    forEachBatch(job, scratch, [&](std::span<const ElementPair> pairs) {
      forEachPart(pairs, [&](const auto& part) { detectIntersections(part, scratch); });
    });
  }
}

void MeshWork::detect(std::span<const ElementPair> pairs, JobScratch& scratch) const {
  const MeshPair meshes = m_record->meshes(m_trees.isMapped() ? nullptr : &m_floats);
  {
    const MemoryScope memory(MemoryStage::NarrowPhase);
    const AddedTime time(scratch.narrowMilliseconds);
    const StepFacts& facts = scratch.contacts.facts;
    if (meshes.step.checksStart) checkStart(meshes, pairs, scratch);
    if (m_record->plan.runsIntersection &&
        (facts.startsPiercing() || m_record->plan.startsIntersecting))
      detectIntersections(pairs, scratch);
    else
      scratch.intersectionsMissed = true;
    if (meshes.settings.continuous.earliestTimeOnly)
      findEarliest(meshes, pairs, scratch);
    else
      findContacts(meshes, pairs, scratch.contacts);
  }
}

/// The initial intersection check.
void MeshWork::checkStart(const MeshPair& meshes, std::span<const ElementPair> pairs,
                          JobScratch& scratch) const {
  StepFacts& facts = scratch.contacts.facts;
  if (const auto [ofA, ofB] = meshes.step.apartBelow; ofA != 0 || ofB != 0) {
    const auto isUnknown = [a = ofA, b = ofB](const ElementPair& p) {
      return static_cast<unsigned>(p.a >= a) | static_cast<unsigned>(p.b >= b);
    };
    unsigned any = 0;  // without branches: most batches have none
    for (const ElementPair& pair : pairs) any |= isUnknown(pair);
    if (any == 0) return;
    scratch.unknown.clear();
    std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(scratch.unknown), isUnknown);
    pairs = scratch.unknown;
  }
  if (!facts.startsPiercing())
    facts.atStart =
        std::max(facts.atStart, meetingOf(meshes, true, pairs, scratch.intersections).meeting);
}

/// Auto: finds intersections at the step's end.
void MeshWork::detectIntersections(std::span<const ElementPair> pairs, JobScratch& scratch) const {
  const MemoryScope memory(MemoryStage::NarrowPhase);
  PALPATE_ASSERT(m_record->plan.runsIntersection);
  const MeshPair meshes = m_record->meshes();
  findIntersections(meshes, pairs, scratch.intersections);
  if (meshes.step.motion > 0.0) findCrossingsAtStart(meshes, pairs, scratch.intersections);
}

void MeshWork::findEarliest(const MeshPair& meshes, std::span<const ElementPair> pairs,
                            JobScratch& scratch) const {
  std::atomic<double>& earliest = m_record->earliest;
  const double found = findEarliestImpact(meshes, pairs, earliest.load(), scratch.contacts);
  PALPATE_ASSERT(found >= 0.0);
  double known = earliest.load();
  while (found < known && !earliest.compare_exchange_weak(known, found)) {
  }
}

void MeshWork::runByBruteForce(JobScratch& scratch) const {
  detectPairByBruteForce(*m_record, scratch.contacts, scratch.intersections);
  if (m_record->pair.settings.continuous.earliestTimeOnly)
    takeEarliest(*m_record, scratch.contacts);
  scratch.nearby = true;
}

void MeshWork::join(Jobs jobs, const FrameJoin& join) const {
  PALPATE_ASSERT(jobs.empty() || m_record->plan.kind == PairKind::Meshes);
  PairRecord& record = *m_record;
  PairResults& results = join.results;
  auto& [pierced, leaving, piercingContacts, knownSides, bodies] = results.meshes;
  pierced.clear();
  results.start(jobs);
  auto &found = results.found(), &intersections = results.intersections();
  StepFacts& facts = results.facts();
  const bool byIntersection = record.plan.method == Method::Intersection;
  auto& atEnd = byIntersection ? found : intersections;
  piercingContacts.find(record.meshes(), atEnd, pierced);
  atEnd.push_back(&pierced);
  for (const auto* buffers : {&found, &intersections})
    for (const ContactBuffers* each : *buffers) facts.add(each->facts);
  results.sortFacts(record);
  checkTime();
  if (record.plan.step.reportsImpacts && facts.clearance == 0.0) {
    for (ContactBuffers* each : found)
      replaceByImpacts(record.meshes(), facts, *each, results.impacts);
    found.push_back(&results.impacts);
  }
  if (record.plan.startsIntersecting) facts.atStart = Meeting::Piercing;
  record.plan.startsIntersecting = facts.startsPiercing();
  std::size_t preferred = 0;
  record.sidesAreKnown = facts.startsPiercing() && record.plan.runsIntersection;
  if (record.sidesAreKnown) {
    leaving.clear();
    piercingContacts.findAtStart(record.meshes(), intersections, leaving);
    knownSides.apply(record.meshes(), intersections, leaving, found);
    preferred = intersections.size();
    found.insert(found.begin(), intersections.begin(), intersections.end());
  }
  checkTime();
  // A feature pair that Intersection reports is not reported by distance or impact as well: where
  // the step starts intersecting only Intersection knows the side.
  preferred = preferBodies(join, preferred);
  checkTime();
  const std::size_t intersectionCount = results.order(record, preferred);
  join.statistics.exactDecisions += pierced.exactDecisions;
  CollisionData::Contents& contents = CollisionData::Contents::of(record.next);
  describeExact(contents);
  const bool nearby =
      std::any_of(jobs.begin(), jobs.end(), [](const auto& job) { return job->nearby; });
  checkTime();
  results.assess(record, nearby, join.statistics);
  checkTime();
  // After assess(), which tests the triangles around every impact.
  const bool mixes = record.plan.step.reportsImpacts,
             continuous = record.plan.method == Method::Continuous;
  if (mixes || continuous)
    results.keepFirstImpacts(record, mixes ? 1.0 : std::numeric_limits<double>::infinity());
  std::size_t atImpact = 0;
  if (mixes)
    forEachTimed(contents, [&](const auto& contacts) {
      for (const auto& contact : contacts) atImpact += contact.timeOfImpact < 1.0;
    });
  else if (continuous)
    atImpact = sizeOf(contents) - intersectionCount;
  countContacts(atImpact, contents);
}

/// Auto: of closed bodies that intersect when the step begins, takes only contacts on outer sides.
/// Returns the number of preferred buffers.
std::size_t MeshWork::preferBodies(const FrameJoin& join, std::size_t preferred) const {
  PairRecord& record = *m_record;
  record.byBodies = false;
  if (record.pair.settings.method != Method::Auto) return preferred;
  auto &found = join.results.found(), &intersections = join.results.intersections();
  std::unique_ptr<BodyContacts>& bodies = join.results.meshes.bodies;
  if (!bodies) bodies = std::make_unique<BodyContacts>();
  const bool byIntersection = record.plan.method == Method::Intersection;
  const BodyContacts::Buffers all(found), local = byIntersection ? all : intersections;
  const bool areDeep = bodies->find(record, join.engine, join.results.facts().startsPiercing(),
                                    local, all.subspan(byIntersection ? all.size() : preferred));
  record.byBodies = areDeep || bodies->hasTurned();
  join.statistics.exactDecisions += bodies->exactDecisions();
  if (!areDeep) return preferred;
  found.assign(1, &bodies->contacts());
  return 1;
}

}  // namespace palpate
