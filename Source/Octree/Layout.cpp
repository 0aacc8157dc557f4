#include "Octree/Layout.h"

#include "Core/Assert.h"

#include <algorithm>
#include <bit>
#include <numeric>

namespace palpate {

/// A cell that needs second keys is one task's up to this size: sorted in the top it would keep
/// other threads waiting.
constexpr std::uint32_t kMostInOneTask = 8192;

int keyLevels(std::size_t size, const OctreeSettings& settings, int depth) {
  const std::size_t leaves = size / static_cast<std::size_t>(settings.maxPrimitivesPerLeaf) + 1;
  const int levels = (std::bit_width(leaves) + 1) / 2 +
                     2;  // a surface fills a quarter of the cells of the next level
  return std::clamp(levels, 1,
                    std::min(KeyLayout::kMostLevels, std::max(1, settings.maxDepth - depth)));
}

void Octree::Layout::clear() {
  links.clear();
  parents.clear();
  m_groupCount = 0;
  groups.resize(groups.capacity());
  groupNodes.resize(groups.size());
  reserveGroups();
  tasks.clear();
}

void Octree::Layout::layOutTop(Octree& octree, const Job& root, const OctreeSettings& settings,
                               std::uint32_t taskSize, const Threads& threads) {
  clear();
  m_mostPerLeaf = static_cast<std::uint32_t>(settings.maxPrimitivesPerLeaf);
  m_maxDepth = settings.maxDepth;
  m_taskSize = taskSize;
  m_threads = &threads;
  links.emplace_back();
  parents.push_back(0);
  for (unsigned slot = 0; slot < 8; ++slot) {
    links[0].begin[slot] = root.end;
    links[0].child[slot] = OctreeBlock::kLeaf;
  }
  links[0].begin[0] = root.begin;
  const std::uint32_t child = layOut(octree, root);
  links[0].child[0] = child;
  trimGroups();
}

void Octree::Layout::layOutTask(Octree& octree, const Job& job, const OctreeSettings& settings) {
  clear();
  m_mostPerLeaf = static_cast<std::uint32_t>(settings.maxPrimitivesPerLeaf);
  m_maxDepth = settings.maxDepth;
  m_taskSize = 0;
  m_threads = nullptr;
  Job own = job;
  own.node = kTaskRoot;
  rootChild = layOut(octree, own);
  trimGroups();
}

/// Room for those of a block's eight slots and one more.
void Octree::Layout::reserveGroups() {
  if (m_groupCount + 9 <= groups.size()) return;
  groups.reserve(groups.size() + groups.size() / 8 + 16);
  groups.resize(groups.capacity());
  groupNodes.reserve(groups.size());
  groupNodes.resize(groups.size());
}

std::uint32_t Octree::Layout::leaf(std::uint32_t begin, std::uint32_t end, OctreeNode node) {
  groups[m_groupCount] = begin;
  groupNodes[m_groupCount++] = node;
  reserveGroups();
  return OctreeBlock::kLeaf | (end - begin);
}

std::uint32_t Octree::Layout::layOut(Octree& octree, Job job) {
  const std::uint32_t size = job.end - job.begin;
  if (size <= m_mostPerLeaf || job.depth >= m_maxDepth || job.cube.edge <= kSmallestCell)
    return leaf(job.begin, job.end, job.node);
  // Too full at the keys' last level: split further by second keys inside the cell.
  const bool rekey = job.level == job.keys.levels;
  if (m_taskSize > 0 && size <= (rekey ? std::max(m_taskSize, kMostInOneTask) : m_taskSize)) {
    tasks.push_back(job);
    leaf(job.begin, job.end, kTask | static_cast<std::uint32_t>(tasks.size() - 1));
    return 0;  // known when the tasks are done
  }
  if (rekey) {
    // Where most of the tree is still in one cell it is tiny in the root, and the more levels at
    // once the better.
    const bool tiny = 2 * std::size_t{size} > octree.size();
    job.keys.levels =
        keyLevels(tiny ? SIZE_MAX : size,
                  {.maxDepth = m_maxDepth, .maxPrimitivesPerLeaf = int(m_mostPerLeaf)}, job.depth);
    job.level = 0;
    octree.sortKeys(job.begin, job.end, true, job.cube, job.keys, m_threads);
  }
  std::uint32_t own = 0;
  while (own < size && job.keys.level(octree.key(job.begin + own)) == job.level) ++own;
  if (own == size) return leaf(job.begin, job.end, job.node);
  return split(octree, job, own);
}

/// Where the octants of a range of sorted keys begin: seven binary searches side by side, without
/// branches, so that none waits for another's loads.
std::array<std::uint32_t, 9> Octree::octantBegins(std::uint32_t begin, std::uint32_t end,
                                                  int shift) const {
  std::array<std::uint32_t, 9> begins;
  begins.fill(begin);
  begins[8] = end;
  if (begin == end) return begins;
  const std::uint64_t cell = m_keys[begin] >> 32 >> shift & ~std::uint64_t{7};
  const std::uint64_t* places[8];
  std::uint64_t bounds[8];
  for (unsigned slot = 1; slot < 8; ++slot) {
    places[slot] = m_keys + begin;
    bounds[slot] = (cell | slot) << shift << 32;
  }
  for (std::size_t length = end - begin; length > 0;) {
    const std::size_t half = (length + 1) / 2;
    for (unsigned slot = 1; slot < 8; ++slot)
      places[slot] += half & -std::size_t{places[slot][half - 1] < bounds[slot]};
    length -= half;
  }
  for (unsigned slot = 1; slot < 8; ++slot)
    begins[slot] = static_cast<std::uint32_t>(places[slot] - m_keys);
  return begins;
}

std::uint32_t Octree::Layout::split(Octree& octree, const Job& job, std::uint32_t own) {
  if (own > 0) leaf(job.begin, job.begin + own, job.node);
  reserveGroups();
  const auto block = static_cast<std::uint32_t>(links.size());
  if (block == links.capacity()) {  // by less than std::vector would: there are many layouts
    links.reserve(block + block / 8 + 2);
    parents.reserve(links.capacity());
  }
  links.emplace_back();
  parents.push_back(job.node);
  const std::array<std::uint32_t, 9> begins =
      octree.octantBegins(job.begin + own, job.end, job.keys.octantShift(job.level));
  for (unsigned slot = 0; slot < 8; ++slot) {
    links[block].begin[slot] = begins[slot];
    links[block].child[slot] = OctreeBlock::kLeaf | (begins[slot + 1] - begins[slot]);
  }
  for (unsigned slot = 0; slot < 8; ++slot) {
    const std::uint32_t size = begins[slot + 1] - begins[slot];
    const OctreeNode node = block * 8 + slot;
    if (size > m_mostPerLeaf) {
      const std::uint32_t child =
          layOut(octree, {begins[slot], begins[slot + 1], job.level + 1, job.depth + 1, job.keys,
                          job.cube.child(slot), node});
      links[block].child[slot] = child;
      reserveGroups();
    } else {
      // An empty slot's is overwritten by the next: no branch to be mispredicted.
      groups[m_groupCount] = begins[slot];
      groupNodes[m_groupCount] = node;
      m_groupCount += size > 0;
    }
  }
  return block;
}

}  // namespace palpate
