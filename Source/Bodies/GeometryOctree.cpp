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

void GeometryOctree::update(const TriangleMesh& mesh, Revision topology, double scale,
                            const OctreeSettings& settings, const Threads& threads) {
  PALPATE_ASSERT(scale > 0.0);
  const State now = stateOf(mesh, topology);
  const bool isSameTopology = m_treeVersion.state().topology == topology;
  bool canRefit = m_isBuilt && isSameTopology;
  const bool isCut = m_isBuilt && !isSameTopology && settings.update == OctreeUpdate::Auto;
  m_treeVersion.invalidate();
  m_isBuilt = m_isLagging = false;
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
    if (isCut) canRefit = replaceElements(mesh.topology, settings);
    if (canRefit && settings.update == OctreeUpdate::Auto) {
      fitBoxes(mesh, settings, threads, false);
      lastUpdate = LooseOctree::Update::Refitted;
      fits = m_octree.isTight();
    }
    if (!fits) {
      if (!canRefit) {
        m_octree.reset(size, mesh.topology.removed);
        startOrdered(size);
        for (std::size_t i = 0; i < size; ++i)
          m_ordered[i] = mesh.topology.elements[m_octree.order()[i]];
      }
      rebuild(mesh, settings, threads);
      fitBoxes(mesh, settings, threads, true);
      lastUpdate = LooseOctree::Update::Rebuilt;
    }
    m_isBuilt = true;
  }
  m_lag = 0.0;
  m_isLoose = false;
  for (Slice& slice : m_slices) slice.moved = 0.0;
  m_lastPositions = mesh.now.bodyRevision();
  ++m_updates;
  m_treeVersion.commit(now);
}

