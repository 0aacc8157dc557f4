#include "Octree/Layout.h"

#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

/// A cell whose keys are not sorted is one task's up to this size: sorted in the top it would keep
/// other threads waiting.
constexpr std::uint32_t kMostInOneTask = 8192;

void Octree::Layout::clear() {
  links.clear();
  parents.clear();
  m_groupCount = 0;
  groups.resize(groups.capacity());
  groupNodes.resize(groups.size());
  reserveGroups();
  tasks.clear();
}

void Octree::Layout::layOutTop(Octree& octree, Job root, const OctreeSettings& settings,
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

std::uint32_t Octree::Layout::layOut(Octree& octree, Job& job) {
  const std::uint32_t size = job.end - job.begin;
  if (size <= m_mostPerLeaf || job.depth >= m_maxDepth || job.cube.edge <= kSmallestCell)
    return leaf(job.begin, job.end, job.node);
  const bool sorted = job.level < job.sorted;
  if (m_taskSize > 0 && size <= (sorted ? m_taskSize : std::max(m_taskSize, kMostInOneTask))) {
    job.sorted = job.level;  // `ends` are gone by then
    tasks.push_back(job);
    leaf(job.begin, job.end, kTask | static_cast<std::uint32_t>(tasks.size() - 1));
    return 0;  // known when the tasks are done
  }
  if (sorted) return split(octree, job, partsOf(octree, job));
  Sorting sorting{job.begin, job.end, job.level};
  if (job.level == job.levels) {  // the first keys, or second ones inside a cell too full
    sorting.first = job.levels == 0;
    sorting.level = job.level = 0;
    sorting.levels = job.levels = std::min(Key::kMostLevels, m_maxDepth - job.depth);
    sorting.cube = &job.cube;
  }
  if (size > Sorting::kFew) return sortMany(octree, job, sorting);
  job.sorted = job.level + 1;
  return split(octree, job, octree.sortFewKeys(sorting));
}

/// In a stack frame of its own, as large as its bins.
[[gnu::noinline]] std::uint32_t Octree::Layout::sortMany(Octree& octree, Job& job,
                                                         Sorting& sorting) {
  const bool many = job.end - job.begin >= Sorting::kMany;
  sorting.digits = job.digits =
      std::min(many ? Sorting::kMostDigits : 2, Key::kMostLevels - job.level);
  std::array<std::uint32_t, 1 << Key::kDigitBits * Sorting::kMostDigits> ends;
  const int alike = octree.sortKeys(sorting, ends.data(), m_threads);
  job.ends = alike ? nullptr : ends.data();
  job.sorted = alike ? alike : job.level + job.digits;
  return split(octree, job, partsOf(octree, job));
}

/// Where the octants of a sorted range begin, and where it ends.
std::array<std::uint32_t, 9> Octree::Layout::partsOf(const Octree& octree, const Job& job) {
  std::array<std::uint32_t, 9> begins;
  if (!job.ends) {
    const std::uint64_t digit = Key::digits(octree.m_keys[job.begin], job.level, 1);
    for (unsigned part = 0; part < 9; ++part)
      begins[part] = digit >= Key::kOctant + part ? job.begin : job.end;
    return begins;
  }
  const int below = Key::kDigitBits * (job.sorted - job.level - 1);
  std::uint64_t bin = Key::digits(octree.m_keys[job.begin], job.sorted - job.digits, job.digits);
  bin = bin >> (below + Key::kDigitBits) << (below + Key::kDigitBits);
  begins[0] = job.ends[bin];
  for (std::uint64_t octant = 0; octant < 8; ++octant)
    begins[octant + 1] = job.ends[bin + ((Key::kOctant + octant + 1) << below) - 1];
  return begins;
}

std::uint32_t Octree::Layout::split(Octree& octree, const Job& job,
                                    const std::array<std::uint32_t, 9>& begins) {
  if (begins[0] == job.end) return leaf(job.begin, job.end, job.node);
  if (begins[0] > job.begin) leaf(job.begin, begins[0], job.node);
  reserveGroups();
  const auto block = static_cast<std::uint32_t>(links.size());
  if (block == links.capacity()) {  // by less than std::vector would: there are many layouts
    links.reserve(block + block / 8 + 2);
    parents.reserve(links.capacity());
  }
  links.emplace_back();
  parents.push_back(job.node);
  for (unsigned slot = 0; slot < 8; ++slot) {
    links[block].begin[slot] = begins[slot];
    links[block].child[slot] = OctreeBlock::kLeaf | (begins[slot + 1] - begins[slot]);
  }
  for (unsigned slot = 0; slot < 8; ++slot) {
    const std::uint32_t size = begins[slot + 1] - begins[slot];
    const OctreeNode node = block * 8 + slot;
    if (size > m_mostPerLeaf) {
      Job part = job;
      part.begin = begins[slot];
      part.end = begins[slot + 1];
      part.cube = job.cube.child(slot);
      part.node = node;
      ++part.depth;
      ++part.level;
      const std::uint32_t child = layOut(octree, part);
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
