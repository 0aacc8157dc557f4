#include "Bodies/GeometryOctree.h"

#include "Mesh/TriangleBoxes.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

namespace palpate {

namespace {

constexpr std::size_t kGrain = 1024;
constexpr std::size_t kTrianglesPerGroup = 1024;  ///< for bounds(), before there are nodes
constexpr std::size_t kGroupGrain = 128;
constexpr std::size_t kElementsPerSlice = 64, kMostSlices = 4096;

constexpr std::uint32_t kNoGroup = 0xffffffffu;

void computeFloats(std::span<const Eigen::Vector3d> positions, const FloatFrame& frame,
                   Buffer<FloatPoint>& floats, const Threads& threads) {
  resizeSparingly(floats, positions.size());
  threads.forChunks(positions.size(), kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
    toFloats(positions.subspan(from, to - from), frame, floats.data() + from);
  });
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
  if (settings.update != OctreeUpdate::Auto || !m_isBuilt || m_isLoose || m_swept || m_treeSwept ||
      mesh.now.isPlaced() || m_frame.scale != scale)
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
  if (strategy != Strategy::Whole && m_slicesLayout != m_octree.layout()) makeSlices(mesh);
  if (keepsOrder && last.topology != topology)
    keepsOrder = settings.update == OctreeUpdate::Auto &&
                 replaceElements(mesh, settings, strategy != Strategy::Whole);
  if (!keepsOrder) strategy = Strategy::Whole;
  m_removed.clear();
  m_elements = mesh.topology.elements.size();
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
  if (m_isBuilt && !isLargeCut(m_removed.size() + removed, m_ordered.size()))
    reserveAmortized(m_removed, m_removed.size() + removed);
}

void GeometryOctree::cut(std::span<const std::uint32_t> removed,
                         std::span<const std::pair<Revision, Revision>> positions) noexcept {
  if (!m_isBuilt) return;
  if (isLargeCut(m_removed.size() + removed.size(), m_ordered.size())) return forgetElements();
  m_removed.insert(m_removed.end(), removed.begin(), removed.end());
  const auto appended =
      std::find_if(positions.begin(), positions.end(),
                   [&](const auto& revisions) { return revisions.first == m_lastPositions; });
  if (appended != positions.end()) m_lastPositions = appended->second;
}

/// Makes m_groupOf for the present layout.
void GeometryOctree::findGroups() {
  if (m_groupsLayout == m_octree.layout()) return;
  m_groupsLayout = 0;
  m_groupOf.reserve(withSpare(m_elements));
  m_groupOf.assign(m_elements, kNoGroup);
  const auto order = m_octree.order(), groups = m_octree.groups();
  for (std::uint32_t g = 0; g + 1 < groups.size(); ++g)
    for (std::uint32_t i = groups[g]; i < groups[g + 1]; ++i) m_groupOf[order[i]] = g;
  m_groupsLayout = m_octree.layout();
}

/// Removes elements that cuts removed, and lets others that they added join groups that are near.
/// Returns false, so that the tree must be built anew, if these are many, or if a group would
/// become too full. keepsBoxes: as of Octree::replace(); slices of such groups are then due.
bool GeometryOctree::replaceElements(const TriangleMesh& mesh, const OctreeSettings& settings,
                                     bool keepsBoxes) {
  const MeshTopology& topology = mesh.topology;
  const std::size_t added = topology.elements.size() - m_elements;
  if (isLargeCut(m_removed.size() + added, m_ordered.size()) || 2 * m_replaced > m_ordered.size())
    return false;
  findGroups();
  const std::uint64_t before = m_groupsLayout;
  const bool hasSlices = m_slicesLayout == before;
  m_groupsLayout = m_slicesLayout = m_cut.before = m_cut.after = 0;
  const auto groups = m_octree.groups();
  CountedVector<std::uint32_t>& changed = m_cut.groups;
  changed.clear();
  for (const std::uint32_t id : m_removed)  // also those that were added since the last update
    if (id < m_elements) changed.push_back(std::exchange(m_groupOf[id], kNoGroup));
  sortUnique(changed);
  CountedVector<std::uint32_t> places;
  CountedVector<std::uint32_t> vertices;  // of elements that left or joined
  const auto addVertices = [&](const Triangle& corners) {
    vertices.insert(vertices.end(), corners.begin(), corners.end());
  };
  for (const std::uint32_t group : changed)
    for (std::uint32_t i = groups[group]; i < groups[group + 1]; ++i)
      if (m_groupOf[m_octree.order()[i]] == kNoGroup) {
        places.push_back(i);
        addVertices(m_ordered[i]);
      }

  CountedVector<Octree::Joining> joining;
  for (auto id = static_cast<std::uint32_t>(m_elements); id < topology.elements.size(); ++id) {
    if (topology.isRemoved(id)) continue;
    FloatBox box;
    for (const std::uint32_t vertex : topology.elements[id]) {
      const FloatPoint p = m_frame(mesh.now.body()[vertex]);
      box.add(FloatBox{{p.x, p.y, p.z, 0}, {p.x, p.y, p.z, 0}});
    }
    joining.push_back({m_octree.groupNear(box), id});
    addVertices(topology.elements[id]);
  }
  std::sort(joining.begin(), joining.end(), [](const auto& a, const auto& b) {
    return std::pair(a.group, a.element) < std::pair(b.group, b.element);
  });
  for (auto first = joining.begin(); first != joining.end();) {
    const std::uint32_t group = first->group, size = groups[group + 1] - groups[group];
    const auto last =
        std::find_if(first, joining.end(), [=](const auto& one) { return one.group != group; });
    const auto place = [&](std::uint32_t of) {
      return std::lower_bound(places.begin(), places.end(), of);
    };
    const auto joined = last - first, left = place(groups[group + 1]) - place(groups[group]);
    if (joined > left &&
        size + joined - left > std::max<std::int64_t>(size, 2 * settings.maxElementsPerLeaf))
      return false;
    changed.push_back(group);
    first = last;
  }
  sortUnique(changed);
  reserveAmortized(m_groupOf, topology.elements.size());
  m_groupOf.resize(topology.elements.size(), kNoGroup);
  for (const auto& [group, element] : joining) m_groupOf[element] = group;
  if (!changed.empty()) {
    const auto moves = m_octree.replace(places, joining, keepsBoxes);
    orderElements(topology, moves, joining);
    m_replaced += places.size() + joining.size();
  }
  if (hasSlices) {
    findPiecesAgain(
        m_slicePieces, changed, topology.vertexCount,
        [&](std::size_t i) { return std::pair(m_slices[i].firstGroup, m_slices[i].endGroup); },
        [&](std::size_t i) { m_slices[i].moved = std::numeric_limits<double>::infinity(); });
    m_slicesLayout = m_octree.layout();
  }
  sortUnique(vertices);
  for (const std::uint32_t vertex : vertices)
    for (const std::uint32_t element : topology.vertexTriangles[vertex])
      if (const std::uint32_t group = m_groupOf[element];
          changed.empty() || group != changed.back())
        changed.push_back(group);
  sortUnique(changed);
  m_cut.before = before;
  m_groupsLayout = m_cut.after = m_octree.layout();
  return true;
}

/// Brings m_ordered into the octree's order after Octree::replace().
void GeometryOctree::orderElements(const MeshTopology& topology,
                                   std::span<const Octree::Move> moves,
                                   std::span<const Octree::Joining> joining) {
  const std::size_t size = m_octree.size(),
                    most = std::max(size, m_ordered.size()) + BoxArrays::kPadding;
  const std::span<Triangle> ordered = m_orderedMemory.resized(m_ordered, most);
  const auto order = m_octree.order(), groups = m_octree.groups();
  const auto fill = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) m_ordered[i] = topology.elements[order[i]];
  };
  if (ordered.empty()) {
    startOrdered(size);
    return fill(0, size);
  }
  Octree::move(ordered.data(), moves);
  m_ordered = ordered.first(size);
  std::uint32_t last = kNoGroup;
  for (const auto& [group, element] : joining)
    if (std::exchange(last, group) != group) fill(groups[group], groups[group + 1]);
}

