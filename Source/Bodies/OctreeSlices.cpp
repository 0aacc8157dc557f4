#include "Bodies/OctreeSlices.h"

#include "Mesh/TriangleBoxes.h"
#include "Core/Assert.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace palpate {

namespace {

constexpr std::size_t kElementsPerSlice = 64, kMostSlices = 4096;
constexpr double kDue = std::numeric_limits<double>::infinity();

}  // namespace

void OctreeSlices::make(const Tree& tree) {
  if (m_layout == tree.octree.layout()) return;
  const auto groups = tree.octree.groups();
  const std::size_t wanted =
      std::max(kElementsPerSlice, (tree.ordered.size() + kMostSlices - 1) / kMostSlices);
  m_layout = 0;
  m_slices.clear();
  m_next = 0;
  CountedVector<std::pair<std::uint32_t, std::uint32_t>> ranges;
  for (std::uint32_t group = 0; group + 1 < groups.size();) {
    const std::uint32_t first = group;
    while (group + 1 < groups.size() && groups[group] - groups[first] < wanted) ++group;
    m_slices.push_back({first, group, 0.0});
    ranges.push_back({groups[first], groups[group]});
  }
  m_pieces = piecesOf(tree.ordered, ranges, tree.mesh.topology.vertexCount);
  m_layout = tree.octree.layout();
}

void OctreeSlices::follow(const Tree& tree, std::uint64_t before,
                          std::span<const std::uint32_t> changed) {
  if (std::exchange(m_layout, 0) != before) return;
  findPiecesAgain(
      tree.ordered, tree.octree.groups(), changed, tree.mesh.topology.vertexCount, m_pieces,
      [&](std::size_t i) { return std::pair(m_slices[i].firstGroup, m_slices[i].endGroup); },
      [&](std::size_t i) { m_slices[i].moved = kDue; });
  m_layout = tree.octree.layout();
}

void OctreeSlices::setFitted() {
  m_lag = 0.0;
  m_isLoose = false;
  for (Slice& slice : m_slices) slice.moved = 0.0;
}

void OctreeSlices::fitChanged(const Tree& tree, VertexRange changed) {
  for (std::size_t i = 0; i < m_slices.size(); ++i) {
    const auto pieces = m_pieces[i];
    if (m_slices[i].moved == 0.0 &&
        std::none_of(pieces.begin(), pieces.end(), [&](std::uint32_t piece) {
          return changed.overlaps({piece * PieceMotion::kPiece, (piece + 1) * PieceMotion::kPiece});
        }))
      continue;
    m_slices[i].moved = kDue;
    refit(tree, m_slices[i]);
    ++m_refitted;
  }
  if (m_refitted >= m_slices.size()) measureLooseness(tree.octree);
}

std::size_t OctreeSlices::fitLagging(const Tree& tree, const PieceMotion& motion, double most) {
  PALPATE_ASSERT(most > 0.0);
  double share = 0.0;  // of the slices that should be fitted now
  for (std::size_t i = 0; i < m_slices.size(); ++i) {
    const MotionRange range = motion.of(m_pieces[i]);
    const double step = range.lower.cwiseAbs().cwiseMax(range.upper.cwiseAbs()).maxCoeff();
    // The rounding of the displacements, and of this sum.
    m_slices[i].moved = (m_slices[i].moved + step) * (1.0 + 0x1p-50);
    share += step;
  }
  const std::size_t size = m_slices.size(),
                    wanted = share < most * static_cast<double>(size)
                                 ? static_cast<std::size_t>(share / most) + 1
                                 : size;
  std::size_t fitted = 0;
  for (std::size_t i = 0; i < size && fitted < wanted; ++i) {
    fitted += m_slices[m_next].moved > 0.0;
    refit(tree, m_slices[m_next]);
    if (++m_next == size) {
      m_next = 0;
      measureLooseness(tree.octree);
    }
  }
  m_lag = 0.0;
  for (Slice& slice : m_slices) {
    if (slice.moved > most) {
      refit(tree, slice);
      ++fitted;
    }
    m_lag = std::max(m_lag, slice.moved);
  }
  return fitted;
}

/// After all slices were fitted.
void OctreeSlices::measureLooseness(Octree& octree) {
  m_refitted = 0;
  octree.addAreas();
  octree.measureLooseness();
  m_isLoose = !octree.isTight();
}

/// Fits the boxes of a slice, unless its elements did not move.
void OctreeSlices::refit(const Tree& tree, Slice& slice) {
  if (slice.moved == 0.0) return;
  Octree& octree = tree.octree;
  const auto groups =
      octree.groups().subspan(slice.firstGroup, slice.endGroup - slice.firstGroup + 1);
  const std::uint32_t begin = groups.front(), count = groups.back() - begin;
  m_scratch.corners.resize(3 * std::size_t{count});
  m_scratch.floats.resize(3 * std::size_t{count});
  m_scratch.triangles.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    for (std::uint32_t c = 0; c < 3; ++c)
      m_scratch.corners[3 * i + c] = tree.mesh.now.body()[tree.ordered[begin + i][c]];
    m_scratch.triangles[i] = {3 * i, 3 * i + 1, 3 * i + 2};
  }
  toFloats(m_scratch.corners, tree.frame, m_scratch.floats.data());
  triangleBoxes(m_scratch.floats.data(), nullptr, m_scratch.triangles.data(), groups,
                octree.boxes(), octree.groupBoxes() + slice.firstGroup);
  octree.refit(slice.firstGroup, slice.endGroup);
  slice.moved = 0.0;
}

}  // namespace palpate
