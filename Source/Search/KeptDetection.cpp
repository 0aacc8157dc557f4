#include "Search/KeptDetection.h"

#include "Bodies/OctreeFrame.h"
#include "Octree/BoxMap.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

/// Margins in edges: these factors times the square root of the speed, in limits.
constexpr double kListFactor = 2.0, kClassFactor = 1.6, kLeastMargin = 0.02, kMostMargin = 1.0;

/// The largest coordinate about the origin of the floats, L.
double reachOf(const Body& body) {
  const Eigen::AlignedBox3d& bounds = body.mesh.now.bounds();
  const Eigen::Vector3d& origin = body.tree.floats().frame().origin;
  return std::max((bounds.min() - origin).cwiseAbs().maxCoeff(),
                  (bounds.max() - origin).cwiseAbs().maxCoeff());
}

Eigen::Vector3d offsetOf(const Body& a, const Body& b) {
  const FloatFrame &from = b.tree.floats().frame(), &to = a.tree.floats().frame();
  return from.scaled(from.origin, to.origin);
}

}  // namespace

KeptReach KeptReach::of(double distance, double speed, double edge) {
  PALPATE_ASSERT(distance >= 0.0 && speed >= 0.0 && edge > 0.0);
  const auto margin = [&](double factor) {
    return edge * std::clamp(factor * std::sqrt(speed / edge), kLeastMargin, kMostMargin);
  };
  return {distance, margin(kListFactor), margin(kClassFactor)};
}

void KeptDetection::start(const Body& a, const Body& b, const KeptReach& reach) {
  PALPATE_ASSERT(reach.distance >= 0.0 && reach.lists >= reach.classes && reach.classes > 0.0);
  m_reach = reach;
  m_scale = a.tree.floats().frame().scale;
  const Eigen::Vector3d offset = offsetOf(a, b);
  const double size = reachOf(a) + reachOf(b) + offset.cwiseAbs().maxCoeff() / m_scale;
  // Each bound of a box is off by less than 2^-21 of it, and so is their difference. Distances of
  // features have errors of doubles.
  m_reach.error =
      0x1p-19 * (size + reach.distance + reach.lists) + OutwardRounding::kAbsolute / m_scale;
  m_floats = {a.tree.floats().now(), b.tree.floats().now(), nullptr, nullptr};
  setShift(m_floats.shiftLower, m_floats.shiftUpper, {offset[0], offset[1], offset[2]},
           reach.distance * m_scale);
  // Floats, offset and two differences have errors of 2^-24 each.
  m_floatError = static_cast<float>(3 * 0x1p-24 * size * m_scale) * (1.0f + 0x1p-20f);
  for (int k = 0; k < 3; ++k) m_offset[k] = static_cast<float>(offset[k]);
  m_trees = treesWithin(a, b, reach.distance + reach.lists);
}

TreePair KeptDetection::treesWithin(const Body& a, const Body& b, double distance) const {
  return treesOf(a, b, distance + m_reach.error + a.tree.lag() + b.tree.lag(), false);
}

void KeptDetection::make(KeptUnit& unit, const NodePair& nodes, const MeshPair& meshes,
                         JobScratch& scratch) const {
  const MemoryScope memory(MemoryStage::Pairs);
  unit.movedSinceLists = std::numeric_limits<double>::infinity();
  scratch.sink.start(nullptr, nullptr);
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

void KeptDetection::sort(KeptUnit& unit, const MeshPair& meshes, std::span<const ElementPair> pairs,
                         JobScratch& scratch) const {
  const MemoryScope memory(MemoryStage::Pairs);
  constexpr int kClasses = KeptUnit::kClasses;
  Buffer<float>& bounds = scratch.bounds;
  bounds.resize(pairs.size());
  const FloatMeshes floats{meshes.a.topology, meshes.b.topology, m_floats.a,
                           m_floats.b,        m_offset,          m_floatError};
  featureBounds(floats, pairs, bounds.data());
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

/// Features of pairs of class i were further apart than i parts of the margin more than the
/// distance asked for then.
std::span<const ElementPair> KeptDetection::nearOf(const KeptUnit& unit) const {
  const KeptReach& then = unit.atClasses;
  const double reached = m_reach.distance + unit.movedSinceClasses + m_reach.error + then.error;
  constexpr int kClasses = KeptUnit::kClasses;
  int last = 0;
  while (last + 1 < kClasses && !(reached < then.distance + (last + 1) * then.classes / kClasses))
    ++last;
  return std::span(unit.near).first(unit.ends[last]);
}

/// The comparison of PairWalk, with the boxes of triangleBoxes().
bool KeptDetection::overlap(const Triangle& a, const Triangle& b) const {
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

}  // namespace palpate