/// Fits the boxes of all elements. keepsOrder: they are in the octree's order.
void GeometryOctree::fitWhole(const TriangleMesh& mesh, double scale,
                              const OctreeSettings& settings, const Threads& threads,
                              bool keepsOrder) {
  m_frame = m_floatsFrame = {m_sample.median, scale};
  m_spread = m_sample.spread;
  m_treeSwept = m_swept && !mesh.now.hasSameBody(mesh.before);
  Stopwatch watch;
  computeFloats(mesh.now.body(), m_frame, m_floats, threads);
  if (m_treeSwept) computeFloats(mesh.before.body(), m_frame, m_floatsBefore, threads);
  boxMilliseconds += watch.lap();
  const std::size_t size = mesh.topology.count();
  if (size == 0) {
    m_octree.reset(0);
    startOrdered(0);
  } else {
    bool fits = false;
    if (keepsOrder && settings.update == OctreeUpdate::Auto) {
      fitBoxes(mesh, settings, threads, false);
      lastUpdate = LooseOctree::Update::Refitted;
      fits = m_octree.isTight();
    }
    if (!fits) {
      if (!keepsOrder) {
        m_octree.reset(size, mesh.topology.removed);
        startOrdered(size);
        for (std::size_t i = 0; i < size; ++i)
          m_ordered[i] = mesh.topology.elements[m_octree.order()[i]];
      }
      rebuild(mesh, settings, threads);
      fitBoxes(mesh, settings, threads, true);
      lastUpdate = LooseOctree::Update::Rebuilt;
    }
  }
  m_lag = 0.0;
  m_isLoose = false;
  for (Slice& slice : m_slices) slice.moved = 0.0;
  ++m_updates;
}

