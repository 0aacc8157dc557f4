#include "Bodies/GeometryOctree.h"

#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <array>
#include <utility>

namespace palpate {

namespace {

/// Sets the bounds of the element at a place, from direction 3 on; the first three are its box.
/// A bound is rounded outward twice. Each coordinate of a vertex has an error of 2^-53 of it, and
/// the sum of three has two roundings more: together less than 2^-51 of the coordinates' sum, which
/// is doubled. OutwardRounding covers the conversion to float.
void setDop(std::span<const Eigen::Vector3d> positions, const Triangle& element,
            const FloatFrame& frame, int count, std::size_t place, OctreeDops& dops) {
  const auto directions = dopDirections(count);
  std::array<Eigen::Vector3d, 3> corners;
  double size = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    corners[c] = (positions[element[c]] - frame.origin) * frame.scale;
    size = std::max(size, corners[c].cwiseAbs().sum());
  }
  for (int k = 3; k < count; ++k) {
    const Eigen::Map<const Eigen::Vector3d> direction(directions[k].data());
    const auto [lower, upper] = std::minmax(
        {direction.dot(corners[0]), direction.dot(corners[1]), direction.dot(corners[2])});
    const double error = 0x1p-50 * size;
    dops.lower[k][place] = OutwardRounding::down(static_cast<float>(lower - error));
    dops.upper[k][place] = OutwardRounding::up(upper + error);
  }
}

}  // namespace

GeometryOctree::State GeometryOctree::stateOf(const TriangleMesh& mesh, Revision topology) const {
  // Without motion, boxes over the step equal those at its end, and both have the same state.
  const Positions& before = m_swept ? mesh.before : mesh.now;
  return {topology, mesh.now.bodyRevision(), before.bodyRevision()};
}

bool GeometryOctree::isCurrent(const TriangleMesh& mesh, Revision topology, double scale) const {
  return !m_isLagging && m_treeVersion.isCurrent(stateOf(mesh, topology)) && m_frame.scale == scale;
}

bool GeometryOctree::encloses(const TriangleMesh& mesh, Revision topology) const {
  return !m_isLagging && m_treeVersion.isValid() && m_isBuilt &&
         m_treeVersion.state().topology == topology &&
         m_treeVersion.state().now == mesh.now.bodyRevision();
}

double GeometryOctree::sampleFrame(const TriangleMesh& mesh, Revision topology) {
  if (m_isLagging || !m_treeVersion.isCurrent(stateOf(mesh, topology)))
    m_sample = sampleExtent(mesh.now.body());
  return m_sample.spread;
}

GeometryOctree::Strategy GeometryOctree::strategyFor(const TriangleMesh& mesh, double scale,
                                                     const OctreeSettings& settings,
                                                     const Lag& lag) const {
  constexpr std::size_t kFew = 8;  // Few are at most one vertex in this many.
  if (settings.update != OctreeUpdate::Auto || !m_isBuilt || m_slices.isLoose() || m_swept ||
      m_floats.isSwept() || mesh.now.isPlaced() || m_frame.scale != scale)
    return Strategy::Whole;
  const auto changed = mesh.now.changesSince(m_lastPositions);
  if (!m_isLagging && changed && changed->size() * kFew <= mesh.now.size())
    return Strategy::Changed;
  const bool mayLag = lag.motion && m_lastPositions == lag.motion->from() &&
                      mesh.now.bodyRevision() == lag.motion->to();
  return mayLag ? Strategy::Lagging : Strategy::Whole;
}

void GeometryOctree::update(const TriangleMesh& mesh, Revision topology, double scale,
                            const OctreeSettings& settings, const Threads& threads,
                            const Lag& lag) {
  PALPATE_ASSERT(scale > 0.0);
  Strategy strategy = strategyFor(mesh, scale, settings, lag);
  const State last = m_treeVersion.state();
  bool keepsOrder = m_isBuilt;
  m_treeVersion.invalidate();
  m_isBuilt = false;
  if (strategy != Strategy::Whole) m_slices.make(sliced(mesh));
  if (keepsOrder && last.topology != topology)
    keepsOrder = settings.update == OctreeUpdate::Auto &&
                 m_cuts.apply(mesh, m_frame, settings, strategy != Strategy::Whole, m_octree,
                              m_ordered, m_slices);
  if (!keepsOrder) strategy = Strategy::Whole;
  m_cuts.finish(mesh.topology);
  State now = stateOf(mesh, topology);
  m_isLagging = strategy == Strategy::Lagging;
  switch (strategy) {
    case Strategy::Whole:
      fitWhole(mesh, scale, settings, threads, keepsOrder);
      break;
    case Strategy::Changed:
      fitChanged(mesh, threads);
      break;
    case Strategy::Lagging:
      fitLagging(mesh, lag, threads);
      now = {topology, last.now, last.before};
      break;
  }
  m_lastPositions = mesh.now.bodyRevision();
  m_isBuilt = mesh.topology.count() > 0;
  m_treeVersion.commit(now);
}

void GeometryOctree::reserveCut(std::size_t removed) {
  if (m_isBuilt && !m_cuts.isLarge(removed, m_ordered)) m_cuts.reserve(removed);
}

void GeometryOctree::cut(std::span<const std::uint32_t> removed,
                         std::span<const std::pair<Revision, Revision>> positions) noexcept {
  if (!m_isBuilt) return;
  if (m_cuts.isLarge(removed.size(), m_ordered)) return forgetElements();
  m_cuts.add(removed);
  const auto appended =
      std::find_if(positions.begin(), positions.end(),
                   [&](const auto& revisions) { return revisions.first == m_lastPositions; });
  if (appended != positions.end()) m_lastPositions = appended->second;
}

