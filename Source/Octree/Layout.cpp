#include "Octree/Layout.h"

#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

/// A cell of up to this size becomes one task if its keys are not sorted yet. Sorting it in the top
/// would keep other threads waiting.
constexpr std::uint32_t kMaxInOneTask = 8192;

void Layout::start(const OctreeSettings& settings, std::uint32_t taskSize,
                   Buffer<std::uint32_t>& ends, const Threads* threads) {
  links.clear();
  parents.clear();
  tasks.clear();
  m_groupCount = 0;
  groups.resize(groups.capacity());
  groupNodes.resize(groups.size());
  reserveGroups();
  m_maxPerLeaf = static_cast<std::uint32_t>(settings.maxElementsPerLeaf);
  m_maxDepth = std::min(settings.maxDepth, kMaxDepth);
  m_taskSize = taskSize;
  m_ends = &ends;
  m_ends->clear();
  m_threads = threads;
}

void Layout::finish() {
  groups.resize(m_groupCount);
  groupNodes.resize(m_groupCount);
}

void Layout::layOutTop(const KeySort& keys, const Job& root, const OctreeSettings& settings,
                       std::uint32_t taskSize, Buffer<std::uint32_t>& ends,
                       const Threads& threads) {
  start(settings, taskSize, ends, &threads);
  links.emplace_back();
  parents.push_back(0);
  for (unsigned slot = 0; slot < kChildren; ++slot) {
    links[0].begin[slot] = root.end;
    links[0].child[slot] = OctreeBlock::kLeaf;
  }
  links[0].begin[0] = root.begin;
  const std::uint32_t child = layOut(keys, root);
  links[0].child[0] = child;
  finish();
}

void Layout::layOutTask(const KeySort& keys, const Job& job, const OctreeSettings& settings,
                        Buffer<std::uint32_t>& ends) {
  start(settings, 0, ends, nullptr);
  Job own = job;
  own.node = kTaskRoot;
  rootChild = layOut(keys, own);
  finish();
}

/// Lays out the job's node and its subtree. Returns the value of the parent's slot for the node. An
/// explicit path replaces recursion, so that its size on the stack is known: about 7 KB.
std::uint32_t Layout::layOut(const KeySort& keys, const Job& job) {
  std::array<OpenNode, kMaxDepth + 1> path;
  OpenNode* node = path.data();
  node->job = job;
  if (!open(keys, *node)) return node->link;
  for (;;) {
    OpenNode* const child = node + 1;
    if (nextChild(*node, child->job)) {
      PALPATE_ASSERT(child < path.data() + path.size());
      const bool opened = open(keys, *child);
      links[node->link].child[node->nextSlot - 1] = child->link;
      if (opened) node = child;
    } else {
      m_ends->resize(node->endsBefore);
      reserveGroups();
      if (node == path.data()) return node->link;
      --node;
    }
  }
}

/// Sets a node's link to a leaf, a task or a block. Returns whether it is a block, whose slots are
/// then to be laid out.
bool Layout::open(const KeySort& keys, OpenNode& node) {
  Job& job = node.job;
  const std::uint32_t size = job.end - job.begin;
  if (size <= m_maxPerLeaf || job.depth >= m_maxDepth || job.cube.edge <= kSmallestCell) {
    node.link = addLeaf(job.begin, job.end, job.node);
    return false;
  }
  const bool sorted = job.level < job.sorted;
  if (m_taskSize > 0 && size <= (sorted ? m_taskSize : std::max(m_taskSize, kMaxInOneTask))) {
    job.sorted = job.level;  // `ends` no longer exist when the task runs
    tasks.push_back(job);
    addLeaf(job.begin, job.end, kTask | static_cast<std::uint32_t>(tasks.size() - 1));
    node.link = 0;  // set when the tasks are done
    return false;
  }
  node.endsBefore = static_cast<std::uint32_t>(m_ends->size());
  if (sorted)
    findParts(keys, node);
  else
    sort(keys, node);
  if (node.begins[0] == job.end) {
    m_ends->resize(node.endsBefore);
    node.link = addLeaf(job.begin, job.end, job.node);
    return false;
  }
  if (node.begins[0] > job.begin) addLeaf(job.begin, node.begins[0], job.node);
  reserveGroups();
  node.link = addBlock(node);
  node.nextSlot = 0;
  return true;
}