/// Removes elements that a cut removed. Each element that it added joins the group of the nearest
/// of those, by the sums of their corners. Returns false, and changes nothing, if a group would
/// become empty or too full, or if the cut is so large that a rebuild costs less.
bool GeometryOctree::replaceElements(const MeshTopology& topology, const OctreeSettings& settings) {
  constexpr std::size_t kLargeCut = 4096;
  constexpr std::uint32_t kNoGroup = 0xffffffffu;
  const auto order = m_octree.order();
  const auto groups = m_octree.groups();
  if (order.empty()) return false;
  if (m_groupsLayout != m_octree.layout()) {
    m_groupsLayout = 0;
    const std::size_t count = *std::max_element(order.begin(), order.end()) + std::size_t{1};
    m_groupOf.reserve(withSpare(count));
    m_groupOf.assign(count, kNoGroup);
    for (std::uint32_t g = 0; g + 1 < groups.size(); ++g)
      for (std::uint32_t i = groups[g]; i < groups[g + 1]; ++i) m_groupOf[order[i]] = g;
    m_groupsLayout = m_octree.layout();
  }
  const auto firstAdded = static_cast<std::uint32_t>(m_groupOf.size());
  struct Gone {
    std::uint32_t place, group;
    Triangle corners;
    std::array<float, 3> sum;
  };
  const auto sumOf = [&](const Triangle& t) {
    const FloatPoint &a = m_floats[t[0]], &b = m_floats[t[1]], &c = m_floats[t[2]];
    return std::array{a.x + b.x + c.x, a.y + b.y + c.y, a.z + b.z + c.z};
  };
  CountedVector<Gone> gone;
  for (const std::uint32_t id : topology.removed) {
    if (id >= firstAdded || m_groupOf[id] == kNoGroup) continue;
    const std::uint32_t group = m_groupOf[id];
    const auto place = static_cast<std::uint32_t>(
        std::find(order.begin() + groups[group], order.begin() + groups[group + 1], id) -
        order.begin());
    gone.push_back({place, group, m_ordered[place], sumOf(m_ordered[place])});
  }
  std::sort(gone.begin(), gone.end(),
            [](const Gone& l, const Gone& r) { return l.place < r.place; });
  const std::size_t added = topology.elements.size() - firstAdded;
  if (gone.empty() || gone.size() * std::max<std::size_t>(1, added) > kLargeCut + order.size())
    return false;
  CountedVector<Octree::Joining> joining;
  for (std::uint32_t id = firstAdded; id < topology.elements.size(); ++id) {
    if (topology.isRemoved(id)) continue;
    const auto sum = sumOf(topology.elements[id]);
    std::uint32_t nearest = kNoGroup;
    float least = std::numeric_limits<float>::infinity();
    for (const Gone& one : gone) {
      float squared = 0;
      for (std::size_t k = 0; k < 3; ++k) squared += (one.sum[k] - sum[k]) * (one.sum[k] - sum[k]);
      if (squared < least || nearest == kNoGroup) least = squared, nearest = one.group;
    }
    joining.push_back({nearest, id});
  }
  std::sort(joining.begin(), joining.end(), [](const auto& a, const auto& b) {
    return std::pair(a.group, a.element) < std::pair(b.group, b.element);
  });
  CountedVector<std::uint32_t> places;
  const auto fits = [&](std::uint32_t group) {
    const auto countIn = [&](const auto& list) {
      return std::count_if(list.begin(), list.end(),
                           [&](const auto& one) { return one.group == group; });
    };
    const std::int64_t size =
        std::int64_t{groups[group + 1]} - groups[group] - countIn(gone) + countIn(joining);
    return size >= 1 && size <= 2 * std::int64_t{settings.maxElementsPerLeaf};
  };
  for (std::size_t i = 0; i < gone.size(); ++i) {
    if ((i == 0 || gone[i].group != gone[i - 1].group) && !fits(gone[i].group)) return false;
    places.push_back(gone[i].place);
  }
  reserveAmortized(m_groupOf, topology.elements.size());
  // Nothing below throws, but for want of memory: the next update then builds the octree anew.
  const std::uint64_t before = m_octree.layout();
  const bool hasSlices = m_slicesLayout == before;
  m_groupsLayout = m_slicesLayout = m_cut.before = m_cut.after = 0;
  const auto moves = m_octree.replace(places, joining);
  const std::size_t size = m_octree.size(), padded = size + BoxArrays::kPadding;
  const std::span<Triangle> ordered =
      m_orderedMemory.resized(m_ordered, std::max(padded, m_ordered.size() + BoxArrays::kPadding));
  if (ordered.empty()) {
    startOrdered(size);
    for (std::size_t i = 0; i < size; ++i) m_ordered[i] = topology.elements[m_octree.order()[i]];
  } else {
    Octree::move(ordered.data(), moves);
    m_ordered = ordered.first(size);
    for (const auto& [group, element] : joining)
      for (std::uint32_t i = groups[group]; i < groups[group + 1]; ++i)
        m_ordered[i] = topology.elements[m_octree.order()[i]];
  }
  m_groupOf.resize(topology.elements.size(), kNoGroup);
  for (const std::uint32_t id : topology.removed) m_groupOf[id] = kNoGroup;
  for (const auto& [group, element] : joining) m_groupOf[element] = group;
  m_groupsLayout = m_octree.layout();

  CountedVector<std::uint32_t>& changed = m_cut.groups;
  changed.clear();
  for (const Gone& one : gone) changed.push_back(one.group);
  for (const auto& [group, element] : joining) changed.push_back(group);
  const auto sortChanged = [&] {
    std::sort(changed.begin(), changed.end());
    changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  };
  sortChanged();
  if (hasSlices) {
    const auto rangeOf = [&](std::size_t slice) {
      return std::pair(groups[m_slices[slice].firstGroup], groups[m_slices[slice].endGroup]);
    };
    findPiecesAgain(m_slicePieces, changed, topology.vertexCount, rangeOf, [](std::size_t) {});
    m_slicesLayout = m_octree.layout();
  }
  const auto addAround = [&](const Triangle& corners) {
    for (const std::uint32_t vertex : corners)
      for (const std::uint32_t element : topology.vertexTriangles[vertex])
        changed.push_back(m_groupOf[element]);
  };
  for (const Gone& one : gone) addAround(one.corners);
  for (const auto& [group, element] : joining) addAround(topology.elements[element]);
  sortChanged();
  m_cut.before = before;
  m_cut.after = m_octree.layout();
  return true;
}