/// Fits the boxes of all elements. keepsOrder: they are in the octree's order.
void GeometryOctree::fitWhole(const TriangleMesh& mesh, double scale,
                              const OctreeSettings& settings, const Threads& threads,
                              bool keepsOrder) {
  m_frame = {m_sample.median, scale};
  m_spread = m_sample.spread;
  Stopwatch watch;
  m_floats.set(mesh, m_frame, m_swept && !mesh.now.hasSameBody(mesh.before), threads);
  boxMilliseconds += watch.lap();
  const OrderedElements::Boxes boxes{m_floats, m_octree, boxMilliseconds, octreeMilliseconds};
  const std::size_t size = mesh.topology.count();
  bool fits = size == 0;
  if (!keepsOrder || size == 0) {
    m_octree.reset(size, mesh.topology.removed);
    m_ordered.start(size);
    m_ordered.fill(mesh.topology, m_octree, 0, size);
  } else if (settings.update == OctreeUpdate::Auto) {
    m_ordered.fit(boxes, settings, threads);
    lastUpdate = LooseOctree::Update::Refitted;
    fits = m_octree.isTight();
  }
  if (!fits) {
    m_ordered.build(boxes, m_spread * m_frame.scale, settings, threads);
    m_cuts.setBuilt();
    m_ordered.fit(boxes, settings, threads, &mesh.topology);
    lastUpdate = LooseOctree::Update::Rebuilt;
  }
  m_slices.setFitted();
  ++m_updates;
}

/// Fits the boxes of slices with vertices that changed, and of slices that a cut changed.
void GeometryOctree::fitChanged(const TriangleMesh& mesh, const Threads& threads) {
  const auto changed = mesh.now.changesSince(m_lastPositions);
  PALPATE_ASSERT(changed.has_value());
  Stopwatch watch;
  m_floats.follow(mesh, *changed, threads);
  m_slices.fitChanged(sliced(mesh), *changed);
  lastUpdate = LooseOctree::Update::Refitted;
  ++m_updates;
  boxMilliseconds += watch.lap();
}

/// Brings the floats up to date, and fits the boxes of some slices.
void GeometryOctree::fitLagging(const TriangleMesh& mesh, const Lag& allowed,
                                const Threads& threads) {
  PALPATE_ASSERT(!m_floats.isSwept());
  Stopwatch watch;
  m_floats.set(mesh, {m_sample.median, m_frame.scale}, false, threads);
  if (m_slices.fitLagging(sliced(mesh), *allowed.motion, allowed.most) > 0) {
    lastUpdate = LooseOctree::Update::Refitted;
    ++m_updates;
  }
  boxMilliseconds += watch.lap();
}

bool GeometryOctree::needsDops(const TriangleMesh& mesh, OctreeBounds bounds) const {
  return bounds != OctreeBounds::Box && mesh.now.isPlaced() && mesh.now.hasSameBody(mesh.before) &&
         m_octree.dops().directions != directionCount(bounds) && isCompact();
}

void GeometryOctree::updateDops(const TriangleMesh& mesh, OctreeBounds bounds,
                                const Threads& threads) {
  PALPATE_ASSERT(isValid());
  if (!needsDops(mesh, bounds)) return;
  const int count = directionCount(bounds);
  OctreeDops& dops = m_octree.startDops(count);
  constexpr std::size_t kGrain = 1024;
  threads.forChunks(m_ordered.size(), kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i)
      setDop(mesh.now.body(), ordered()[i], m_frame, count, i, dops);
  });
  m_octree.fitDops(count);
}

void GeometryOctree::copy(const GeometryOctree& other) {
  PALPATE_ASSERT(other.isValid());
  if (isValid() && m_updates == other.m_updates) return;
  const bool isSameLayout = isValid() && m_octree.layout() == other.m_octree.layout();
  m_treeVersion.invalidate();
  m_isBuilt = false;
  m_frame = other.m_frame;
  m_spread = other.m_spread;
  m_floats.copy(other.m_floats);
  m_octree.copy(other.m_octree);
  if (!isSameLayout) {
    m_ordered.start(other.m_ordered.size());
    std::copy(other.ordered().begin(), other.ordered().end(), m_ordered.triangles().begin());
  }
  m_updates = other.m_updates;
  m_treeVersion.commit(other.m_treeVersion.state());
}

void GeometryOctree::releaseMemory() {
  m_stars = {};
  m_cuts.releaseMemory();
  m_slices.releaseMemory();
  m_floats.releaseMemory();
  m_ordered.releaseMemory();
  m_octree.releaseMemory();
}

const Triangle* GeometryOctree::findUnfoldedStars(const TriangleMesh& mesh,
                                                  const Threads& threads) {
  PALPATE_ASSERT(isValid() && m_ordered.size() == mesh.topology.count());
  const MemoryScope memory(MemoryStage::Octrees);
  m_stars.find(mesh.topology, m_octree.order(), ordered(), m_floats.atStart(), m_floats.now(),
               threads);
  return m_stars.triangles();
}

std::size_t GeometryOctree::bytesBesidesOctree() const {
  return m_floats.bytes() + m_cuts.bytes() + m_ordered.bytes() + m_slices.bytes();
}

}  // namespace palpate