/// Fits the boxes of slices with vertices that changed, and of slices that a cut changed.
void GeometryOctree::fitChanged(const TriangleMesh& mesh, const Threads& threads) {
  const auto changed = mesh.now.changesSince(m_lastPositions);
  PALPATE_ASSERT(changed.has_value());
  Stopwatch watch;
  const auto convert = [&](std::size_t begin, std::size_t end) {
    threads.forChunks(end - begin, kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
      toFloats(mesh.now.body().subspan(begin + from, to - from), m_frame,
               m_floats.data() + begin + from);
    });
  };
  const std::size_t known = m_floats.size(), size = mesh.now.size();
  PALPATE_ASSERT(known <= size);
  if (m_floats.capacity() < size) m_floats.reserve(withSpare(size));
  m_floats.resize(size);
  convert(changed->begin, changed->end);
  convert(known, size);
  for (std::size_t i = 0; i < m_slices.size(); ++i) {
    const auto pieces = m_slicePieces[i];
    if (m_slices[i].moved == 0.0 &&
        std::none_of(pieces.begin(), pieces.end(), [&](std::uint32_t piece) {
          return changed->overlaps(
              {piece * PieceMotion::kPiece, (piece + 1) * PieceMotion::kPiece});
        }))
      continue;
    m_slices[i].moved = std::numeric_limits<double>::infinity();
    refit(mesh, i);
    ++m_refitted;
  }
  if (m_refitted >= m_slices.size()) measureLooseness();
  lastUpdate = LooseOctree::Update::Refitted;
  ++m_updates;
  boxMilliseconds += watch.lap();
}

/// After all slices were fitted. A tree that became loose is built again by the next update.
void GeometryOctree::measureLooseness() {
  m_refitted = 0;
  m_octree.addAreas();
  m_octree.measureLooseness();
  m_isLoose = !m_octree.isTight();
}

