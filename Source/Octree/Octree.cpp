#include "Octree/Octree.h"

#include <palpate/Error.h>

#include "Octree/Fit.h"
#include "Octree/OctreeBuilder.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace palpate {

namespace {

/// Groups whose boxes one task writes to their nodes.
constexpr std::size_t kGroupsPerTask = 1024;

double halfArea(const FloatBox& box) {
  if (box.empty()) return 0.0;
  const double x = double{box.upper[0]} - box.lower[0], y = double{box.upper[1]} - box.lower[1],
               z = double{box.upper[2]} - box.lower[2];
  return x * y + y * z + z * x;
}

}  // namespace

/// By how much the begins of ranges move, as a function of where they were.
class Octree::RangeShifts {
  struct Shift {
    std::uint32_t place, by;  ///< modulo 2^32
  };

 public:
  /// From this old place on, which ascends, ranges begin so much further behind.
  void add(std::uint32_t place, std::uint32_t by) { m_shifts.push_back({place, by}); }
  std::uint32_t firstPlace() const { return m_shifts.front().place; }

  /// Calls with places that are near each other are cheap.
  class Cursor {
   public:
    explicit Cursor(const RangeShifts& shifts)
        : m_shifts(shifts.m_shifts), m_last(m_shifts.begin()) {}
    std::uint32_t operator()(std::uint32_t begin) {
      if (begin < m_shifts.front().place) return begin;
      if (begin >= m_shifts.back().place) return begin + m_shifts.back().by;
      if (begin < m_last->place || begin >= (m_last + 1)->place)
        m_last = std::prev(std::upper_bound(
            m_shifts.begin(), m_shifts.end(), begin,
            [](std::uint32_t place, const Shift& behind) { return place < behind.place; }));
      return begin + m_last->by;
    }

   private:
    const CountedVector<Shift>& m_shifts;
    CountedVector<Shift>::const_iterator m_last;  ///< of the last call
  };

 private:
  CountedVector<Shift> m_shifts;
};

Octree::Octree() = default;
Octree::~Octree() = default;

void Octree::reset(std::size_t size, std::span<const std::uint32_t> without) {
  m_stage = Stage::Empty;
  m_dops.directions = 3;
  ++m_layout;
  m_order.clear();
  m_nodes.groups.clear();
  m_nodes.groupNodes.clear();
  m_nodes.pool.start(0);
  m_boxes.resize(size);
  m_order.reserve(withSpare(size + BoxArrays::kPadding));  // read in whole vectors
  m_order.resize(size);
  if (without.empty()) return std::iota(m_order.begin(), m_order.end(), 0u);
  auto next = without.begin();
  std::uint32_t id = 0;
  for (std::uint32_t& element : m_order) {
    for (; next != without.end() && *next == id; ++next) ++id;
    element = id++;
  }
}

void Octree::copy(const Octree& other) {
  PALPATE_ASSERT(other.isBuilt() || other.size() == 0);
  const bool isSameLayout = isBuilt() && m_layout == other.m_layout;
  m_stage = Stage::Empty;
  const auto copyBuffer = [](auto& to, const auto& from) {
    resizeSparingly(to, from.size());
    std::copy(from.begin(), from.end(), to.begin());
  };
  if (!isSameLayout) {
    m_order.clear();
    m_order.reserve(other.size() + BoxArrays::kPadding);  // read in whole vectors
    m_order.assign(other.m_order.begin(), other.m_order.end());
    copyBuffer(m_nodes.parents, other.m_nodes.parents);
    m_nodes.rootCube = other.m_nodes.rootCube;
    m_nodes.pool.start(other.m_nodes.pool.used());
  }
  for (int k = 0; k < 3; ++k) {
    copyBuffer(m_boxes.lower[k], other.m_boxes.lower[k]);
    copyBuffer(m_boxes.upper[k], other.m_boxes.upper[k]);
  }
  std::copy_n(other.blocks(), other.m_nodes.pool.used(), m_nodes.pool.data());
  m_layout = other.m_layout;
  m_stage = other.m_stage;
}