bool GeometryOctree::canRefitSome(const TriangleMesh& mesh, Revision topology, double scale,
                                  const OctreeSettings& settings) const {
  return settings.update == OctreeUpdate::Auto && isValid() && m_isBuilt && !m_isLoose &&
         !m_swept && !m_treeSwept && !mesh.now.isPlaced() &&
         m_treeVersion.state().topology == topology && m_frame.scale == scale;
}

bool GeometryOctree::canLag(const TriangleMesh& mesh, Revision topology, double scale,
                            const OctreeSettings& settings, const PieceMotion& motion) const {
  return canRefitSome(mesh, topology, scale, settings) && m_lastPositions == motion.from() &&
         mesh.now.bodyRevision() == motion.to();
}

bool GeometryOctree::updateChanged(const TriangleMesh& mesh, Revision topology, double scale,
                                   const OctreeSettings& settings, const Threads& threads) {
  constexpr std::size_t kFew = 8;  // Few are at most one vertex in this many.
  const auto changed = mesh.now.changesSince(m_lastPositions);
  if (m_isLagging || !canRefitSome(mesh, topology, scale, settings) || !changed ||
      changed->size() * kFew > mesh.now.size())
    return false;
  const State now = stateOf(mesh, topology);
  m_treeVersion.invalidate();
  Stopwatch watch;
  threads.forChunks(changed->size(), kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
    toFloats(mesh.now.body().subspan(changed->begin + from, to - from), m_frame,
             m_floats.data() + changed->begin + from);
  });
  if (m_slicesLayout != m_octree.layout()) makeSlices(mesh);
  for (std::size_t i = 0; i < m_slices.size(); ++i) {
    const auto pieces = m_slicePieces[i];
    if (std::none_of(pieces.begin(), pieces.end(), [&](std::uint32_t piece) {
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
  m_lastPositions = mesh.now.bodyRevision();
  m_treeVersion.commit(now);
  return true;
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

void GeometryOctree::updateSome(const TriangleMesh& mesh, const PieceMotion& motion, double lag,
                                const Threads& threads) {
  PALPATE_ASSERT(isValid() && m_isBuilt && !m_treeSwept && lag >= 0.0);
  const State state = m_treeVersion.state();
  m_treeVersion.invalidate();
  m_isLagging = true;
  Stopwatch watch;
  m_floatsFrame = {m_sample.median, m_frame.scale};
  computeFloats(mesh.now.body(), m_floatsFrame, m_floats, threads);
  if (m_slicesLayout != m_octree.layout()) makeSlices(mesh);
  double share = 0.0;  // of the slices that should be fitted now
  for (std::size_t i = 0; i < m_slices.size(); ++i) {
    const MotionRange range = motion.of(m_slicePieces[i]);
    const double step = range.lower.cwiseAbs().cwiseMax(range.upper.cwiseAbs()).maxCoeff();
    // The rounding of the displacements, and of this sum.
    m_slices[i].moved = (m_slices[i].moved + step) * (1.0 + 0x1p-50);
    share += step;
  }
  const std::size_t size = m_slices.size(),
                    wanted = lag > 0.0 && share < lag * static_cast<double>(size)
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
  m_lastPositions = mesh.now.bodyRevision();
  m_treeVersion.commit(state);
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
  m_stars.find(mesh.topology, m_ordered, floatsAtStart(), m_floats.data(), threads);
  return m_stars.triangles();
}

std::size_t GeometryOctree::bytesBesidesOctree() const {
  return (m_floats.capacity() + m_floatsBefore.capacity()) * sizeof(FloatPoint) +
         m_groupOf.capacity() * sizeof(std::uint32_t) + m_orderedMemory.bytes() +
         m_slices.capacity() * sizeof(Slice) + m_slicePieces.bytes();
}

}  // namespace palpate
