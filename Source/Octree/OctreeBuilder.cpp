#include "Octree/OctreeBuilder.h"

#include "Core/Assert.h"

#include <algorithm>
#include <atomic>
#include <cmath>

namespace palpate {

namespace {

/// Below this size, one thread is faster than several.
constexpr std::size_t kSerialSize = 16384;
/// The grain of passes over keys: at least eight parts, so that each thread roughly keeps its half
/// from pass to pass.
std::size_t grainOf(std::size_t size) { return std::clamp<std::size_t>(size / 8, 1024, 8192); }

/// The power-of-two cube that contains the box. Its corner is on a grid so coarse that the corners
/// of cells are exact.
///
/// The bulk of the elements lies about 0. If the box is much larger than the bulk, 0 is placed a
/// third of the way along each of the cube's edges. At every level, 0 is then a third or two thirds
/// along the edges of its cell. No cell border cuts the bulk, or runs close to it, until cells are
/// as small as the bulk.
Cube cubeOf(const FloatBox& bounds, double bulk) {
  constexpr double kMuchLarger = 256;
  Cube cube;
  double longest = kSmallestCell, farthest = 0;
  for (int k = 0; k < 3; ++k) {
    const double lower = bounds.lower[k], upper = bounds.upper[k];
    longest = std::max(longest, upper - lower);
    farthest = std::max({farthest, -lower, upper});
  }
  if (longest > kMuchLarger * bulk) {
    cube.edge = std::exp2(std::ceil(std::log2(3.01 * std::max(farthest, longest))));
    cube.lower.fill(-cube.edge / 3.0);
    return cube;
  }
  cube.edge = std::exp2(std::ceil(std::log2(longest * (1.0 + 0x1p-9))));
  const double grid = cube.edge * 0x1p-20;
  for (int k = 0; k < 3; ++k) {
    const double middle = 0.5 * (double{bounds.lower[k]} + double{bounds.upper[k]});
    cube.lower[k] = std::floor((middle - 0.5 * cube.edge) / grid) * grid;
  }
  return cube;
}

}  // namespace

void OctreeBuilder::build(const BoxArrays& boxes, const FloatBox& bounds, double bulk,
                          const OctreeSettings& settings, std::span<std::uint64_t> keys,
                          Buffer<std::uint32_t>& order, OctreeNodes& nodes,
                          const Threads& threads) {
  const auto size = static_cast<std::uint32_t>(order.size());
  PALPATE_ASSERT(keys.size() >= size && boxes.lower[0].size() >= size);
  nodes.rootCube = cubeOf(bounds, bulk);
  const KeySort sort(boxes, keys, nodes.pool.lend<std::uint64_t>(size), m_sharedCounts);
  layOutTop(sort, size, nodes.rootCube, settings, threads);
  layOutTasks(sort, settings, threads);
  // A root that is a leaf may have no keys; the order then stays.
  if (!(top().links[0].child[0] & OctreeBlock::kLeaf))
    orderElements(keys, order, nodes.pool, threads);
  assemble(size, nodes, threads);
}

void OctreeBuilder::layOutTop(const KeySort& keys, std::uint32_t size, const Cube& root,
                              const OctreeSettings& settings, const Threads& threads) {
  if (m_ends.empty()) m_ends.resize(1);
  const std::uint32_t taskSize = size < kSerialSize ? 0 : std::max<std::uint32_t>(size / 64, 1024);
  m_layouts[0].layOutTop(keys, Layout::rootJob(size, root), settings, taskSize, m_ends[0], threads);
}

void OctreeBuilder::layOutTasks(const KeySort& keys, const OctreeSettings& settings,
                                const Threads& threads) {
  const std::size_t count = tasks();
  if (count == 0) return;
  if (m_layouts.size() < count + 1) m_layouts.resize(count + 1);
  // Each worker takes the next task and has scratch of its own. Which worker lays out a task
  // changes nothing in its nodes.
  const std::size_t workers = std::min(count, static_cast<std::size_t>(threads.count()));
  if (m_ends.size() < workers) m_ends.resize(workers);
  std::atomic<std::size_t> next = 0;
  threads.forEach(workers, [&](std::size_t worker) {
    for (std::size_t task; (task = next.fetch_add(1, std::memory_order_relaxed)) < count;)
      m_layouts[task + 1].layOutTask(keys, top().tasks[task], settings, m_ends[worker]);
  });
}

void OctreeBuilder::orderElements(std::span<const std::uint64_t> keys, Buffer<std::uint32_t>& order,
                                  BlockPool& pool, const Threads& threads) const {
  const std::size_t size = order.size(), grain = grainOf(size);
  const std::span<std::uint32_t> before = pool.lend<std::uint32_t>(size);
  threads.forChunks(size, grain, [&](std::size_t, std::size_t from, std::size_t to) {
    std::copy_n(order.data() + from, to - from, before.data() + from);
  });
  threads.forChunks(size, grain, [&](std::size_t, std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) order[i] = before[Key::slot(keys[i])];
  });
}

