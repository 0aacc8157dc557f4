#include "Search/MeshWork.h"

#include "Search/BruteForce.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/ElementBoxes.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Meeting.h"
#include "NarrowPhase/StepCheck.h"
#include "Contact/ContactLists.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <iterator>
#include <limits>

namespace palpate {

std::size_t MeshWork::start(const FrameStart& frame) {
  m_byBruteForce = frame.engine == Engine::BruteForce;
  if (m_byBruteForce) return 1;
  const KeptSource& kept = m_search.kept;
  if (kept.answers) return startKept(frame);
  m_searchJobs = m_candidates.start(question(), frame, true, BoxFrame::Body);
  if (!kept.lists || !question().hasElements()) return m_searchJobs;
  return m_searchJobs + kept.lists->startGathering(question().a, question().b, kept.reach,
                                                   kept.detections, jobsFor(frame));
}

std::size_t MeshWork::jobsFor(const FrameStart& frame) {
  return frame.divides() ? TraversalJobs::kJobsPerPair : 1;
}

std::size_t MeshWork::startKept(const FrameStart& frame) {
  if (!question().hasElements()) return 0;
  KeptPairs& lists = *m_search.kept.lists;
  return lists.start(question().a, question().b, m_search.kept.reach, jobsFor(frame));
}

void MeshWork::runKept(std::size_t job, JobScratch& scratch) const {
  KeptPairs& lists = *m_search.kept.lists;
  const MeshPair meshes = question().meshes(&lists.floats());
  scratch.near.clear();
  lists.run(job, meshes, scratch, scratch.near);
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  const auto enabled = [&](std::span<const ElementPair> pairs, Buffer<ElementPair>& kept) {
    const MeshTopology &a = meshes.a.topology, &b = meshes.b.topology;
    kept.assign(pairs.begin(), pairs.end());
    std::erase_if(kept,
                  [&](const ElementPair& p) { return !a.isEnabled(p.a) || !b.isEnabled(p.b); });
    return std::span<const ElementPair>(kept);
  };
  const bool anyDisabled = question().anyDisabled();
  // Those that meet at the step's start have boxes within the motion at its end, and are listed.
  if (meshes.step.checksStart)
    lists.forEachList(job, meshes.step.apartBelow, [&](std::span<const ElementPair> pairs) {
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

bool MeshWork::repeats(const JobScratch& job) const {
  return job.intersectionsMissed && question().plan.runsIntersection;
}

bool MeshWork::hasRound(int round, Jobs jobs) const {
  if (round != 1) return round == 0;
  bool startsIntersecting = question().plan.startsIntersecting, missed = false;
  for (const auto& job : jobs) {
    startsIntersecting |= job->contacts.facts.startsPiercing();
    missed |= repeats(*job);
  }
  return startsIntersecting && missed;
}

void MeshWork::run(int round, std::size_t job, JobScratch& scratch) const {
  if (m_byBruteForce) {
    runByBruteForce(scratch);
  } else if (round == 0 && m_search.kept.answers) {
    runKept(job, scratch);
  } else if (job >= m_searchJobs) {
    if (round == 0)
      m_search.kept.lists->gather(job - m_searchJobs, question().meshes(&m_candidates.floats()),
                                  scratch);
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
  const MeshPair meshes =
      question().meshes(m_candidates.isMapped() ? nullptr : &m_candidates.floats());
  {
    const MemoryScope memory(MemoryStage::NarrowPhase);
    const AddedTime time(scratch.narrowMilliseconds);
    const StepFacts& facts = scratch.contacts.facts;
    if (meshes.step.checksStart) checkStart(meshes, pairs, scratch);
    if (question().plan.runsIntersection &&
        (facts.startsPiercing() || question().plan.startsIntersecting))
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
  PALPATE_ASSERT(question().plan.runsIntersection);
  const MeshPair meshes = question().meshes();
  findIntersections(meshes, pairs, scratch.intersections);
  if (meshes.step.motion > 0.0) findCrossingsAtStart(meshes, pairs, scratch.intersections);
}

void MeshWork::findEarliest(const MeshPair& meshes, std::span<const ElementPair> pairs,
                            JobScratch& scratch) const {
  std::atomic<double>& earliest = m_search.answer->earliest;
  const double found = findEarliestImpact(meshes, pairs, earliest.load(), scratch.contacts);
  PALPATE_ASSERT(found >= 0.0);
  double known = earliest.load();
  while (found < known && !earliest.compare_exchange_weak(known, found)) {
  }
}

void MeshWork::runByBruteForce(JobScratch& scratch) const {
  const AddedTime time(scratch.narrowMilliseconds);
  detectPairByBruteForce(question(), scratch.contacts, scratch.intersections);
  if (question().settings().continuous.earliestTimeOnly) takeEarliest(m_search, scratch.contacts);
  scratch.nearby = true;
}

void MeshWork::join(Jobs jobs, const FrameJoin& join) const {
  PALPATE_ASSERT(jobs.empty() || question().plan.kind == PairKind::Meshes);
  const Question& asked = question();
  PairResults& results = join.results;
  auto& [pierced, leaving, piercingContacts, knownSides, bodies] = results.meshes;
  pierced.clear();
  results.start(jobs);
  auto &found = results.found(), &intersections = results.intersections();
  StepFacts& facts = results.facts();
  const bool byIntersection = asked.plan.method == Method::Intersection;
  auto& atEnd = byIntersection ? found : intersections;
  piercingContacts.find(asked.meshes(), atEnd, pierced);
  atEnd.push_back(&pierced);
  for (const auto* buffers : {&found, &intersections})
    for (const ContactBuffers* each : *buffers) facts.add(each->facts);
  results.sortFacts(asked);
  checkTime();
  if (asked.plan.step.reportsImpacts && facts.clearance == 0.0) {
    for (ContactBuffers* each : found)
      replaceByImpacts(asked.meshes(), facts, *each, results.impacts);
    found.push_back(&results.impacts);
  }
  if (asked.plan.startsIntersecting) facts.atStart = Meeting::Piercing;
  std::size_t preferred = 0;
  bool& sidesAreKnown = m_search.answer->sidesAreKnown;
  sidesAreKnown = facts.startsPiercing() && asked.plan.runsIntersection;
  if (sidesAreKnown) {
    leaving.clear();
    piercingContacts.findAtStart(asked.meshes(), intersections, leaving);
    knownSides.apply(asked.meshes(), intersections, leaving, found);
    preferred = intersections.size();
    found.insert(found.begin(), intersections.begin(), intersections.end());
  }
  checkTime();
  // A feature pair that Intersection reports is not reported by distance or impact as well: where
  // the step starts intersecting only Intersection knows the side.
  preferred = preferBodies(join, preferred);
  checkTime();
  const std::size_t intersectionCount = results.order(m_search, preferred);
  join.statistics.exactDecisions += pierced.exactDecisions;
  CollisionData::Contents& contents = m_search.answer->contents();
  describeExact(contents);
  const bool nearby =
      std::any_of(jobs.begin(), jobs.end(), [](const auto& job) { return job->nearby; });
  checkTime();
  results.assess(m_search, nearby, join.statistics);
  checkTime();
  // After assess(), which tests the triangles around every impact.
  const bool mixes = asked.plan.step.reportsImpacts,
             continuous = asked.plan.method == Method::Continuous;
  if (mixes || continuous)
    results.keepFirstImpacts(m_search, mixes ? 1.0 : std::numeric_limits<double>::infinity());
  std::size_t atImpact = 0;
  if (mixes)
    forEachContactList(contents, [&](ContactKind, const auto& contacts) {
      for (const auto& contact : contacts) atImpact += contact.timeOfImpact < 1.0;
    });
  else if (continuous)
    atImpact = contactCount(contents) - intersectionCount;
  countContacts(atImpact, contents);
}

/// Auto: of closed bodies that intersect when the step begins, takes only contacts on outer sides.
/// Returns the number of preferred buffers.
std::size_t MeshWork::preferBodies(const FrameJoin& join, std::size_t preferred) const {
  const Question& asked = question();
  bool& byBodies = m_search.answer->byBodies;
  byBodies = false;
  if (asked.settings().method != Method::Auto) return preferred;
  auto &found = join.results.found(), &intersections = join.results.intersections();
  std::unique_ptr<BodyContacts>& bodies = join.results.meshes.bodies;
  if (!bodies) bodies = std::make_unique<BodyContacts>();
  const bool byIntersection = asked.plan.method == Method::Intersection;
  const BodyContacts::Buffers all(found), local = byIntersection ? all : intersections;
  const bool areDeep = bodies->find(asked, join.engine, join.results.facts().startsPiercing(),
                                    local, all.subspan(byIntersection ? all.size() : preferred));
  byBodies = areDeep || bodies->hasTurned();
  join.statistics.exactDecisions += bodies->exactDecisions();
  if (!areDeep) return preferred;
  found.assign(1, &bodies->contacts());
  return 1;
}

}  // namespace palpate
