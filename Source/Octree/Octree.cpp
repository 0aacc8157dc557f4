#include "Octree/Octree.h"

#include "Core/Assert.h"
#include "Octree/Fit.h"
#include "Octree/Layout.h"

#include <cmath>
#include <numeric>

namespace palpate {

namespace {

/// Below this, one thread is faster than handing out work.
constexpr std::size_t kSerialSize = 16384;
constexpr std::size_t kGrain = 8192;
/// Of passes over keys: at least eight parts, so that a thread keeps about its half from pass to
/// pass.
std::size_t grainOf(std::size_t size) { return std::clamp<std::size_t>(size / 8, 1024, kGrain); }

double halfArea(const FloatBox& box) {
  const double x = double{box.upper[0]} - box.lower[0], y = double{box.upper[1]} - box.lower[1],
               z = double{box.upper[2]} - box.lower[2];
  return x * y + y * z + z * x;
}

/// The power-of-two cube that holds the box, its corner on a grid so coarse that cells' corners are
/// exact.
///
/// Where the box is much larger than the bulk, which lies about 0, the cube is placed so that 0 is
/// a third of the way along each of its edges: then 0 is a third or two thirds along those of its
/// cell at any level, and no cell border cuts the bulk, nor runs close to it, before cells are of
/// its size.
Cube rootCube(const FloatBox& bounds, double bulk) {
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

Octree::Octree() = default;
Octree::Octree(Octree&&) noexcept = default;
Octree& Octree::operator=(Octree&&) noexcept = default;
Octree::~Octree() = default;

void Octree::reset(std::size_t size) {
  m_order.reserve(size + BoxArrays::kPadding);  // read in whole vectors
  m_order.resize(size);
  std::iota(m_order.begin(), m_order.end(), 0u);
  m_boxes.resize(size);
  m_groups.assign({0u, static_cast<std::uint32_t>(size)});
  m_groupNodes.clear();
  m_groupBoxes.resize(1);
  m_pool.use(0);
}

void Octree::build(const FloatBox& bounds, double bulk, const OctreeSettings& settings,
                   std::uint64_t* keyScratch, const Threads& threads) {
  const auto size = static_cast<std::uint32_t>(m_order.size());
  PALPATE_ASSERT(size > 0);
  m_rootCube = palpate::rootCube(bounds, bulk);
  m_keys = keyScratch;
  m_pool.use((size * sizeof(std::uint64_t) + sizeof(OctreeBlock) - 1) / sizeof(OctreeBlock));
  m_keysScratch = reinterpret_cast<std::uint64_t*>(m_pool.data());

  if (m_layouts.empty()) m_layouts.resize(1);
  const std::uint32_t taskSize = size < kSerialSize ? 0 : std::max<std::uint32_t>(size / 64, 1024);
  m_layouts[0].layOutTop(*this, {0, size, m_rootCube, 0}, settings, taskSize, threads);
  const std::size_t tasks = m_layouts[0].tasks.size();
  if (m_layouts.size() < tasks + 1) m_layouts.resize(tasks + 1);
  Layout* layouts = m_layouts.data();
  threads.forEach(tasks, [&](std::size_t task) {
    layouts[task + 1].layOutTask(*this, layouts[0].tasks[task], settings);
  });
  // A root that is a leaf may have no keys; else their scratch is free now and holds the old order.
  auto* before = reinterpret_cast<std::uint32_t*>(m_keysScratch);
  const bool sorted = !(layouts[0].links[0].child[0] & OctreeBlock::kLeaf);
  threads.forChunks(sorted ? size : 0, grainOf(size),
                    [&](std::size_t, std::size_t from, std::size_t to) {
                      std::copy_n(m_order.data() + from, to - from, before + from);
                    });
  threads.forChunks(sorted ? size : 0, grainOf(size),
                    [&](std::size_t, std::size_t from, std::size_t to) {
                      for (std::size_t i = from; i < to; ++i)
                        m_order[i] = before[Key::slot(m_keys[i])];
                    });
  assemble(tasks, threads);
  m_builtNow = true;
}

void Octree::assemble(std::size_t tasks, const Threads& threads) {
  const Layout& top = m_layouts[0];
  m_taskBlocks.resize(tasks + 2);
  m_taskBlocks[0] = 0;
  for (std::size_t i = 0; i <= tasks; ++i)
    m_taskBlocks[i + 1] = m_taskBlocks[i] + static_cast<std::uint32_t>(m_layouts[i].links.size());
  m_pool.use(m_taskBlocks.back());
  m_parents.resize(m_taskBlocks.back());

  // Where each entry of the top's groups goes: a task's take as many places as it made.
  m_entryPlaces.resize(top.groups.size());
  std::uint32_t groupCount = 0;
  for (std::size_t i = 0; i < top.groups.size(); ++i) {
    m_entryPlaces[i] = groupCount;
    const OctreeNode node = top.groupNodes[i];
    groupCount +=
        node & Layout::kTask
            ? static_cast<std::uint32_t>(m_layouts[1 + (node & ~Layout::kTask)].groups.size())
            : 1;
  }
  resizeSparingly(m_groups, groupCount + 1);
  resizeSparingly(m_groupNodes, groupCount);
  resizeSparingly(m_groupBoxes, groupCount);
  m_groups[groupCount] = static_cast<std::uint32_t>(m_order.size());
  threads.forEach(top.groups.size(), [&](std::size_t i) {
    const OctreeNode node = top.groupNodes[i];
    const std::uint32_t place = m_entryPlaces[i];
    if (!(node & Layout::kTask)) {
      m_groups[place] = top.groups[i];
      m_groupNodes[place] = node;
      return;
    }
    const std::size_t task = node & ~Layout::kTask;
    const Layout& layout = m_layouts[task + 1];
    const OctreeNode root = top.tasks[task].node;
    const std::uint32_t base = m_taskBlocks[task + 1] * 8;
    std::copy(layout.groups.begin(), layout.groups.end(), m_groups.begin() + place);
    for (std::size_t g = 0; g < layout.groups.size(); ++g)
      m_groupNodes[place + g] =
          layout.groupNodes[g] == Layout::kTaskRoot ? root : layout.groupNodes[g] + base;
  });
  threads.forEach(tasks + 1, [&](std::size_t i) {
    const Layout& layout = m_layouts[i];
    const std::uint32_t base = m_taskBlocks[i];
    for (std::size_t b = 0; b < layout.links.size(); ++b) {
      OctreeBlock& block = m_pool[base + b];
      m_parents[base + b] = layout.parents[b] == Layout::kTaskRoot ? top.tasks[i - 1].node
                                                                   : layout.parents[b] + base * 8;
      for (int k = 0; k < 3; ++k) {
        std::fill_n(block.lower[k], 8, FloatBox::kEmptyLower);
        std::fill_n(block.upper[k], 8, -FloatBox::kEmptyLower);
      }
      const Layout::Links& links = layout.links[b];
      for (unsigned slot = 0; slot < 8; ++slot) {
        block.begin[slot] = links.begin[slot];
        block.child[slot] = links.child[slot] + (links.child[slot] & OctreeBlock::kLeaf ? 0 : base);
      }
    }
  });
  for (std::size_t i = 0; i < tasks; ++i) {
    const OctreeNode node = top.tasks[i].node;
    const std::uint32_t child = m_layouts[i + 1].rootChild;
    m_pool[node >> 3].child[node & 7] =
        child & OctreeBlock::kLeaf ? child : child + m_taskBlocks[i + 1];
  }
}

void Octree::fit(const Threads& threads) {
  constexpr std::size_t kChunk = kGrain / 8;
  m_groupAreas.resize((m_groupNodes.size() + kChunk - 1) / kChunk);
  threads.forChunks(m_groupNodes.size(), kChunk,
                    [&](std::size_t chunk, std::size_t from, std::size_t to) {
                      double areas = 0;
                      for (std::size_t g = from; g < to; ++g) {
                        m_pool[m_groupNodes[g] >> 3].setBox(m_groupNodes[g] & 7, m_groupBoxes[g]);
                        areas += halfArea(m_groupBoxes[g]);
                      }
                      m_groupAreas[chunk] = areas;
                    });
  // Children come after their parents in a task, and tasks after the top.
  const std::size_t tasks = m_taskBlocks.size() - 2;
  threads.forEach(tasks, [&](std::size_t task) {
    fitBlocks(m_pool.data(), m_parents.data(), m_taskBlocks[task + 1], m_taskBlocks[task + 2]);
  });
  fitBlocks(m_pool.data(), m_parents.data(), 1, m_taskBlocks[1]);
}

void Octree::measureLooseness() {
  // All groups, as few that have become large cost most; of the primitives a sample's growth.
  const std::size_t stride = std::max<std::size_t>(8, m_groupNodes.size() / 256);
  double groups = 0, primitives = 0x1p-30 * halfArea(m_pool[0].box(0));  // points have no area
  for (const double areas : m_groupAreas) groups += areas;
  for (std::size_t g = 0; g < m_groupNodes.size(); g += stride)
    for (std::size_t i = m_groups[g]; i < m_groups[g + 1]; ++i) primitives += halfArea(m_boxes[i]);
  m_looseness = primitives > 0 ? groups / primitives : 1.0;
  // Refitting does not tighten: what has fallen was due to primitives that the sample lacks.
  m_leastLooseness = m_builtNow ? m_looseness : std::min(m_leastLooseness, m_looseness);
  m_builtNow = false;
}

std::size_t Octree::bytes() const {
  const auto of = [](const auto& buffer) { return buffer.capacity() * sizeof(buffer[0]); };
  std::size_t bytes = of(m_order) + of(m_groups) + of(m_groupNodes) + of(m_groupBoxes) +
                      of(m_groupAreas) + of(m_parents) + m_pool.allocated() * sizeof(OctreeBlock) +
                      of(m_binCounts);
  for (int k = 0; k < 3; ++k) bytes += of(m_boxes.lower[k]) + of(m_boxes.upper[k]);
  for (const Layout& layout : m_layouts)
    bytes += of(layout.links) + of(layout.parents) + of(layout.groups) + of(layout.groupNodes) +
             of(layout.tasks);
  return bytes;
}

}  // namespace palpate
