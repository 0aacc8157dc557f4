#include "CollisionDetection/KeptCandidates.h"

#include "CollisionDetection/PairTable.h"
#include "Core/Assert.h"

#include <algorithm>
#include <utility>

namespace palpate {

namespace {

constexpr int kEnoughSlowFrames = 3;  // before lists are made

/// L: the length on which the motion of a step is measured.
double edgeOf(const PairRecord& record) {
  double edge = 0.0;
  for (const Geometry* geometry : {record.a, record.b})
    if (geometry->shortEdge > 0.0 && (edge == 0.0 || geometry->shortEdge < edge))
      edge = geometry->shortEdge;
  return edge;
}

/// Whether a search of the two octrees for pairs at one distance, at the step's end, answers the
/// pair.
bool canKeep(const PairRecord& record, const PairPlan& plan) {
  constexpr std::size_t kFewElements = 256;
  // Where floats of the extent have an error that is not small beside an edge, lists would hold
  // pairs that are far apart.
  constexpr double kMostErrorOfKept = 0x1p-12;
  const Body &a = record.a->body, &b = record.b->body;
  const double extent = a.mesh.now.bounds().merged(b.mesh.now.bounds()).sizes().maxCoeff();
  const auto fits = [](const Geometry& geometry) {
    return !geometry.body.isPlaced() && !geometry.body.tree.isSwept() && !geometry.body.field &&
           !geometry.proxy;
  };
  return plan.kind == PairKind::Meshes && plan.method == Method::Proximity && record.collides() &&
         kMostErrorOfKept * extent <= edgeOf(record) && fits(*record.a) && fits(*record.b) &&
         a.mesh.topology.elements.size() + b.mesh.topology.elements.size() >= kFewElements;
}

/// ns: about what an update and a search cost in a detection.
double costOfSearch(const Question& question, std::size_t candidates) {
  constexpr double kElement = 7.0, kCandidate = 14.0;
  const std::size_t elements =
      question.a.mesh.topology.elements.size() + question.b.mesh.topology.elements.size();
  return kElement * static_cast<double>(elements) + kCandidate * static_cast<double>(candidates);
}

/// In how many detections the first lists are made, which should last until the last ones are.
std::size_t detectionsToGather(double margin, double speed) {
  constexpr double kShareOfMargin = 0.25, kMost = 16.0;
  const double motion = kShareOfMargin * margin;
  if (motion >= kMost * speed) return static_cast<std::size_t>(kMost);
  return std::max<std::size_t>(1, static_cast<std::size_t>(motion / speed));
}

}  // namespace

void KeptCandidates::plan(const PairRecord& record, const PairPlan& expected,
                          const Settings& settings) {
  constexpr double kSpeedDecay = 0.95;  // in each detection
  const double edge = edgeOf(record), motion = expected.motion;
  const double most = KeptReach::kMostSpeed * edge;
  m_recentSpeed = motion > most ? 0.0 : std::max(motion, kSpeedDecay * m_recentSpeed);
  m_pauseFrames = std::max(m_pauseFrames - 1, 0);
  const bool isSlow = settings.octree.keepsPairs && settings.engine == Engine::Octree &&
                      settings.octree.update == OctreeUpdate::Auto && edge > 0.0 &&
                      motion <= most && m_pauseFrames == 0 && canKeep(record, expected);
  m_slowFrames = isSlow ? std::min(m_slowFrames + 1, kEnoughSlowFrames) : 0;
  const bool mayKeep = m_slowFrames == kEnoughSlowFrames;
  const std::array elements{record.a->body.revisions.elements, record.b->body.revisions.elements};
  // Other enabled elements own other features.
  const auto isCut = [&](const Geometry& geometry, const ElementsState& last) {
    const CutsSince& cuts = geometry.step.cutsSinceDetection();
    return cuts.before == last && cuts.after == geometry.body.revisions.elements;
  };
  m_followsCut = m_elements != elements;
  for (std::size_t i = 0; i < 2; ++i)
    if (!mayKeep ||
        (m_elements[i] != elements[i] && !isCut(i == 0 ? *record.a : *record.b, m_elements[i])))
      m_lists.deactivate();
  m_elements = elements;
  m_answers = mayKeep && m_lists.isWhole();
  m_gathers = mayKeep && !m_answers;
}

bool KeptCandidates::needsNoOctree(const PairRecord& record) const {
  const PairSettings& settings = record.pair.settings;
  const bool mayPierce = settings.method == Method::Auto &&
                         record.a->body.mesh.topology.hasFaces() &&
                         record.b->body.mesh.topology.hasFaces();
  return !record.collides() || (m_answers && settings.freeMotionReach == 0.0 && !mayPierce);
}

void KeptCandidates::reviewCut(const PairRecord& record) {
  if (!m_answers || !m_followsCut || m_lists.fits(record.a->body, record.b->body)) return;
  m_lists.deactivate();
  m_answers = false;
  m_gathers = true;
}

void KeptCandidates::reviewPlan(const PairRecord& record) {
  const PairPlan& plan = record.question->plan;
  if (needsNoOctree(record) || (canKeep(record, plan) && !plan.runsIntersection)) return;
  m_answers = m_gathers = false;
}

KeptSource KeptCandidates::source(const PairRecord& record) {
  if (!areInUse()) return {};
  const KeptReach reach =
      KeptReach::of(record.question->meshes().maxFeatureDistance(), m_recentSpeed, edgeOf(record));
  return {&m_lists, m_answers, reach, detectionsToGather(reach.lists, m_recentSpeed)};
}

std::size_t KeptCandidates::countCandidates(const PairRecord& record) {
  if (!std::exchange(m_countIsPending, false)) return 0;
  const Geometry &a = *record.a, &b = *record.b;
  return m_lists.countCandidates(a.body.mesh.topology, a.step.cutsSinceDetection(),
                                 b.body.mesh.topology, b.step.cutsSinceDetection());
}

/// Stops keeping for a while where lists cost more than searches.
void KeptCandidates::commit(const PairMoment& moment) noexcept {
  constexpr int kFirstPause = 64, kLongestPause = 4096;  // detections; any numbers will do
  const PairStatistics& statistics = moment.found.statistics;
  m_countIsPending = m_answers;
  if (!m_answers) m_searchedCandidates = statistics.candidatePairs;
  m_workedPairs = m_searchedCandidates + statistics.featurePairs;
  if (!areInUse() ||
      m_lists.cost(m_recentSpeed) <= costOfSearch(moment.question, m_searchedCandidates))
    return;
  m_nextPause = std::clamp(2 * m_nextPause, kFirstPause, kLongestPause);
  m_pauseFrames = m_nextPause;
}

void KeptCandidates::takeOver(KeptCandidates& former) noexcept {
  // What a detection decides, it decides anew.
  former.m_answers = former.m_gathers = former.m_followsCut = former.m_countIsPending = false;
  const std::size_t workedPairs = m_workedPairs;
  *this = std::move(former);
  m_workedPairs = workedPairs;
}

}  // namespace palpate