/// Sorts the node's range by the next digits and finds its parts. A long range is sorted by three
/// digits, others by two or one. If no digits are left, new keys are computed within the node's
/// cell.
void Layout::sort(const KeySort& keys, OpenNode& node) {
  Job& job = node.job;
  KeyRange range{job.begin, job.end, job.level};
  if (job.level == job.levels) {
    range.first = job.levels == 0;
    range.level = job.level = 0;
    range.levels = job.levels = std::min(Key::kLevels, m_maxDepth - job.depth);
    range.cube = &job.cube;
  }
  const std::uint32_t size = job.end - job.begin;
  if (size <= KeyRange::kFew) {
    job.sorted = job.level + 1;
    keys.sortByOneDigit(range, node.begins);
    return;
  }
  range.digits =
      std::min(size >= KeyRange::kMany ? PartEnds::kMaxDigits : 2, Key::kLevels - job.level);
  const std::size_t count = PartEnds::kCounts[static_cast<std::size_t>(range.digits)];
  m_ends->resize(node.endsBefore + count);
  const int equalDigits = keys.sortByDigits(range, m_ends->data() + node.endsBefore, m_threads);
  job.sorted = equalDigits ? equalDigits : job.level + range.digits;
  job.ends = equalDigits ? kEqualDigits : node.endsBefore;
  findParts(keys, node);
}

/// Finds where the octants of a sorted range begin, and where the range ends.
void Layout::findParts(const KeySort& keys, OpenNode& node) const {
  const Job& job = node.job;
  if (job.ends == kEqualDigits) {
    const std::uint64_t digit = Key::digits(keys[job.begin], job.level, 1);
    for (unsigned octant = 0; octant < 9; ++octant)
      node.begins[octant] = digit >= Key::kOctant + octant ? job.begin : job.end;
    return;
  }
  const std::uint32_t* ends = m_ends->data() + job.ends;
  PALPATE_ASSERT(job.sorted > job.level);
  const std::size_t perOctant =
      PartEnds::kCounts[static_cast<std::size_t>(job.sorted - job.level - 1)];
  for (std::size_t octant = 0; octant < 9; ++octant) node.begins[octant] = ends[octant * perOctant];
}

std::uint32_t Layout::addBlock(const OpenNode& node) {
  const auto block = static_cast<std::uint32_t>(links.size());
  if (block == links.capacity()) {  // grows less than std::vector would: there are many layouts
    links.reserve(block + block / 8 + 2);
    parents.reserve(links.capacity());
  }
  links.emplace_back();
  parents.push_back(node.job.node);
  PALPATE_ASSERT(std::is_sorted(std::begin(node.begins), std::end(node.begins)));
  for (unsigned slot = 0; slot < kChildren; ++slot) {
    links[block].begin[slot] = node.begins[slot];
    links[block].child[slot] = OctreeBlock::kLeaf | (node.begins[slot + 1] - node.begins[slot]);
  }
  return block;
}

/// Adds the groups of leaves from nextSlot on, up to the next child that needs a layout of its own.
/// Returns whether there is such a child.
bool Layout::nextChild(OpenNode& parent, Job& child) {
  const Job& job = parent.job;
  for (unsigned slot = parent.nextSlot; slot < kChildren; ++slot) {
    const std::uint32_t begin = parent.begins[slot], size = parent.begins[slot + 1] - begin;
    const OctreeNode node = nodeOf(parent.link, slot);
    if (size <= m_maxPerLeaf) {
      // The next group overwrites that of an empty slot: this avoids a branch that would be
      // mispredicted.
      groups[m_groupCount] = begin;
      groupNodes[m_groupCount] = node;
      m_groupCount += size > 0;
      continue;
    }
    parent.nextSlot = slot + 1;
    child.begin = begin;
    child.end = begin + size;
    child.cube = job.cube.child(slot);
    child.node = node;
    child.depth = job.depth + 1;
    child.levels = job.levels;
    child.level = job.level + 1;
    child.sorted = job.sorted;
    child.ends = kEqualDigits;
    if (job.ends != kEqualDigits && child.level < job.sorted)
      child.ends = job.ends + 1 +
                   slot * PartEnds::kCounts[static_cast<std::size_t>(job.sorted - job.level - 1)];
    return true;
  }
  return false;
}

std::uint32_t Layout::addLeaf(std::uint32_t begin, std::uint32_t end, OctreeNode node) {
  PALPATE_ASSERT(begin <= end && m_groupCount < groups.size());
  groups[m_groupCount] = begin;
  groupNodes[m_groupCount++] = node;
  reserveGroups();
  return OctreeBlock::kLeaf | (end - begin);
}

/// Reserves space for the groups of a block's eight slots and one more.
void Layout::reserveGroups() {
  PALPATE_ASSERT(m_groupCount <= groups.size());
  if (m_groupCount + 9 <= groups.size()) return;
  groups.reserve(groups.size() + groups.size() / 8 + 16);
  groups.resize(groups.capacity());
  groupNodes.reserve(groups.size());
  groupNodes.resize(groups.size());
}

std::size_t Layout::bytes() const {
  const auto of = [](const auto& buffer) { return buffer.capacity() * sizeof(buffer[0]); };
  return of(links) + of(parents) + of(groups) + of(groupNodes) + of(tasks);
}

}  // namespace palpate
