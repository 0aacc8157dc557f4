#include "Octree/PointQueries.h"

#include <algorithm>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/PointQueries.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kSide = 16;  ///< boxes looked at together
using NodeTag = hn::CappedTag<float, 8>;
using LeafTag = hn::CappedTag<float, kSide>;

/// Boxes side by side, where they are or as a map places them.
class Boxes {
 public:
  /// Siblings.
  HWY_ATTR HWY_INLINE Boxes(const OctreeBlock& block, const BoxMap& map) {
    for (int k = 0; k < 3; ++k) {
      m_lower[k] = block.lower[k];
      m_upper[k] = block.upper[k];
    }
    if (map.count > 0) place(map, 8, [&](std::size_t i) { return block.box(i); });
  }
  /// Primitives from `first` on.
  HWY_ATTR HWY_INLINE Boxes(const BoxArrays& boxes, std::size_t first, std::size_t size,
                            const BoxMap& map) {
    for (int k = 0; k < 3; ++k) {
      m_lower[k] = boxes.lower[k].data() + first;
      m_upper[k] = boxes.upper[k].data() + first;
    }
    if (map.count > 0) place(map, size, [&](std::size_t i) { return boxes[first + i]; });
  }

  /// Bits of the first `size`.
  template <class D>
  HWY_ATTR HWY_INLINE std::uint32_t overlapping(D d, const FloatBox& box, std::size_t size) const {
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
      auto mask = hn::FirstN(d, size - i);
      for (int k = 0; k < 3; ++k)
        mask =
            hn::And(mask, hn::And(hn::Le(hn::LoadU(d, m_lower[k] + i), hn::Set(d, box.upper[k])),
                                  hn::Ge(hn::LoadU(d, m_upper[k] + i), hn::Set(d, box.lower[k]))));
      bits |= bitsOf(d, mask) << i;
    }
    return bits;
  }
  /// Into `out`: squared distances from `box`; empty boxes are infinitely far. Returns the bits of
  /// those of the first `size` that are at most `bound`.
  template <class D>
  HWY_ATTR HWY_INLINE std::uint32_t within(D d, const FloatBox& box, float bound, std::size_t size,
                                           float* out) const {
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
      auto sum = hn::Zero(d);
      for (int k = 0; k < 3; ++k) {
        const auto outside =
            hn::Max(hn::Max(hn::LoadU(d, m_lower[k] + i) - hn::Set(d, box.upper[k]),
                            hn::Set(d, box.lower[k]) - hn::LoadU(d, m_upper[k] + i)),
                    hn::Zero(d));
        sum += outside * outside;
      }
      hn::Store(sum, d, out + i);
      bits |= bitsOf(d, hn::And(hn::FirstN(d, size - i), hn::Le(sum, hn::Set(d, bound)))) << i;
    }
    return bits;
  }

 private:
  template <class F>
  void place(const BoxMap& map, std::size_t size, F&& boxAt) {
    for (std::size_t i = 0; i < size; ++i) {
      const FloatBox box = map(boxAt(i));
      for (int k = 0; k < 3; ++k) {
        m_placed[0][k][i] = box.lower[k];
        m_placed[1][k][i] = box.upper[k];
      }
    }
    for (int k = 0; k < 3; ++k) {
      m_lower[k] = m_placed[0][k];
      m_upper[k] = m_placed[1][k];
    }
  }

  const float *m_lower[3], *m_upper[3];
  alignas(64) float m_placed[2][3][kSide];
};

/// At least as far as a box may seem that is no further than this: a squared distance is off by
/// less than 2^-20 of itself, and by what outward rounding has to spare where its squares are
/// denormal.
float boundOf(double distanceSquared) {
  return OutwardRounding::up(static_cast<float>(distanceSquared) * (1.0f + 0x1p-19f));
}

