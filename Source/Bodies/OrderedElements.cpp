#include "Bodies/OrderedElements.h"

#include "Mesh/TriangleBoxes.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <utility>

namespace palpate {

void OrderedElements::start(std::size_t size) {
  m_triangles = {};
  const std::size_t padded = size + BoxArrays::kPadding;
  m_memory.reserve(withSpare(padded) * sizeof(Triangle));
  m_triangles = m_memory.start<Triangle>(padded).first(size);
}

void OrderedElements::fill(const MeshTopology& topology, const Octree& octree, std::size_t from,
                           std::size_t to) {
  for (std::size_t i = from; i < to; ++i) m_triangles[i] = topology.elements[octree.order()[i]];
}

/// Computes the boxes of the elements, and those of the groups.
void OrderedElements::compute(const Boxes& boxes, std::span<const std::uint32_t> groups,
                              FloatBox* groupBoxes, std::size_t grain, const Threads& threads,
                              const MeshTopology* unordered) {
  PALPATE_ASSERT(groups.front() == 0 && groups.back() == size());
  threads.forChunks(groups.size() - 1, grain, [&](std::size_t, std::size_t from, std::size_t to) {
    if (unordered) fill(*unordered, boxes.octree, groups[from], groups[to]);
    triangleBoxes(boxes.floats.now(), boxes.floats.before(), m_triangles.data() + groups[from],
                  groups.subspan(from, to - from + 1), boxes.octree.boxes(), groupBoxes + from);
  });
}

void OrderedElements::build(const Boxes& boxes, double bulk, const OctreeSettings& settings,
                            const Threads& threads) {
  constexpr std::size_t kInGroup = 1024;  // before there are nodes
  Stopwatch watch;
  const std::size_t size = m_triangles.size(), count = (size + kInGroup - 1) / kInGroup;
  m_bounds.groups.resize(count + 1);
  for (std::size_t i = 0; i <= count; ++i)
    m_bounds.groups[i] = static_cast<std::uint32_t>(std::min(i * kInGroup, size));
  m_bounds.boxes.resize(count);
  compute(boxes, m_bounds.groups, m_bounds.boxes.data(), 2, threads, nullptr);
  FloatBox all;
  for (const FloatBox& box : m_bounds.boxes) all.add(box);
  boxes.boxMilliseconds += watch.lap();
  // Triangles in the old order are no longer needed. The keys use their memory.
  m_triangles = {};
  boxes.octree.build(all, bulk, settings, m_memory.start<std::uint64_t>(size), threads);
  start(size);
  boxes.octreeMilliseconds += watch.lap();
}

void OrderedElements::fit(const Boxes& boxes, const OctreeSettings& settings,
                          const Threads& threads, const MeshTopology* unordered) {
  constexpr std::size_t kGroupGrain = 128;
  Stopwatch watch;
  Octree& octree = boxes.octree;
  compute(boxes, octree.groups(), octree.groupBoxes(), kGroupGrain, threads, unordered);
  boxes.boxMilliseconds += watch.lap();
  octree.fit(threads);
  if (settings.update == OctreeUpdate::Auto) octree.measureLooseness();
  boxes.octreeMilliseconds += watch.lap();
}

void OrderedElements::follow(const MeshTopology& topology, const Octree& octree,
                             std::span<const Octree::Move> moves,
                             std::span<const Octree::Joining> joining) {
  const std::size_t size = octree.size(),
                    most = std::max(size, m_triangles.size()) + BoxArrays::kPadding;
  const std::span<Triangle> triangles = m_memory.resized(m_triangles, most);
  if (triangles.empty()) {
    start(size);
    return fill(topology, octree, 0, size);
  }
  Octree::move(triangles.data(), moves);
  m_triangles = triangles.first(size);
  const auto groups = octree.groups();
  const Octree::Joining* last = nullptr;
  for (const Octree::Joining& one : joining)
    if (const auto* before = std::exchange(last, &one); !before || before->group != one.group)
      fill(topology, octree, groups[one.group], groups[one.group + 1]);
}

void OrderedElements::releaseMemory() {
  m_bounds = {};
  if (m_triangles.empty()) return m_memory.release();
  const std::size_t size = m_triangles.size();
  m_triangles =
      m_memory.shrink(std::span(m_triangles.data(), size + BoxArrays::kPadding)).first(size);
}

}  // namespace palpate