void Octree::releaseMemory() {
  m_builder.reset();
  if (m_dops.directions == 3) m_dops = {};
  m_boxes.releaseMemory();
  for (auto* buffer : {&m_nodes.parents, &m_nodes.groups, &m_nodes.groupNodes, &m_nodes.partBlocks})
    releaseSpare(*buffer);
  releaseSpare(m_groupBoxes);
  m_nodes.pool.releaseMemory();
}

void Octree::build(const FloatBox& bounds, double bulk, const OctreeSettings& settings,
                   std::span<std::uint64_t> keys, const Threads& threads) {
  PALPATE_ASSERT(size() > 0 && keys.size() == size());
  m_stage = Stage::Empty;
  m_dops.directions = 3;
  ++m_layout;
  try {
    if (!m_builder) m_builder = std::make_unique<OctreeBuilder>();
    m_builder->build(m_boxes, bounds, bulk, settings, keys, m_order, m_nodes, threads);
    resizeSparingly(m_groupBoxes, m_nodes.groupNodes.size());
  } catch (...) {
    m_order.clear();
    throw;
  }
  PALPATE_ASSERT(m_nodes.groups.size() == m_nodes.groupNodes.size() + 1 &&
                 m_nodes.groups.front() == 0 && m_nodes.groups.back() == size());
  m_isUnmeasured = true;
  m_stage = Stage::LaidOut;
}

/// The group that holds a place of the order.
std::uint32_t Octree::groupAt(std::uint32_t place) const {
  const Buffer<std::uint32_t>& groups = m_nodes.groups;
  return static_cast<std::uint32_t>(std::upper_bound(groups.begin(), groups.end(), place) -
                                    groups.begin() - 1);
}

std::uint32_t Octree::groupNear(const FloatBox& box) const {
  PALPATE_ASSERT(isBuilt() && size() > 0);
  const auto longestOf = [](const FloatBox& of) {
    return std::max(
        {of.upper[0] - of.lower[0], of.upper[1] - of.lower[1], of.upper[2] - of.lower[2]});
  };
  constexpr float kLarge = 0.5f;  // of a node: such elements are its own; any share will do
  const float longest = longestOf(box);
  OctreeNode node = 0;
  while (const OctreeNode children = firstChild(node)) {
    const auto own = ownRange(node);
    if (own.first < own.second && longest > kLarge * longestOf(this->box(node))) break;
    float least = std::numeric_limits<float>::infinity();
    node = children;
    for (unsigned slot = 0; slot < kChildren; ++slot) {
      if (isEmpty(children + slot)) continue;
      const FloatBox child = this->box(children + slot);
      float apart = 0.0f, middles = 0.0f;
      for (int k = 0; k < 3; ++k) {
        apart += std::max({0.0f, child.lower[k] - box.upper[k], box.lower[k] - child.upper[k]});
        middles += std::fabs((child.lower[k] - box.lower[k]) + (child.upper[k] - box.upper[k]));
      }
      // Where several overlap the box, their middles decide.
      const float distance = apart + 0x1p-10f * middles;
      if (distance < least || isEmpty(node)) {
        least = distance;
        node = children + slot;
      }
    }
  }
  return groupAt(ownRange(node).first);
}

/// If all slots of a node's child block have become empty, the node becomes a leaf of its own
/// elements, and so on upward. The block stays in the pool until the next build.
void Octree::unlinkIfEmpty(OctreeNode node) {
  while (blockOf(node) != 0) {
    const OctreeBlock& block = m_nodes.pool[blockOf(node)];
    for (unsigned slot = 0; slot < kChildren; ++slot)
      if (!block.isEmpty(slot)) return;
    const OctreeNode above = parent(blockOf(node));
    const auto [begin, end] = ownRange(above);
    OctreeBlock& blockAbove = m_nodes.pool[blockOf(above)];
    blockAbove.child[slotOf(above)] = OctreeBlock::kLeaf | (end - begin);
    node = above;
  }
}