HWY_ATTR void findOverlappingKernel(const Octree& octree, const BoxMap& map, const FloatBox& box,
                                    PointQueryStack& stack) {
  const OctreeBlock* blocks = octree.blocks();
  stack.found.clear();
  stack.entries.clear();
  if (map(blocks[0].box(0)).overlaps(box)) stack.entries.push_back({0, 0});
  while (!stack.entries.empty()) {
    const OctreeNode node = stack.entries.back().node;
    stack.entries.pop_back();
    const auto [begin, end] = octree.ownRange(node);
    for (std::uint32_t i = begin; i < end; i += kSide) {
      const std::size_t size = std::min<std::size_t>(kSide, end - i);
      std::uint32_t bits = Boxes(octree.boxes(), i, size, map).overlapping(LeafTag(), box, size);
      for (; bits; bits &= bits - 1)
        stack.found.push_back(i + static_cast<std::uint32_t>(std::countr_zero(bits)));
    }
    const OctreeBlock& block = blocks[node >> 3];
    if (block.isLeaf(node & 7)) continue;
    const std::uint32_t child = block.child[node & 7];
    std::uint32_t bits = Boxes(blocks[child], map).overlapping(NodeTag(), box, 8);
    for (; bits; bits &= bits - 1)
      stack.entries.push_back({0, child * 8 + static_cast<std::uint32_t>(std::countr_zero(bits))});
  }
}

HWY_ATTR void tryNearestKernel(const Octree& octree, const BoxMap& map, const FloatBox& point,
                               double distanceSquared, PointQueryStack& stack, void* context,
                               TryPrimitive tryPrimitive) {
  const OctreeBlock* blocks = octree.blocks();
  using Entry = PointQueryStack::Entry;
  float bound = boundOf(distanceSquared);
  alignas(64) float squares[kSide];
  stack.entries.assign(1, {0, 0});
  while (!stack.entries.empty()) {
    const Entry entry = stack.entries.back();
    stack.entries.pop_back();
    if (entry.distanceSquared > bound) continue;
    const auto [begin, end] = octree.ownRange(entry.node);
    for (std::uint32_t i = begin; i < end; i += kSide) {
      const std::size_t size = std::min<std::size_t>(kSide, end - i);
      std::uint32_t bits =
          Boxes(octree.boxes(), i, size, map).within(LeafTag(), point, bound, size, squares);
      for (; bits; bits &= bits - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(bits));
        if (squares[lane] <= bound) bound = boundOf(tryPrimitive(context, i + lane));
      }
    }
    const OctreeBlock& block = blocks[entry.node >> 3];
    if (block.isLeaf(entry.node & 7)) continue;
    const std::uint32_t child = block.child[entry.node & 7];
    const std::size_t first = stack.entries.size();
    std::uint32_t bits = Boxes(blocks[child], map).within(NodeTag(), point, bound, 8, squares);
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<std::uint32_t>(std::countr_zero(bits));
      const Entry next{squares[slot], child * 8 + slot};
      // Nearest last, to be taken first.
      std::size_t place = stack.entries.size();
      stack.entries.push_back(next);
      for (; place > first && stack.entries[place - 1].distanceSquared < next.distanceSquared;
           --place)
        stack.entries[place] = stack.entries[place - 1];
      stack.entries[place] = next;
    }
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(findOverlappingKernel);
HWY_EXPORT(tryNearestKernel);

void findOverlapping(const Octree& octree, const BoxMap& map, const FloatBox& box,
                     PointQueryStack& stack) {
  HWY_DYNAMIC_DISPATCH(findOverlappingKernel)(octree, map, box, stack);
}

void tryNearest(const Octree& octree, const BoxMap& map, const FloatBox& point,
                double distanceSquared, PointQueryStack& stack, void* context,
                TryPrimitive tryPrimitive) {
  HWY_DYNAMIC_DISPATCH(tryNearestKernel)
  (octree, map, point, distanceSquared, stack, context, tryPrimitive);
}

}  // namespace palpate
#endif
