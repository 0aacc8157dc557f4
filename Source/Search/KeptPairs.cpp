#include "Search/KeptPairs.h"

#include "Bodies/OctreeFrame.h"
#include "Octree/BoxMap.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace palpate {

namespace {

/// Elements of a part, at least, and the largest number of parts.
constexpr std::size_t kElementsPerPart = 512, kMostParts = 512;
/// Units are made for parts this many margins of the lists further apart.
constexpr double kUnitMargins = 1.0;
/// By how much more often than needed units are due, so that few have to be handled at once.
constexpr double kDueEarly = 1.2;
/// Of the units, when the first lists are made, one in this many is a sample.
constexpr std::size_t kSample = 64;
/// ns: about what it costs to make a list, for each of its pairs, and for each list.
constexpr double kCostOfPair = 40.0, kCostOfUnit = 1000.0;
/// Margins in edges: these factors times the square root of the speed, in limits.
constexpr double kListFactor = 2.0, kClassFactor = 1.6, kLeastMargin = 0.02, kMostMargin = 1.0;

/// The largest coordinate about the origin of the floats, L.
double reachOf(const Body& body) {
  const Eigen::AlignedBox3d& bounds = body.mesh.now.bounds();
  const Eigen::Vector3d& origin = body.tree.floatsFrame().origin;
  return std::max((bounds.min() - origin).cwiseAbs().maxCoeff(),
                  (bounds.max() - origin).cwiseAbs().maxCoeff());
}

Eigen::Vector3d offsetOf(const Body& a, const Body& b) {
  const FloatFrame &from = b.tree.floatsFrame(), &to = a.tree.floatsFrame();
  return from.scaled(from.origin, to.origin);
}

/// Appends the parts of a tree below a node.
void addParts(const Octree& tree, OctreeNode node, std::size_t most,
              CountedVector<OctreeNode>& parts) {
  if (tree.isEmpty(node)) return;
  const auto [begin, end] = tree.range(node);
  const OctreeNode children = tree.firstChild(node);
  if (end - begin <= most || children == 0) return parts.push_back(node);
  const auto own = tree.ownRange(node);
  if (own.first < own.second) parts.push_back(node | NodePair::kOwn);
  for (std::uint32_t i = 0; i < kChildren; ++i) addParts(tree, children + i, most, parts);
}

/// The places of a part's elements in the octree's order. Parts follow each other in it.
std::pair<std::uint32_t, std::uint32_t> rangeOf(const Octree& tree, OctreeNode part) {
  return part & NodePair::kOwn ? tree.ownRange(part & ~NodePair::kOwn) : tree.range(part);
}

}  // namespace

KeptPairs::Reach KeptPairs::reachFor(double distance, double speed, double edge) {
  PALPATE_ASSERT(distance >= 0.0 && speed >= 0.0 && edge > 0.0);
  const auto margin = [&](double factor) {
    return edge * std::clamp(factor * std::sqrt(speed / edge), kLeastMargin, kMostMargin);
  };
  return {distance, margin(kListFactor), margin(kClassFactor)};
}

void KeptPairs::Parts::make(const Body& body) {
  const Octree& tree = body.tree.octree();
  layout = 0;
  nodes.clear();
  groups.assign(1, 0);
  addParts(tree, 0, std::max(kElementsPerPart, tree.size() / kMostParts), nodes);
  CountedVector<std::pair<std::uint32_t, std::uint32_t>> ranges;
  ranges.reserve(nodes.size());
  for (const OctreeNode node : nodes) {
    ranges.push_back(rangeOf(tree, node));
    groups.push_back(static_cast<std::uint32_t>(
        std::ranges::lower_bound(tree.groups(), ranges.back().second) - tree.groups().begin()));
  }
  pieces = piecesOf(body.tree.ordered(), ranges, body.mesh.topology.vertexCount);
  moved.resize(nodes.size());
  isCut.assign(nodes.size(), 0);
  layout = tree.layout();
}

bool KeptPairs::Parts::canCut(const Body& body) const {
  const ElementCuts::Cut& cut = body.tree.lastCut();
  return cut.before == layout && cut.after == body.tree.octree().layout();
}