CountedVector<Octree::Move> Octree::replace(std::span<const std::uint32_t> places,
                                            std::span<const Joining> joining, bool keepsBoxes) {
  PALPATE_ASSERT(isBuilt() && !(places.empty() && joining.empty()));
  PALPATE_ASSERT(size() + joining.size() > places.size());
  m_stage = Stage::Empty;
  m_dops.directions = 3;
  ++m_layout;
  CountedVector<Move> moves;
  RangeShifts shifts;
  CountedVector<std::uint32_t> joined, changed;  // new places of joining elements; groups
  std::uint32_t from = 0, to = 0;
  const auto moveUpTo = [&](std::uint32_t end) {
    if (from != to && from != end) moves.push_back({from, to, end - from});
    to += end - from;
    from = end;
  };
  const Buffer<std::uint32_t>& groups = m_nodes.groups;
  auto gone = places.begin();
  for (auto joins = joining.begin(); joins != joining.end() || gone != places.end();) {
    if (joins != joining.end() && (gone == places.end() || groups[joins->group + 1] <= *gone)) {
      PALPATE_ASSERT(groups[joins->group] < groups[joins->group + 1]);
      moveUpTo(groups[joins->group + 1]);
      joined.push_back(to++);
      changed.push_back(joins++->group);
    } else {
      changed.push_back(groupAt(*gone));
      moveUpTo(*gone++);
      ++from;
    }
    shifts.add(from, to - from);
  }
  moveUpTo(static_cast<std::uint32_t>(size()));

  const auto newSize = static_cast<std::uint32_t>(size() - places.size() + joining.size());
  PALPATE_ASSERT(to == newSize);
  const std::size_t most = std::max<std::size_t>(size(), newSize) + BoxArrays::kPadding;
  const auto moveIn = [&](auto& buffer) {
    if (buffer.capacity() < most) buffer.reserve(withSpare(most));
    buffer.resize(most);
    move(buffer.data(), moves);
  };
  moveIn(m_order);
  m_order.resize(newSize);
  for (std::size_t i = 0; i < joined.size(); ++i) m_order[joined[i]] = joining[i].element;
  for (int k = 0; k < 3 && keepsBoxes; ++k) moveIn(m_boxes.lower[k]), moveIn(m_boxes.upper[k]);
  m_boxes.resize(newSize);

  shiftRanges(shifts, changed);
  m_stage = keepsBoxes ? Stage::Built : Stage::LaidOut;
  return moves;
}

/// Moves the begins of all ranges, brings the sizes of these groups to their nodes, and unlinks
/// nodes that became empty.
void Octree::shiftRanges(const RangeShifts& shifts, std::span<const std::uint32_t> changed) {
  // Where any slot begins, also one without own elements, a group begins, or all end. Groups that
  // were empty before begin where the next one does, and none of them is joined.
  Buffer<std::uint32_t>& groups = m_nodes.groups;
  RangeShifts::Cursor shifted(shifts);
  for (auto begin = std::lower_bound(groups.begin(), groups.end(), shifts.firstPlace());
       begin != groups.end(); ++begin)
    *begin = shifted(*begin);
  for (std::size_t block = 0; block < m_nodes.pool.used(); ++block)
    for (std::uint32_t& begin : m_nodes.pool[block].begin) begin = shifted(begin);
  for (const std::uint32_t g : changed) {
    const OctreeNode node = m_nodes.groupNodes[g];
    OctreeBlock& block = m_nodes.pool[blockOf(node)];
    if (!block.isLeaf(slotOf(node))) continue;
    block.child[slotOf(node)] = OctreeBlock::kLeaf | (groups[g + 1] - groups[g]);
  }
  for (const std::uint32_t g : changed)
    if (groups[g] == groups[g + 1]) unlinkIfEmpty(m_nodes.groupNodes[g]);
}