void GeometryOctree::makeSlices(const TriangleMesh& mesh) {
  const auto groups = m_octree.groups();
  const std::size_t wanted =
      std::max(kElementsPerSlice, (m_ordered.size() + kMostSlices - 1) / kMostSlices);
  m_slicesLayout = 0;
  m_slices.clear();
  m_nextSlice = 0;
  CountedVector<std::pair<std::uint32_t, std::uint32_t>> ranges;
  for (std::uint32_t group = 0; group + 1 < groups.size();) {
    const std::uint32_t first = group;
    while (group + 1 < groups.size() && groups[group] - groups[first] < wanted) ++group;
    m_slices.push_back({first, group, 0.0});
    ranges.push_back({groups[first], groups[group]});
  }
  m_slicePieces = piecesOf(m_ordered, ranges, mesh.topology.vertexCount);
  m_slicesLayout = m_octree.layout();
}

/// Brings the floats up to date, and fits the boxes of some slices.
void GeometryOctree::fitLagging(const TriangleMesh& mesh, const Lag& allowed,
                                const Threads& threads) {
  const double lag = allowed.most;
  PALPATE_ASSERT(!m_treeSwept && lag > 0.0);
  Stopwatch watch;
  m_floatsFrame = {m_sample.median, m_frame.scale};
  computeFloats(mesh.now.body(), m_floatsFrame, m_floats, threads);
  double share = 0.0;  // of the slices that should be fitted now
  for (std::size_t i = 0; i < m_slices.size(); ++i) {
    const MotionRange range = allowed.motion->of(m_slicePieces[i]);
    const double step = range.lower.cwiseAbs().cwiseMax(range.upper.cwiseAbs()).maxCoeff();
    // The rounding of the displacements, and of this sum.
    m_slices[i].moved = (m_slices[i].moved + step) * (1.0 + 0x1p-50);
    share += step;
  }
  const std::size_t size = m_slices.size(), wanted = share < lag * static_cast<double>(size)
                                                         ? static_cast<std::size_t>(share / lag) + 1
                                                         : size;
  std::size_t fitted = 0;
  for (std::size_t i = 0; i < size && fitted < wanted; ++i) {
    fitted += m_slices[m_nextSlice].moved > 0.0;
    refit(mesh, m_nextSlice);
    if (++m_nextSlice == size) {
      m_nextSlice = 0;
      measureLooseness();
    }
  }
  m_lag = 0.0;
  for (std::size_t i = 0; i < size; ++i) {
    if (m_slices[i].moved > lag) {
      refit(mesh, i);
      ++fitted;
    }
    m_lag = std::max(m_lag, m_slices[i].moved);
  }
  if (fitted > 0) {
    lastUpdate = LooseOctree::Update::Refitted;
    ++m_updates;
  }
  boxMilliseconds += watch.lap();
}

/// Fits the boxes of a slice, unless its elements did not move.
void GeometryOctree::refit(const TriangleMesh& mesh, std::size_t index) {
  Slice& slice = m_slices[index];
  if (slice.moved == 0.0) return;
  const auto groups =
      m_octree.groups().subspan(slice.firstGroup, slice.endGroup - slice.firstGroup + 1);
  const std::uint32_t begin = groups.front(), count = groups.back() - begin;
  m_corners.resize(3 * std::size_t{count});
  m_cornerFloats.resize(3 * std::size_t{count});
  m_cornerTriangles.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    for (std::uint32_t c = 0; c < 3; ++c)
      m_corners[3 * i + c] = mesh.now.body()[m_ordered[begin + i][c]];
    m_cornerTriangles[i] = {3 * i, 3 * i + 1, 3 * i + 2};
  }
  toFloats(m_corners, m_frame, m_cornerFloats.data());
  triangleBoxes(m_cornerFloats.data(), nullptr, m_cornerTriangles.data(), groups, m_octree.boxes(),
                m_octree.groupBoxes() + slice.firstGroup);
  m_octree.refit(slice.firstGroup, slice.endGroup);
  slice.moved = 0.0;
}

double GeometryOctree::reach() const {
  PALPATE_ASSERT(m_octree.isBuilt());
  return m_octree.box(0).reach() / m_frame.scale;
}