/// Finds the pieces of parts with elements at the cut.
void KeptPairs::Parts::cut(const Body& body) {
  PALPATE_ASSERT(canCut(body));
  layout = 0;
  findPiecesAgain(
      body.tree.ordered(), body.tree.octree().groups(), body.tree.lastCut().groups,
      body.mesh.topology.vertexCount, pieces,
      [&](std::size_t part) { return std::pair(groups[part], groups[part + 1]); },
      [&](std::size_t part) { isCut[part] = 1; });
  layout = body.tree.octree().layout();
}

/// Returns the motion of all vertices.
MotionRange KeptPairs::Parts::addMotion(const PieceMotion& motion) {
  for (std::size_t part = 0; part < moved.size(); ++part) moved[part] = motion.of(pieces[part]);
  MotionRange all;
  for (const MotionRange& range : motion.ranges()) all.add(range);
  return all;
}

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
  const auto isKnown = [](const Parts& parts, const Body& body) {
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

std::size_t KeptPairs::start(const Body& a, const Body& b, const Reach& reach,
                             std::size_t mostJobs) {
  startUnits(a, b, reach);
  chooseUnits();
  const std::size_t jobs = divide(mostJobs, [](const Unit& unit) { return unit.weight(); });
  m_isActive = true;
  return jobs;
}

std::size_t KeptPairs::startGathering(const Body& a, const Body& b, const Reach& reach,
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
void KeptPairs::startUnits(const Body& a, const Body& b, const Reach& reach) {
  PALPATE_ASSERT(reach.distance >= 0.0 && reach.lists >= reach.classes && reach.classes > 0.0);
  const bool hasParts = m_isActive && fits(a, b);
  m_isActive = false;
  m_reach = reach;
  m_scale = a.tree.floatsFrame().scale;
  const Eigen::Vector3d offset = offsetOf(a, b);
  const double size = reachOf(a) + reachOf(b) + offset.cwiseAbs().maxCoeff() / m_scale;
  // Each bound of a box is off by less than 2^-21 of it, and so is their difference. Distances of
  // features have errors of doubles.
  m_reach.error =
      0x1p-19 * (size + reach.distance + reach.lists) + OutwardRounding::kAbsolute / m_scale;
  m_floats = {a.tree.floats(), b.tree.floats(), nullptr, nullptr};
  setShift(m_floats.shiftLower, m_floats.shiftUpper, {offset[0], offset[1], offset[2]},
           reach.distance * m_scale);
  // Floats, offset and two differences have errors of 2^-24 each.
  m_floatError = static_cast<float>(3 * 0x1p-24 * size * m_scale) * (1.0f + 0x1p-20f);
  for (int k = 0; k < 3; ++k) m_offset[k] = static_cast<float>(offset[k]);
  if (hasParts)
    cutUnits(a, b);
  else
    makeParts(a, b);
  if (!hasParts || reach.distance + reach.lists + m_moved > m_reached) {
    m_reached = reach.distance + (1.0 + kUnitMargins) * reach.lists;
    m_moved = 0.0;
    makeUnits(nearParts(a, b, m_reached, false));
  }
  m_trees = treesOf(
      a, b, reach.distance + reach.lists + m_reach.error + a.tree.lag() + b.tree.lag(), false);
}

void KeptPairs::makeParts(const Body& a, const Body& b) {
  m_units.clear();
  m_partsA.make(a);
  if (&a != &b) m_partsB.make(b);
  m_lists = m_classes = {};
}

CountedVector<KeptPairs::PartPair> KeptPairs::nearParts(const Body& a, const Body& b,
                                                        double reached, bool cut) const {
  const bool self = &a == &b;
  const Parts& partsB = self ? m_partsA : m_partsB;
  const TreePair trees =
      treesOf(a, b, reached + m_reach.error + a.tree.lag() + b.tree.lag(), false);
  CountedVector<std::uint32_t> all(partsB.nodes.size()), ofCut;
  std::iota(all.begin(), all.end(), 0u);
  for (const std::uint32_t j : all)
    if (partsB.isCut[j]) ofCut.push_back(j);
  CountedVector<PartPair> near;
  for (std::uint32_t i = 0; i < m_partsA.nodes.size(); ++i) {
    FloatBox box = trees.a->box(m_partsA.nodes[i] & ~NodePair::kOwn);
    for (std::size_t k = 0; k < 3; ++k) {
      box.lower[k] = OutwardRounding::down(box.lower[k] + trees.shiftLower[k]);
      box.upper[k] = OutwardRounding::up(box.upper[k] + trees.shiftUpper[k]);
    }
    for (const std::uint32_t j : cut && !m_partsA.isCut[i] ? ofCut : all)
      if ((!self || j >= i) && box.overlaps(trees.b->box(partsB.nodes[j] & ~NodePair::kOwn)))
        near.push_back({i, j});
  }
  return near;
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
  Parts& partsB = self ? m_partsA : m_partsB;
  for (Parts* parts : {&m_partsA, &partsB})
    std::fill(parts->isCut.begin(), parts->isCut.end(), std::uint8_t{0});
  if (!m_partsA.areOf(a)) m_partsA.cut(a);
  if (!self && !m_partsB.areOf(b)) m_partsB.cut(b);
  const auto isCut = [&](std::uint32_t i, std::uint32_t j) {
    return m_partsA.isCut[i] || partsB.isCut[j];
  };
  // Further apart than m_reached, less m_moved, are all pairs of parts without a unit.
  const CountedVector<PartPair> near = nearParts(a, b, m_reached, true);
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
    const auto reaches = [&](double moved, const Reach& reach, double margin) {
      return m_reach.distance + moved + m_reach.error + reach.error <= reach.distance + margin;
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
      sort(unit, meshes, scratch.kept, scratch);
    }
    const auto active = nearOf(unit);
    near.insert(near.end(), active.begin(), active.end());
  }
}

std::size_t KeptPairs::countCandidates(const MeshTopology& a, const CutsSince& cutsOfA,
                                       const MeshTopology& b, const CutsSince& cutsOfB) const {
  const auto verticesOf = [](const MeshTopology& topology, const CutsSince& cuts,
                             std::uint32_t element) -> const Triangle& {
    const Triangle& now = topology.elements[element];
    if (cuts.gone.empty() || now != Triangle{}) return now;
    const auto found =
        std::lower_bound(cuts.gone.begin(), cuts.gone.end(), std::pair(element, Triangle{}));
    return found != cuts.gone.end() && found->first == element ? found->second : now;
  };
  std::size_t count = 0;
  for (const Unit& unit : m_units)
    for (const ElementPair& pair : unit.boxes)
      count += overlap(verticesOf(a, cutsOfA, pair.a), verticesOf(b, cutsOfB, pair.b));
  return count;
}

/// The comparison of PairWalk, with the boxes of triangleBoxes().
bool KeptPairs::overlap(const Triangle& a, const Triangle& b) const {
  using Lanes = Eigen::Array4f;
  const auto down = [](const Lanes& v) -> Lanes {
    return v - (v.abs() * OutwardRounding::kRelative + OutwardRounding::kAbsolute);
  };
  const auto up = [](const Lanes& v) -> Lanes {
    return v + (v.abs() * OutwardRounding::kRelative + OutwardRounding::kAbsolute);
  };
  const auto at = [](const FloatPoint* floats, std::uint32_t vertex) {
    return Lanes::MapAligned(&floats[vertex].x);
  };
  const auto lower = [&](const FloatPoint* floats, const Triangle& corners) -> Lanes {
    return down(at(floats, corners[0]).min(at(floats, corners[1])).min(at(floats, corners[2])));
  };
  const auto upper = [&](const FloatPoint* floats, const Triangle& corners) -> Lanes {
    return up(at(floats, corners[0]).max(at(floats, corners[1])).max(at(floats, corners[2])));
  };
  Lanes lowerA = lower(m_floats.a, a), upperA = upper(m_floats.a, a);
  constexpr std::array<float, 4> kNone{};
  if (m_floats.shiftLower != kNone || m_floats.shiftUpper != kNone) {
    lowerA = down(lowerA + Lanes::Map(m_floats.shiftLower.data()));
    upperA = up(upperA + Lanes::Map(m_floats.shiftUpper.data()));
  }
  const Lanes further = (lowerA - upper(m_floats.b, b)).max(lower(m_floats.b, b) - upperA);
  return !(further.head<3>() > 0.0f).any();
}

/// Features of pairs of class i were further apart than i parts of the margin more than the
/// distance asked for then.
std::span<const ElementPair> KeptPairs::nearOf(const Unit& unit) const {
  const Reach& then = unit.atClasses;
  const double reached = m_reach.distance + unit.movedSinceClasses + m_reach.error + then.error;
  int last = 0;
  while (last + 1 < kClasses && !(reached < then.distance + (last + 1) * then.classes / kClasses))
    ++last;
  return std::span(unit.near).first(unit.ends[last]);
}

/// Makes the lists of a unit.
void KeptPairs::make(Unit& unit, const MeshPair& meshes, JobScratch& scratch) {
  const MemoryScope memory(MemoryStage::Pairs);
  unit.movedSinceLists = std::numeric_limits<double>::infinity();
  scratch.sink.start(nullptr, nullptr);
  const NodePair nodes{m_partsA.nodes[unit.partA],
                       (m_trees.self() ? m_partsA : m_partsB).nodes[unit.partB]};
  traverse(m_trees, std::span(&nodes, 1), scratch.stack, scratch.sink);
  const auto found = scratch.sink.kept();
  resizeSparingly(unit.boxes, found.size());
  std::copy(found.begin(), found.end(), unit.boxes.begin());
  unit.last = {};
  for (const ElementPair& pair : unit.boxes)
    unit.last = {std::max(unit.last[0], pair.a), std::max(unit.last[1], pair.b)};
  unit.atLists = m_reach;
  sort(unit, meshes, unit.boxes, scratch);
  unit.movedSinceLists = 0.0;
  unit.isMade = true;
}

FloatMeshes KeptPairs::floatMeshes(const MeshTopology& a, const MeshTopology& b) const {
  return {a, b, m_floats.a, m_floats.b, m_offset, m_floatError};
}

/// Sorts those of the pairs with near features into classes. Pairs beyond the margin of the lists
/// are left out.
void KeptPairs::sort(Unit& unit, const MeshPair& meshes, std::span<const ElementPair> pairs,
                     JobScratch& scratch) {
  const MemoryScope memory(MemoryStage::Pairs);
  Buffer<float>& bounds = scratch.bounds;
  bounds.resize(pairs.size());
  featureBounds(floatMeshes(meshes.a.topology, meshes.b.topology), pairs, bounds.data());
  const double limit = unit.atLists.distance + unit.atLists.lists + unit.atLists.error;
  const auto distance = static_cast<float>((m_reach.distance + m_reach.error) * m_scale),
             most = static_cast<float>(limit * m_scale) * (1.0f + 0x1p-20f),
             parts = static_cast<float>(kClasses / (m_reach.classes * m_scale));
  std::array<std::uint32_t, kClasses + 1> next{};  // the last one: further than all classes
  Buffer<std::uint8_t>& classes = scratch.classes;
  classes.resize(pairs.size());
  const bool isNew = pairs.data() == unit.boxes.data();
  constexpr std::uint8_t kNone = 255;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    // NaN is the bound of a pair without tests, of one point.
    if (isNew && !(bounds[i] <= most)) {
      classes[i] = kNone;
      continue;
    }
    const float part = (bounds[i] - distance) * parts;
    classes[i] = part >= static_cast<float>(kClasses) ? static_cast<std::uint8_t>(kClasses)
                 : part > 0.0f                        ? static_cast<std::uint8_t>(part)
                                                      : std::uint8_t{0};
    ++next[classes[i]];
  }
  std::uint32_t size = 0;
  for (int c = 0; c <= kClasses; ++c) {
    const std::uint32_t begin = size;
    size += next[c];
    if (c < kClasses) unit.ends[c] = size;
    next[c] = begin;
  }
  resizeSparingly(unit.near, size);
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (classes[i] != kNone) unit.near[next[classes[i]]++] = pairs[i];
  unit.atClasses = m_reach;
  unit.movedSinceClasses = 0.0;
  unit.isSorted = true;
}

}  // namespace palpate