void Octree::fit(const Threads& threads) {
  PALPATE_ASSERT(m_stage != Stage::Empty);
  m_stage = Stage::LaidOut;
  m_dops.directions = 3;
  OctreeNodes& nodes = m_nodes;
  m_groupAreas.resize((nodes.groupNodes.size() + kGroupsPerTask - 1) / kGroupsPerTask);
  threads.forChunks(nodes.groupNodes.size(), kGroupsPerTask,
                    [&](std::size_t chunk, std::size_t from, std::size_t to) {
                      double areas = 0;
                      for (std::size_t g = from; g < to; ++g) {
                        const OctreeNode node = nodes.groupNodes[g];
                        nodes.pool[blockOf(node)].setBox(slotOf(node), m_groupBoxes[g]);
                        areas += halfArea(m_groupBoxes[g]);
                      }
                      m_groupAreas[chunk] = areas;
                    });
  // In each part, children come after their parents, and all other parts come after the top.
  PALPATE_ASSERT(nodes.partBlocks.size() >= 2 && nodes.partBlocks.back() == nodes.pool.used());
  const std::size_t parts = nodes.partBlocks.size() - 1;
  threads.forEach(parts - 1, [&](std::size_t task) {
    fitBlocks(nodes.pool.data(), nodes.parents.data(), nodes.partBlocks[task + 1],
              nodes.partBlocks[task + 2]);
  });
  fitBlocks(nodes.pool.data(), nodes.parents.data(), 1, nodes.partBlocks[1]);
  m_stage = Stage::Built;
}

void Octree::refit(std::size_t first, std::size_t last) {
  PALPATE_ASSERT(isBuilt() && first <= last && last <= m_nodes.groupNodes.size());
  BlockPool& pool = m_nodes.pool;
  m_dops.directions = 3;
  m_blockHeap.clear();
  const auto push = [&](std::uint32_t block) {
    m_blockHeap.push_back(block);
    std::push_heap(m_blockHeap.begin(), m_blockHeap.end());
  };
  std::uint32_t pushed = 0;  // the root's block, which has no parent
  for (std::size_t g = first; g < last; ++g) {
    const OctreeNode node = m_nodes.groupNodes[g];
    const std::uint32_t block = blockOf(node);
    pool[block].setBox(slotOf(node), m_groupBoxes[g]);
    if (!pool[block].isLeaf(slotOf(node))) push(pool[block].child[slotOf(node)]);
    if (block != pushed) push(pushed = block);
  }
  // Parents have lower numbers than their children.
  for (std::uint32_t done = 0; !m_blockHeap.empty();) {
    std::pop_heap(m_blockHeap.begin(), m_blockHeap.end());
    const std::uint32_t block = m_blockHeap.back();
    m_blockHeap.pop_back();
    if (block == 0 || block == done) continue;
    done = block;
    const OctreeNode parent = m_nodes.parents[block];
    const std::uint32_t begin = pool[blockOf(parent)].begin[slotOf(parent)];
    if (begin != pool[block].begin[0]) {  // fitBlocks() widens the box of the parent's own elements
      pool[blockOf(parent)].setBox(slotOf(parent), m_groupBoxes[groupAt(begin)]);
    }
    fitBlocks(pool.data(), m_nodes.parents.data(), block, block + 1);
    push(blockOf(parent));
  }
}

void Octree::addAreas() {
  m_groupAreas.assign(1, 0.0);
  for (std::size_t g = 0; g < m_nodes.groupNodes.size(); ++g)
    m_groupAreas[0] += halfArea(m_groupBoxes[g]);
}

OctreeDops& Octree::startDops(int directions) {
  PALPATE_ASSERT(isBuilt());
  m_dops.directions = 3;
  for (int k = 3; k < directions; ++k)
    for (Buffer<float>* bounds : {&m_dops.lower[k], &m_dops.upper[k]})
      resizeSparingly(*bounds, size() + BoxArrays::kPadding);
  resizeSparingly(m_dops.blocks, m_nodes.pool.used() * static_cast<std::size_t>(directions - 3));
  return m_dops;
}