bool GeometryOctree::isCompact() const {
  return m_octree.isBuilt() && reach() <= 0x1p20 * m_spread;
}

bool GeometryOctree::needsDops(const TriangleMesh& mesh, OctreeBounds bounds) const {
  return bounds != OctreeBounds::Box && mesh.now.isPlaced() && mesh.now.hasSameBody(mesh.before) &&
         m_octree.dops().directions != directionCount(bounds) && isCompact();
}

/// A bound is rounded outward twice. Each coordinate of a vertex has an error of 2^-53 of it, and
/// the sum of three has two roundings more: together less than 2^-51 of the coordinates' sum, which
/// is doubled. OutwardRounding covers the conversion to float.
void GeometryOctree::updateDops(const TriangleMesh& mesh, OctreeBounds bounds,
                                const Threads& threads) {
  PALPATE_ASSERT(isValid());
  if (!needsDops(mesh, bounds)) return;
  const int count = directionCount(bounds);
  const auto directions = dopDirections(count);
  OctreeDops& dops = m_octree.startDops(count);
  threads.forChunks(m_ordered.size(), kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) {
      std::array<Eigen::Vector3d, 3> corners;
      double size = 0;
      for (int c = 0; c < 3; ++c) {
        corners[c] = (mesh.now.body()[m_ordered[i][c]] - m_frame.origin) * m_frame.scale;
        size = std::max(size, corners[c].cwiseAbs().sum());
      }
      for (int k = 3; k < count; ++k) {
        const Eigen::Map<const Eigen::Vector3d> direction(directions[k].data());
        const auto [lower, upper] = std::minmax(
            {direction.dot(corners[0]), direction.dot(corners[1]), direction.dot(corners[2])});
        const double error = 0x1p-50 * size;
        dops.lower[k][i] = OutwardRounding::down(static_cast<float>(lower - error));
        dops.upper[k][i] = OutwardRounding::up(upper + error);
      }
    }
  });
  m_octree.fitDops(count);
}

void GeometryOctree::copy(const GeometryOctree& other) {
  PALPATE_ASSERT(other.isValid());
  if (isValid() && m_updates == other.m_updates) return;
  const bool isSameLayout = isValid() && m_octree.layout() == other.m_octree.layout();
  m_treeVersion.invalidate();
  m_isBuilt = false;
  m_frame = m_floatsFrame = other.m_frame;
  m_spread = other.m_spread;
  resizeSparingly(m_floats, other.m_floats.size());
  std::copy(other.m_floats.begin(), other.m_floats.end(), m_floats.begin());
  m_octree.copy(other.m_octree);
  if (!isSameLayout) {
    startOrdered(other.m_ordered.size());
    std::copy(other.m_ordered.begin(), other.m_ordered.end(), m_ordered.begin());
  }
  m_updates = other.m_updates;
  m_treeVersion.commit(other.m_treeVersion.state());
}

void GeometryOctree::releaseMemory() {
  m_stars = {};
  m_groupOf = {};
  m_groupsLayout = 0;
  m_corners = {};
  m_cornerFloats = {};
  m_cornerTriangles = {};
  m_boundsGroups = Buffer<std::uint32_t>();
  m_boundsBoxes = Buffer<FloatBox>();
  if (!m_treeSwept) m_floatsBefore.clear();
  releaseSpare(m_floats);
  releaseSpare(m_floatsBefore);
  if (m_ordered.empty())
    m_orderedMemory.release();
  else
    m_ordered =
        m_orderedMemory.shrink(std::span(m_ordered.data(), m_ordered.size() + BoxArrays::kPadding))
            .first(m_ordered.size());
  m_octree.releaseMemory();
}

