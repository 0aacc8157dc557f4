#include "Search/KeptPairs.h"

#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <utility>

namespace palpate {

namespace {

/// Units are made for parts this many margins of the lists further apart.
constexpr double kUnitMargins = 1.0;
/// By how much more often than needed units are due, so that few have to be handled at once.
constexpr double kDueEarly = 1.2;
/// Of the units, when the first lists are made, one in this many is a sample.
constexpr std::size_t kSample = 64;
/// ns: about what it costs to make a list, for each of its pairs, and for each list.
constexpr double kCostOfPair = 40.0, kCostOfUnit = 1000.0;

/// The vertices of an element, or those that it had until a cut removed it.
const Triangle& verticesOf(const MeshTopology& topology, const CutsSince& cuts,
                           std::uint32_t element) {
  const Triangle& now = topology.elements[element];
  if (cuts.gone.empty() || now != Triangle{}) return now;
  const auto found =
      std::lower_bound(cuts.gone.begin(), cuts.gone.end(), std::pair(element, Triangle{}));
  return found != cuts.gone.end() && found->first == element ? found->second : now;
}

}  // namespace

void KeptPairs::addMotion(const PieceMotion& a, const PieceMotion& b) {
  PALPATE_ASSERT(m_isActive);
  if (!a.isKnown() || !b.isKnown()) return deactivate();
  const bool self = &a == &b;
  const MotionRange allA = m_partsA.addMotion(a), allB = self ? allA : m_partsB.addMotion(b);
  if (allA.isZero() && allB.isZero()) return;
  constexpr double kUp = 1.0 + 0x1p-50;  // the rounding of the sums
  m_moved = (m_moved + largestMotion(allA, allB)) * kUp;
  const auto& movedB = (self ? m_partsA : m_partsB).moved;
  for (Unit& unit : m_units) {
    const MotionRange &ofA = m_partsA.moved[unit.partA], &ofB = movedB[unit.partB];
    if (!unit.isListed() || (ofA.isZero() && ofB.isZero())) continue;
    const double motion = largestMotion(ofA, ofB);
    for (double* moved : {&unit.movedSinceLists, &unit.movedSinceClasses})
      *moved = (*moved + motion) * kUp;
    m_lists.due += kDueEarly * unit.weight() * std::min(1.0, motion / unit.atLists.lists);
    m_classes.due +=
        kDueEarly * unit.weightOfClasses() * std::min(1.0, motion / unit.atClasses.classes);
  }
}

bool KeptPairs::fits(const Body& a, const Body& b) const {
  const auto isKnown = [](const OctreeParts& parts, const Body& body) {
    return parts.areOf(body) || parts.canCut(body);
  };
  return isKnown(m_partsA, a) && (&a == &b || isKnown(m_partsB, b));
}

bool KeptPairs::isWhole() const {
  return m_isActive &&
         std::all_of(m_units.begin(), m_units.end(), [](const Unit& u) { return u.isListed(); });
}

double KeptPairs::cost(double speed) const {
  PALPATE_ASSERT(speed >= 0.0);
  double ofListed = 0.0, listed = 0.0;
  for (const Unit& unit : m_units) {
    if (!unit.isListed()) continue;
    ++listed;
    const double turns = std::min(1.0, kDueEarly * speed / unit.atLists.lists);
    ofListed += turns * (kCostOfUnit + kCostOfPair * static_cast<double>(unit.boxes.size()));
  }
  return listed > 0.0 ? ofListed * static_cast<double>(m_units.size()) / listed : 0.0;
}

std::size_t KeptPairs::start(const Body& a, const Body& b, const KeptReach& reach,
                             std::size_t mostJobs) {
  startUnits(a, b, reach);
  chooseUnits();
  const std::size_t jobs = divide(mostJobs, [](const Unit& unit) { return unit.weight(); });
  m_isActive = true;
  return jobs;
}

std::size_t KeptPairs::startGathering(const Body& a, const Body& b, const KeptReach& reach,
                                      std::size_t detections, std::size_t mostJobs) {
  PALPATE_ASSERT(detections > 0);
  startUnits(a, b, reach);
  const std::size_t size = m_units.size();
  std::size_t wanted = (size + detections - 1) / detections;
  bool isFirst = true;
  for (Unit& unit : m_units) {
    unit.isMade = unit.isSorted = true;
    isFirst &= !unit.isListed();
  }
  const std::size_t stride = isFirst ? std::min(kSample, size) : 1;
  for (std::size_t i = stride / 2; i < size && wanted > 0; i += stride) {
    if (m_units[i].isListed()) continue;
    m_units[i].isMade = false;
    --wanted;
  }
  const std::size_t jobs =
      divide(mostJobs, [](const Unit& unit) { return unit.isMade ? 0.0 : 1.0; });
  m_isActive = true;
  return jobs;
}

/// What both kinds of detections begin with.
void KeptPairs::startUnits(const Body& a, const Body& b, const KeptReach& reach) {
  const bool hasParts = m_isActive && fits(a, b);
  m_isActive = false;
  m_detection.start(a, b, reach);
  if (hasParts)
    cutUnits(a, b);
  else
    makeParts(a, b);
  if (!hasParts || reach.distance + reach.lists + m_moved > m_reached) {
    m_reached = reach.distance + (1.0 + kUnitMargins) * reach.lists;
    m_moved = 0.0;
    makeUnits(nearParts(m_partsA, partsB(), m_detection.treesWithin(a, b, m_reached), false));
  }
}

void KeptPairs::makeParts(const Body& a, const Body& b) {
  m_units.clear();
  m_partsA.make(a);
  if (&a != &b) m_partsB.make(b);
  m_lists = m_classes = {};
}

/// Makes units of these pairs of parts. Those that there were before keep their lists.
void KeptPairs::makeUnits(const CountedVector<PartPair>& pairs) {
  std::swap(m_units, m_formerUnits);
  m_units.clear();
  CountedVector<Unit>& former = m_formerUnits;
  std::size_t old = 0, spare = 0;
  // With the buffers of one that there is not any more.
  const auto newUnit = [&] {
    Unit unit;
    while (spare < old && former[spare].boxes.capacity() == 0) ++spare;
    if (spare == old) return unit;
    unit.boxes.swap(former[spare].boxes);
    unit.near.swap(former[spare++].near);
    unit.boxes.clear();
    unit.near.clear();
    return unit;
  };
  for (const PartPair& pair : pairs) {
    while (old < former.size() && former[old].parts() < pair) ++old;
    const bool isKept = old < former.size() && former[old].parts() == pair;
    m_units.push_back(isKept ? std::move(former[old++]) : newUnit());
    m_units.back().partA = pair[0];
    m_units.back().partB = pair[1];
  }
  for (Turn* turn : {&m_lists, &m_classes})
    if (turn->next >= m_units.size()) turn->next = 0;
}

/// After a cut that kept the nodes: lists of parts with elements at the cut are missing, and such
/// parts have units with all that are near them now.
void KeptPairs::cutUnits(const Body& a, const Body& b) {
  const bool self = &a == &b;
  if (m_partsA.areOf(a) && (self || m_partsB.areOf(b))) return;
  OctreeParts& partsB = self ? m_partsA : m_partsB;
  for (OctreeParts* parts : {&m_partsA, &partsB})
    std::fill(parts->isCut.begin(), parts->isCut.end(), std::uint8_t{0});
  if (!m_partsA.areOf(a)) m_partsA.cut(a);
  if (!self && !m_partsB.areOf(b)) m_partsB.cut(b);
  const auto isCut = [&](std::uint32_t i, std::uint32_t j) {
    return m_partsA.isCut[i] || partsB.isCut[j];
  };
  // Further apart than m_reached, less m_moved, are all pairs of parts without a unit.
  const CountedVector<PartPair> near =
      nearParts(m_partsA, partsB, m_detection.treesWithin(a, b, m_reached), true);
  CountedVector<PartPair> former, others;
  for (Unit& unit : m_units) {
    const bool cut = isCut(unit.partA, unit.partB);
    (cut ? former : others).push_back(unit.parts());
    if (cut) unit.movedSinceLists = std::numeric_limits<double>::infinity();
  }
  if (near == former) return;
  CountedVector<PartPair> all(near.size() + others.size());
  std::merge(near.begin(), near.end(), others.begin(), others.end(), all.begin());
  makeUnits(all);
}

/// Units whose lists or classes no longer reach far enough, and those whose turn it is.
void KeptPairs::chooseUnits() {
  for (Unit& unit : m_units) {
    const auto reaches = [&](double moved, const KeptReach& then, double margin) {
      const KeptReach& reach = m_detection.reach();
      return reach.distance + moved + reach.error + then.error <= then.distance + margin;
    };
    unit.isMade = reaches(unit.movedSinceLists, unit.atLists, unit.atLists.lists);
    unit.isSorted =
        unit.isMade && reaches(unit.movedSinceClasses, unit.atClasses, unit.atClasses.classes);
  }
  takeTurns(
      m_lists, [](Unit& unit) -> bool& { return unit.isMade; },
      [](const Unit& unit) { return unit.weight(); });
  for (Unit& unit : m_units) unit.isSorted &= unit.isMade;
  takeTurns(
      m_classes, [](Unit& unit) -> bool& { return unit.isSorted; },
      [](const Unit& unit) { return unit.weightOfClasses(); });
}

template <class IsDone, class Weight>
void KeptPairs::takeTurns(Turn& turn, IsDone&& isDone, Weight&& weight) {
  double all = 0.0;
  for (const Unit& unit : m_units) all += weight(unit);
  turn.due = std::min(turn.due, all);
  for (std::size_t i = 0; i < m_units.size() && turn.due > 0.0; ++i) {
    Unit& unit = m_units[turn.next];
    turn.next = (turn.next + 1) % m_units.size();
    if (!isDone(unit) || unit.movedSinceClasses == 0.0) continue;
    isDone(unit) = false;
    turn.due -= weight(unit);
  }
}

/// Divides the units among jobs of about the same weight. Returns their number.
template <class Weight>
std::size_t KeptPairs::divide(std::size_t mostJobs, Weight&& weight) {
  PALPATE_ASSERT(mostJobs > 0);
  double all = 0.0, sum = 0.0;
  for (const Unit& unit : m_units) all += weight(unit);
  m_jobs.assign(1, 0);
  for (std::size_t i = 0; i < m_units.size(); ++i) {
    sum += weight(m_units[i]);
    if (sum >= all * static_cast<double>(m_jobs.size()) / static_cast<double>(mostJobs) ||
        i + 1 == m_units.size())
      m_jobs.push_back(i + 1);
  }
  return m_jobs.size() - 1;
}

void KeptPairs::make(Unit& unit, const MeshPair& meshes, JobScratch& scratch) {
  const NodePair nodes{m_partsA.nodes[unit.partA], partsB().nodes[unit.partB]};
  m_detection.make(unit, nodes, meshes, scratch);
}

void KeptPairs::gather(std::size_t job, const MeshPair& meshes, JobScratch& scratch) {
  PALPATE_ASSERT(job + 1 < m_jobs.size());
  for (std::size_t i = m_jobs[job]; i < m_jobs[job + 1]; ++i)
    if (!m_units[i].isMade) {
      checkTime();
      make(m_units[i], meshes, scratch);
    }
}

void KeptPairs::run(std::size_t job, const MeshPair& meshes, JobScratch& scratch,
                    Buffer<ElementPair>& near) {
  PALPATE_ASSERT(job + 1 < m_jobs.size());
  for (std::size_t i = m_jobs[job]; i < m_jobs[job + 1]; ++i) {
    Unit& unit = m_units[i];
    checkTime();
    if (!unit.isMade) make(unit, meshes, scratch);
    if (!unit.isSorted) {
      scratch.kept.assign(unit.near.begin(), unit.near.end());
      m_detection.sort(unit, meshes, scratch.kept, scratch);
    }
    const auto active = m_detection.nearOf(unit);
    near.insert(near.end(), active.begin(), active.end());
  }
}

std::size_t KeptPairs::countCandidates(const MeshTopology& a, const CutsSince& cutsOfA,
                                       const MeshTopology& b, const CutsSince& cutsOfB) const {
  std::size_t count = 0;
  for (const Unit& unit : m_units)
    for (const ElementPair& pair : unit.boxes)
      count += m_detection.overlap(verticesOf(a, cutsOfA, pair.a), verticesOf(b, cutsOfB, pair.b));
  return count;
}

}  // namespace palpate
