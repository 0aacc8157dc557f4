// For files with SIMD code, after Core/Simd.h: included once for each instruction set.
#if defined(PALPATE_OCTREE_WALK_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef PALPATE_OCTREE_WALK_LANES
#undef PALPATE_OCTREE_WALK_LANES
#else
#define PALPATE_OCTREE_WALK_LANES
#endif

#include "Octree/BoxLanes.h"
#include "Core/Assert.h"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

/// Eight siblings that wait, by keys of which one SIMD comparison finds the least. A key is the
/// bits of a box's squared distance from a point, rounded down, with the slot in the lowest three
/// bits. Nodes that are empty or were entered have the key kEntered.
class WaitingSiblings {
 public:
  static constexpr std::uint32_t kSlotBits = kChildren - 1, kEntered = 0xffffffff;

  /// The largest key of a box at a squared distance of at most this.
  static std::uint32_t keyOf(float distanceSquared) {
    PALPATE_ASSERT(distanceSquared >= 0.0f);
    return std::bit_cast<std::uint32_t>(distanceSquared) | kSlotBits;
  }
  HWY_ATTR HWY_INLINE void start(const OctreeBlock& siblings, const FloatBox& point) {
    const NodeTag d;
    const hn::RebindToUnsigned<NodeTag> du;
    for (std::size_t i = 0; i < kChildren; i += hn::Lanes(d)) {
      const auto boxes = BoxLanes<NodeTag>::load(siblings, i);
      const auto bits = hn::BitCast(du, boxes.distanceFrom(point));
      const auto key = hn::Or(hn::AndNot(hn::Set(du, kSlotBits), bits),
                              hn::Iota(du, static_cast<std::uint32_t>(i)));
      const auto used = hn::RebindMask(du, hn::Le(boxes.lower[0], boxes.upper[0]));
      hn::Store(hn::IfThenElse(used, key, hn::Set(du, kEntered)), du, m_keys + i);
    }
    m_block = &siblings;
  }
  HWY_ATTR HWY_INLINE std::uint32_t leastKey() const {
    const hn::RebindToUnsigned<NodeTag> du;
    auto least = hn::Load(du, m_keys);
    for (std::size_t i = hn::Lanes(du); i < kChildren; i += hn::Lanes(du))
      least = hn::Min(least, hn::Load(du, m_keys + i));
    return hn::GetLane(hn::MinOfLanes(du, least));
  }
  const OctreeBlock* enter(std::uint32_t slot) {
    m_keys[slot] = kEntered;
    return m_block;
  }

 private:
  alignas(32) std::uint32_t m_keys[kChildren];
  const OctreeBlock* m_block;
};

/// A walk down an octree from its root that goes on with the node nearest to a point, of those on
/// the lowest level that has any. Calls addElements(begin, end) with the elements that each node
/// holds itself. mostKey(): keys of nodes that are not entered are above it.
template <class AddElements, class MostKey>
HWY_ATTR HWY_INLINE void walkAround(const Octree& octree, const FloatBox& point,
                                    AddElements&& addElements, MostKey&& mostKey) {
  PALPATE_ASSERT(octree.isBuilt());
  const OctreeBlock* const blocks = octree.blocks();
  std::array<WaitingSiblings, kMaxLevels> path;
  std::size_t depth = 0;
  const OctreeBlock* block = blocks;
  for (std::uint32_t slot = 0;;) {
    const std::uint32_t begin = block->begin[slot];
    if (block->isLeaf(slot)) {
      addElements(begin, begin + block->count(slot));
    } else {
      const OctreeBlock& children = blocks[block->child[slot]];
      PALPATE_ASSERT(depth < kMaxLevels && begin <= children.begin[0]);
      addElements(begin, children.begin[0]);
      path[depth++].start(children, point);
    }
    std::uint32_t key = WaitingSiblings::kEntered;
    while (depth > 0 && (key = path[depth - 1].leastKey()) > mostKey()) --depth;
    if (depth == 0) return;
    slot = key & WaitingSiblings::kSlotBits;
    block = path[depth - 1].enter(slot);
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
