#include "Octree/OctreeNodes.h"

#include "Octree/Fit.h"

#include <cmath>
#include <limits>

namespace palpate {

/// By how much the begins of ranges move, as a function of where they were.
class OctreeNodes::RangeShifts {
 public:
  /// From this old place on, which ascends, ranges begin so much further behind.
  void add(std::uint32_t place, std::uint32_t by) { m_shifts.push_back({place, by}); }
  std::uint32_t firstPlace() const { return m_shifts.front().place; }
  /// Where a range begins. Calls with places that are near each other are cheap.
  std::uint32_t operator()(std::uint32_t begin) {
    if (begin < m_shifts.front().place) return begin;
    if (begin >= m_shifts.back().place) return begin + m_shifts.back().by;
    if (begin < m_shifts[m_last].place || begin >= m_shifts[m_last + 1].place)
      m_last =
          static_cast<std::size_t>(std::upper_bound(m_shifts.begin(), m_shifts.end(), begin,
                                                    [](std::uint32_t place, const Shift& behind) {
                                                      return place < behind.place;
                                                    }) -
                                   m_shifts.begin() - 1);
    return begin + m_shifts[m_last].by;
  }

 private:
  struct Shift {
    std::uint32_t place, by;  ///< modulo 2^32
  };
  CountedVector<Shift> m_shifts;
  std::size_t m_last = 0;  ///< of the last call
};

std::uint32_t OctreeNodes::groupAt(std::uint32_t place) const {
  return static_cast<std::uint32_t>(std::upper_bound(groups.begin(), groups.end(), place) -
                                    groups.begin() - 1);
}

std::uint32_t OctreeNodes::groupNear(const FloatBox& box) const {
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
void OctreeNodes::unlinkIfEmpty(OctreeNode node) {
  while (blockOf(node) != 0) {
    const OctreeBlock& block = pool[blockOf(node)];
    for (unsigned slot = 0; slot < kChildren; ++slot)
      if (!block.isEmpty(slot)) return;
    const OctreeNode above = parent(blockOf(node));
    const auto [begin, end] = ownRange(above);
    OctreeBlock& blockAbove = pool[blockOf(above)];
    blockAbove.child[slotOf(above)] = OctreeBlock::kLeaf | (end - begin);
    node = above;
  }
}

std::pair<CountedVector<OctreeNodes::Move>, CountedVector<std::uint32_t>> OctreeNodes::replace(
    std::uint32_t size, std::span<const std::uint32_t> places, std::span<const Joining> joining) {
  CountedVector<Move> moves;
  RangeShifts shifts;
  CountedVector<std::uint32_t> joined, changed;  // new places of joining elements; groups
  std::uint32_t from = 0, to = 0;
  const auto moveUpTo = [&](std::uint32_t end) {
    if (from != to && from != end) moves.push_back({from, to, end - from});
    to += end - from;
    from = end;
  };
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
  moveUpTo(size);

  shiftRanges(shifts, changed);
  return {std::move(moves), std::move(joined)};
}

/// Moves the begins of all ranges, brings the sizes of these groups to their nodes, and unlinks
/// nodes that became empty.
void OctreeNodes::shiftRanges(RangeShifts& shifts, std::span<const std::uint32_t> changed) {
  // Where any slot begins, also one without own elements, a group begins, or all end. Groups that
  // were empty before begin where the next one does, and none of them is joined.
  for (auto begin = std::lower_bound(groups.begin(), groups.end(), shifts.firstPlace());
       begin != groups.end(); ++begin)
    *begin = shifts(*begin);
  for (std::size_t block = 0; block < pool.used(); ++block)
    for (std::uint32_t& begin : pool[block].begin) begin = shifts(begin);
  for (const std::uint32_t g : changed) {
    const OctreeNode node = groupNodes[g];
    OctreeBlock& block = pool[blockOf(node)];
    if (!block.isLeaf(slotOf(node))) continue;
    block.child[slotOf(node)] = OctreeBlock::kLeaf | (groups[g + 1] - groups[g]);
  }
  for (const std::uint32_t g : changed)
    if (groups[g] == groups[g + 1]) unlinkIfEmpty(groupNodes[g]);
}

void OctreeNodes::refit(std::size_t first, std::size_t last, std::span<const FloatBox> groupBoxes) {
  PALPATE_ASSERT(first <= last && last <= groupNodes.size());
  blockHeap.clear();
  const auto push = [&](std::uint32_t block) {
    blockHeap.push_back(block);
    std::push_heap(blockHeap.begin(), blockHeap.end());
  };
  std::uint32_t pushed = 0;  // the root's block, which has no parent
  for (std::size_t g = first; g < last; ++g) {
    const OctreeNode node = groupNodes[g];
    const std::uint32_t block = blockOf(node);
    pool[block].setBox(slotOf(node), groupBoxes[g]);
    if (!pool[block].isLeaf(slotOf(node))) push(pool[block].child[slotOf(node)]);
    if (block != pushed) push(pushed = block);
  }
  // Parents have lower numbers than their children.
  for (std::uint32_t done = 0; !blockHeap.empty();) {
    std::pop_heap(blockHeap.begin(), blockHeap.end());
    const std::uint32_t block = blockHeap.back();
    blockHeap.pop_back();
    if (block == 0 || block == done) continue;
    done = block;
    const OctreeNode parent = parents[block];
    const std::uint32_t begin = pool[blockOf(parent)].begin[slotOf(parent)];
    if (begin != pool[block].begin[0]) {  // fitBlocks() widens the box of the parent's own elements
      pool[blockOf(parent)].setBox(slotOf(parent), groupBoxes[groupAt(begin)]);
    }
    fitBlocks(pool.data(), parents.data(), block, block + 1);
    push(blockOf(parent));
  }
}

}  // namespace palpate