/// Computes the boxes of the triangles in m_ordered, and those of the groups. reordered: first
/// brings m_ordered into the octree's order.
void GeometryOctree::computeBoxes(const TriangleMesh& mesh, std::span<const std::uint32_t> groups,
                                  FloatBox* groupBoxes, std::size_t grain, const Threads& threads,
                                  bool reordered) {
  PALPATE_ASSERT(groups.front() == 0 && groups.back() == m_ordered.size());
  const CountedVector<Triangle>& triangles = mesh.topology.elements;
  threads.forChunks(groups.size() - 1, grain, [&](std::size_t, std::size_t from, std::size_t to) {
    for (std::size_t i = groups[from]; reordered && i < groups[to]; ++i)
      m_ordered[i] = triangles[m_octree.order()[i]];
    triangleBoxes(m_floats.data(), m_treeSwept ? m_floatsBefore.data() : nullptr,
                  m_ordered.data() + groups[from], groups.subspan(from, to - from + 1),
                  m_octree.boxes(), groupBoxes + from);
  });
}

/// Computes the boxes of the triangles in m_ordered, and returns the bounds of all.
FloatBox GeometryOctree::bounds(const TriangleMesh& mesh, const Threads& threads) {
  PALPATE_ASSERT(m_ordered.size() == mesh.topology.count());
  const std::size_t size = m_ordered.size(),
                    count = (size + kTrianglesPerGroup - 1) / kTrianglesPerGroup;
  m_boundsGroups.resize(count + 1);
  for (std::size_t i = 0; i <= count; ++i)
    m_boundsGroups[i] = static_cast<std::uint32_t>(std::min(i * kTrianglesPerGroup, size));
  m_boundsBoxes.resize(count);
  computeBoxes(mesh, m_boundsGroups, m_boundsBoxes.data(), 2, threads, false);
  FloatBox all;
  for (const FloatBox& box : m_boundsBoxes) all.add(box);
  return all;
}

/// Starts m_ordered in memory that may have held keys. Its values are indeterminate.
void GeometryOctree::startOrdered(std::size_t size) {
  m_ordered = {};
  const std::size_t padded = size + BoxArrays::kPadding;
  m_orderedMemory.reserve(withSpare(padded) * sizeof(Triangle));
  m_ordered = m_orderedMemory.start<Triangle>(padded).first(size);
}

void GeometryOctree::rebuild(const TriangleMesh& mesh, const OctreeSettings& settings,
                             const Threads& threads) {
  Stopwatch watch;
  const FloatBox all = bounds(mesh, threads);
  boxMilliseconds += watch.lap();
  // Triangles in the old order are no longer needed. The keys use their memory.
  const std::size_t size = m_ordered.size();
  m_ordered = {};
  const auto keys = m_orderedMemory.start<std::uint64_t>(size);
  m_octree.build(all, m_spread * m_frame.scale, settings, keys, threads);
  m_replaced = 0;
  startOrdered(size);
  octreeMilliseconds += watch.lap();
}

void GeometryOctree::fitBoxes(const TriangleMesh& mesh, const OctreeSettings& settings,
                              const Threads& threads, bool rebuilt) {
  Stopwatch watch;
  computeBoxes(mesh, m_octree.groups(), m_octree.groupBoxes(), kGroupGrain, threads, rebuilt);
  boxMilliseconds += watch.lap();
  m_octree.fit(threads);
  if (settings.update == OctreeUpdate::Auto) m_octree.measureLooseness();
  octreeMilliseconds += watch.lap();
}

const Triangle* GeometryOctree::findUnfoldedStars(const TriangleMesh& mesh,
                                                  const Threads& threads) {
  PALPATE_ASSERT(isValid() && m_ordered.size() == mesh.topology.count());
  const MemoryScope memory(MemoryStage::Octrees);
  m_stars.find(mesh.topology, m_octree.order(), m_ordered, floatsAtStart(), m_floats.data(),
               threads);
  return m_stars.triangles();
}

std::size_t GeometryOctree::bytesBesidesOctree() const {
  return (m_floats.capacity() + m_floatsBefore.capacity()) * sizeof(FloatPoint) +
         (m_groupOf.capacity() + m_removed.capacity()) * sizeof(std::uint32_t) +
         m_orderedMemory.bytes() + m_slices.capacity() * sizeof(Slice) + m_slicePieces.bytes();
}

}  // namespace palpate