void OctreeBuilder::assemble(std::uint32_t size, OctreeNodes& nodes, const Threads& threads) {
  const std::size_t parts = tasks() + 1;
  nodes.partBlocks.resize(parts + 1);
  nodes.partBlocks[0] = 0;
  for (std::size_t part = 0; part < parts; ++part)
    nodes.partBlocks[part + 1] =
        nodes.partBlocks[part] + static_cast<std::uint32_t>(m_layouts[part].links.size());
  nodes.pool.start(nodes.partBlocks.back());
  nodes.parents.resize(nodes.partBlocks.back());
  placeGroups(size, nodes);
  threads.forEach(top().groups.size(), [&](std::size_t entry) { writeGroup(entry, nodes); });
  threads.forEach(parts, [&](std::size_t part) { writeBlocks(part, nodes); });
  for (std::size_t task = 0; task + 1 < parts; ++task) {
    const OctreeNode node = top().tasks[task].node;
    const std::uint32_t child = m_layouts[task + 1].rootChild;
    nodes.pool[blockOf(node)].child[slotOf(node)] =
        child & OctreeBlock::kLeaf ? child : child + nodes.partBlocks[task + 1];
  }
  PALPATE_ASSERT(std::is_sorted(nodes.groups.begin(), nodes.groups.end()));
}

/// Computes the place of each entry of the top's groups. A task's entry takes as many places as the
/// task has groups.
void OctreeBuilder::placeGroups(std::uint32_t size, OctreeNodes& nodes) {
  m_groupPlaces.resize(top().groups.size());
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < top().groups.size(); ++i) {
    m_groupPlaces[i] = count;
    const OctreeNode node = top().groupNodes[i];
    count += node & Layout::kTask
                 ? static_cast<std::uint32_t>(m_layouts[1 + (node & ~Layout::kTask)].groups.size())
                 : 1;
  }
  resizeSparingly(nodes.groups, count + 1);
  resizeSparingly(nodes.groupNodes, count);
  nodes.groups[count] = size;
}

void OctreeBuilder::writeGroup(std::size_t entry, OctreeNodes& nodes) const {
  const OctreeNode node = top().groupNodes[entry];
  const std::uint32_t place = m_groupPlaces[entry];
  if (!(node & Layout::kTask)) {
    nodes.groups[place] = top().groups[entry];
    nodes.groupNodes[place] = node;
    return;
  }
  const std::size_t task = node & ~Layout::kTask;
  const Layout& layout = m_layouts[task + 1];
  const OctreeNode root = top().tasks[task].node;
  const std::uint32_t base = nodes.partBlocks[task + 1] * kChildren;
  std::copy(layout.groups.begin(), layout.groups.end(), nodes.groups.begin() + place);
  for (std::size_t g = 0; g < layout.groups.size(); ++g)
    nodes.groupNodes[place + g] =
        layout.groupNodes[g] == Layout::kTaskRoot ? root : layout.groupNodes[g] + base;
}

void OctreeBuilder::writeBlocks(std::size_t part, OctreeNodes& nodes) const {
  const Layout& layout = m_layouts[part];
  const std::uint32_t base = nodes.partBlocks[part];
  for (std::size_t b = 0; b < layout.links.size(); ++b) {
    OctreeBlock& block = nodes.pool[base + b];
    nodes.parents[base + b] = layout.parents[b] == Layout::kTaskRoot
                                  ? top().tasks[part - 1].node
                                  : layout.parents[b] + base * kChildren;
    for (int k = 0; k < 3; ++k) {
      std::fill_n(block.lower[k], 8, FloatBox::kEmptyLower);
      std::fill_n(block.upper[k], 8, -FloatBox::kEmptyLower);
    }
    const Layout::Links& links = layout.links[b];
    for (unsigned slot = 0; slot < kChildren; ++slot) {
      block.begin[slot] = links.begin[slot];
      block.child[slot] = links.child[slot] + (links.child[slot] & OctreeBlock::kLeaf ? 0 : base);
    }
  }
}

std::size_t OctreeBuilder::bytes() const {
  const auto of = [](const auto& buffer) { return buffer.capacity() * sizeof(buffer[0]); };
  std::size_t bytes = of(m_layouts) + of(m_ends) + of(m_sharedCounts) + of(m_groupPlaces);
  for (const Layout& layout : m_layouts) bytes += layout.bytes();
  for (const auto& ends : m_ends) bytes += of(ends);
  return bytes;
}

}  // namespace palpate