void Octree::fitDops(int directions) {
  PALPATE_ASSERT(isBuilt() && m_dops.directions == 3);
  constexpr float kInfinity = FloatBox::kEmptyLower;
  OctreeDops& dops = m_dops;
  const auto further = static_cast<std::size_t>(directions - 3);
  double leaves = 0;
  dops.halfWidths.fill(0);
  // Children come after their parents.
  for (std::size_t block = m_nodes.pool.used(); block-- > 0;)
    for (unsigned slot = 0; slot < kChildren; ++slot) {
      const auto node = nodeOf(static_cast<std::uint32_t>(block), slot);
      const bool isUsed = (block > 0 || slot == 0) && !isEmpty(node);
      const auto [begin, end] = isUsed ? ownRange(node) : std::pair(0u, 0u);
      const std::size_t child = isUsed ? blockOf(firstChild(node)) : 0;
      const bool isLeaf = isUsed && child == 0;
      leaves += isLeaf;
      for (int k = 0; k < 3 && isLeaf; ++k) {
        const FloatBox fitted = box(node);
        dops.halfWidths[k] += 0.5 * (double{fitted.upper[k]} - fitted.lower[k]);
      }
      for (std::size_t k = 0; k < further; ++k) {
        float lower = kInfinity, upper = -kInfinity;
        for (std::uint32_t i = begin; i < end; ++i) {
          lower = std::min(lower, dops.lower[k + 3][i]);
          upper = std::max(upper, dops.upper[k + 3][i]);
        }
        for (unsigned s = 0; child != 0 && s < kChildren; ++s) {
          lower = std::min(lower, dops.blocks[child * further + k].lower[s]);
          upper = std::max(upper, dops.blocks[child * further + k].upper[s]);
        }
        dops.blocks[block * further + k].lower[slot] = lower;
        dops.blocks[block * further + k].upper[slot] = upper;
        if (isLeaf) dops.halfWidths[k + 3] += 0.5 * (double{upper} - lower);
      }
    }
  for (double& width : dops.halfWidths) width /= leaves;
  dops.directions = directions;
}

void Octree::throwNotBuilt() {
  throw Error(ErrorCode::NotAvailable, "the octree was not built, or its last update failed");
}

void Octree::measureLooseness() {
  // All groups count, because a few that have become large cost most. For the elements, a sample is
  // enough.
  const Buffer<std::uint32_t>& groups = m_nodes.groups;
  const std::size_t count = m_nodes.groupNodes.size(),
                    stride = std::max<std::size_t>(8, count / 256);
  double areas = 0, elements = 0x1p-30 * halfArea(box(0));  // points have no area
  for (const double part : m_groupAreas) areas += part;
  for (std::size_t g = 0; g < count; g += stride)
    for (std::size_t i = groups[g]; i < groups[g + 1]; ++i) elements += halfArea(m_boxes[i]);
  m_looseness = elements > 0 ? areas / elements : 1.0;
  // Refitting does not tighten a tree. If looseness falls, the sample missed the elements that
  // caused it.
  m_leastLooseness = m_isUnmeasured ? m_looseness : std::min(m_leastLooseness, m_looseness);
  m_isUnmeasured = false;
}

std::size_t Octree::bytes() const {
  const auto of = [](const auto& buffer) { return buffer.capacity() * sizeof(buffer[0]); };
  std::size_t bytes =
      of(m_order) + of(m_nodes.groups) + of(m_nodes.groupNodes) + of(m_nodes.parents) +
      of(m_nodes.partBlocks) + of(m_groupBoxes) + of(m_groupAreas) + m_dops.bytes() +
      m_nodes.pool.allocated() * sizeof(OctreeBlock) + (m_builder ? m_builder->bytes() : 0);
  for (int k = 0; k < 3; ++k) bytes += of(m_boxes.lower[k]) + of(m_boxes.upper[k]);
  return bytes;
}

}  // namespace palpate
