#include "Queries/PairTraversal.h"

#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/PairTraversal.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

/// The lowest heights of a geometry's elements along a direction. They are computed in blocks of
/// the octree's order when a block is first needed.
class ElementHeights {
 public:
  ElementHeights(const PairSide& side, PairScratch::Heights& scratch)
      : m_side(side), m_scratch(scratch) {
    m_scratch.blocks.fill(kNone);
  }
  const PairSide& side() const { return m_side; }

  void setDirection(const std::array<float, 3>& direction) {
    if (direction == m_direction) return;
    m_direction = direction;
    m_scratch.blocks.fill(kNone);
  }
  /// The lowest of the elements at places [begin, end).
  HWY_ATTR float lowest(std::uint32_t begin, std::uint32_t end) {
    const LeafTag d;
    const auto none = hn::Set(d, std::numeric_limits<float>::infinity());
    auto least = none;
    while (begin < end) {
      const float* const heights = at(begin);
      const std::uint32_t count = std::min(end - begin, kBlock - begin % kBlock);
      for (std::size_t i = 0; i < count; i += hn::Lanes(d))
        least = hn::Min(least,
                        hn::IfThenElse(hn::FirstN(d, count - i), hn::LoadU(d, heights + i), none));
      begin += count;
    }
    return hn::GetLane(hn::MinOfLanes(d, least));
  }
  /// Lower bounds for what boxes hold. Products and sums are rounded monotonically, so that none is
  /// above the computed height of an element in the box.
  template <class D>
  HWY_ATTR HWY_INLINE hn::Vec<D> lowest(D d, const BoxLanes<D>& boxes) const {
    const auto along = [&](int k) {
      const auto direction = hn::Set(d, m_direction[static_cast<std::size_t>(k)]);
      return hn::Min(direction * boxes.lower[k], direction * boxes.upper[k]);
    };
    return along(0) + along(1) + along(2);
  }
  float operator[](std::uint32_t place) { return at(place)[0]; }
  /// Those of `count` elements from a place on, at most NearElements::kSide.
  void copy(std::uint32_t place, std::uint32_t count, float* out) {
    PALPATE_ASSERT(count <= NearElements::kSide);
    for (std::uint32_t i = 0; i < NearElements::kSide; ++i)
      out[i] = i < count ? (*this)[place + i] : std::numeric_limits<float>::infinity();
  }

 private:
  static constexpr std::uint32_t kBlock = PairScratch::Heights::kBlock,
                                 kSlots = PairScratch::Heights::kSlots,
                                 kNone = PairScratch::Heights::kNone;

  /// The height of the element at a place, and of those behind it in its block.
  const float* at(std::uint32_t place) {
    const std::uint32_t block = place / kBlock, slot = block % kSlots;
    if (m_scratch.blocks[slot] != block) {
      compute(block, m_scratch.heights[slot]);
      m_scratch.blocks[slot] = block;
    }
    return m_scratch.heights[slot] + place % kBlock;
  }
  void compute(std::uint32_t block, float* heights) const {
    const std::uint32_t first = block * kBlock,
                        end = std::min(first + kBlock,
                                       static_cast<std::uint32_t>(m_side.octree.size()));
    for (std::uint32_t i = first; i < end; ++i) {
      const auto height = [&](std::size_t corner) {
        const FloatPoint& p = m_side.floats[m_side.ordered[i][corner]];
        return m_direction[0] * p.x + m_direction[1] * p.y + m_direction[2] * p.z;
      };
      heights[i - first] = std::min({height(0), height(1), height(2)});
    }
  }

  const PairSide& m_side;
  std::array<float, 3> m_direction{};
  PairScratch::Heights& m_scratch;
};

class PairDescent {
 public:
  PairDescent(const PairSide& a, const PairSide& b, PairScratch& scratch, void* context,
              TestElements test)
      : m_a(a, scratch.a),
        m_b(b, scratch.b),
        m_context(context),
        m_test(test),
        m_waiting(scratch.waiting) {}

  HWY_ATTR void run(const PairBound& bound) {
    setBound(bound);
    TimeCheck check(32);
    m_waiting.clear();
    m_waiting.enter({{0, static_cast<std::uint32_t>(m_a.side().octree.size())},
                     {0, static_cast<std::uint32_t>(m_b.side().octree.size())}},
                    0.0f);
    for (decltype(PairScratch::waiting)::Entry entry; m_waiting.next(m_limit, entry);) {
      check();
      const auto& [a, b] = entry.node;
      const float lowestA = lowestOf(m_a, a), lowestB = lowestOf(m_b, b);
      if (lowestA + lowestB > m_lowest) continue;
      const FloatBox boxA = boxOf(m_a.side(), a), boxB = boxOf(m_b.side(), b);
      const OctreeNode childA = childOf(m_a.side(), a), childB = childOf(m_b.side(), b);
      if (childA != 0 && (childB == 0 || sizeOf(boxA) >= sizeOf(boxB)))
        expand(m_a, a, childA, boxB, lowestB, entry.bound, [&](const Subtree& part, float square) {
          m_waiting.enter({part, entry.node.b}, square);
        });
      else if (childB != 0)
        expand(m_b, b, childB, boxA, lowestA, entry.bound, [&](const Subtree& part, float square) {
          m_waiting.enter({entry.node.a, part}, square);
        });
      else
        testElements(a, b, boxB);
    }
  }

 private:
  static constexpr std::size_t kSide = NearElements::kSide;
  /// The bit of a node of which only its own elements are left, without its children.
  static constexpr OctreeNode kOwn = 0x80000000u;
  /// Heights are compared for subtrees of at most so many elements.
  static constexpr std::uint32_t kFew = 128;
  using Subtree = PairScratch::Subtree;

  void setBound(const PairBound& bound) {
    // Computed squares are off by less than 2^-20 of themselves.
    m_limit = OutwardRounding::up(bound.distance * bound.distance * (1.0f + 0x1p-19f));
    if (!(m_limit >= 0)) m_limit = std::numeric_limits<float>::infinity();
    m_lowest = bound.heights;
    m_a.setDirection(bound.alongA);
    m_b.setDirection(bound.alongB);
  }
  /// Whether heights exclude any elements.
  bool hasHeights() const { return m_lowest < std::numeric_limits<float>::infinity(); }
  /// A lower bound for the heights of a subtree's elements: the lowest one of few elements.
  HWY_ATTR float lowestOf(ElementHeights& heights, const Subtree& part) const {
    if (!hasHeights()) return 0.0f;
    const std::uint32_t begin = beginOf(heights.side(), part);
    if (part.end - begin <= kFew) return heights.lowest(begin, part.end);
    const BoxTag d;
    return hn::GetLane(
        heights.lowest(d, BoxLanes<BoxTag>::of(heights.side().octree.box(part.node & ~kOwn))));
  }
  static std::uint32_t beginOf(const PairSide& side, const Subtree& part) {
    const OctreeNode node = part.node & ~kOwn;
    return side.octree.blocks()[blockOf(node)].begin[slotOf(node)];
  }
  static OctreeNode childOf(const PairSide& side, const Subtree& part) {
    return part.node & kOwn ? 0 : side.octree.firstChild(part.node);
  }
  HWY_ATTR HWY_INLINE static FloatBox boxOf(const PairSide& side, const Subtree& part) {
    return BoxLanes<BoxTag>::of(side.octree.box(part.node & ~kOwn)).mapped(side.map).first();
  }
  static float sizeOf(const FloatBox& box) {
    return (box.upper[0] - box.lower[0]) + (box.upper[1] - box.lower[1]) +
           (box.upper[2] - box.lower[2]);
  }

  /// Enters the node's own elements and its children near the box.
  template <class Enter>
  HWY_ATTR HWY_INLINE void expand(const ElementHeights& heights, const Subtree& part,
                                  OctreeNode child, const FloatBox& other, float lowest,
                                  float square, Enter&& enter) {
    const PairSide& side = heights.side();
    const OctreeBlock& block = side.octree.blocks()[blockOf(child)];
    alignas(64) float squares[kChildren];
    std::uint32_t bits = 0;
    const NodeTag d;
    for (std::size_t i = 0; i < kChildren; i += hn::Lanes(d)) {
      const auto boxes = BoxLanes<NodeTag>::load(block, i);
      std::uint32_t low = 0xff;
      if (hasHeights()) {
        low =
            bitsOf(d, hn::Le(heights.lowest(d, boxes) + hn::Set(d, lowest), hn::Set(d, m_lowest)));
        if (low == 0) continue;
      }
      const auto distances = boxes.mapped(side.map).distanceFrom(other);
      hn::Store(distances, d, squares + i);
      bits |= (bitsOf(d, hn::Le(distances, hn::Set(d, m_limit))) & low) << i;
    }
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<std::uint32_t>(std::countr_zero(bits));
      if (block.isEmpty(slot)) continue;
      enter({child + slot, slot < 7 ? block.begin[slot + 1] : part.end}, squares[slot]);
    }
    const auto [begin, end] = side.octree.ownRange(part.node);
    if (begin < end) enter({part.node | kOwn, end}, square);
  }

  /// Boxes of elements, in the common floats.
  struct Boxes {
    alignas(64) float lower[3][kSide], upper[3][kSide], heights[kSide];

    /// The first `size` boxes. The last vector's other lanes hold values that nothing may use.
    HWY_ATTR HWY_INLINE void load(const PairSide& side, std::uint32_t first, std::size_t size) {
      const LeafTag d;
      for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
        const auto boxes = BoxLanes<LeafTag>::load(side.octree.boxes(), first + i).mapped(side.map);
        for (int k = 0; k < 3; ++k) {
          hn::Store(boxes.lower[k], d, lower[k] + i);
          hn::Store(boxes.upper[k], d, upper[k] + i);
        }
      }
    }
    FloatBox operator[](std::size_t i) const {
      return {{lower[0][i], lower[1][i], lower[2][i], 0},
              {upper[0][i], upper[1][i], upper[2][i], 0}};
    }
    /// Bits of the first `size` boxes that are near another box.
    HWY_ATTR HWY_INLINE std::uint32_t near(const FloatBox& other, std::size_t size,
                                           float limit) const {
      const LeafTag d;
      std::uint32_t bits = 0;
      for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
        const auto isNear =
            hn::Le(BoxLanes<LeafTag>::load(*this, i).distanceFrom(other), hn::Set(d, limit));
        bits |= bitsOf(d, hn::And(hn::FirstN(d, size - i), isNear)) << i;
      }
      return bits;
    }
    /// Bits of the heights whose sums with another are not above a limit.
    HWY_ATTR HWY_INLINE std::uint32_t below(float limit, float other) const {
      const LeafTag d;
      std::uint32_t bits = 0;
      for (std::size_t i = 0; i < kSide; i += hn::Lanes(d))
        bits |= bitsOf(d, hn::Le(hn::Load(d, heights + i) + hn::Set(d, other), hn::Set(d, limit)))
                << i;
      return bits;
    }
  };

  HWY_ATTR void testElements(const Subtree& a, const Subtree& b, const FloatBox& boxB) {
    NearElements found;
    Boxes boxesA, boxesB;
    const std::uint32_t beginB = beginOf(m_b.side(), b);
    for (found.placeA = beginOf(m_a.side(), a); found.placeA < a.end; found.placeA += kSide) {
      const std::uint32_t sizeA = std::min<std::uint32_t>(kSide, a.end - found.placeA);
      boxesA.load(m_a.side(), found.placeA, sizeA);
      const std::uint32_t rows = boxesA.near(boxB, sizeA, m_limit);
      if (rows == 0) continue;
      for (found.placeB = beginB; found.placeB < b.end; found.placeB += kSide) {
        const std::uint32_t sizeB = std::min<std::uint32_t>(kSide, b.end - found.placeB);
        boxesB.load(m_b.side(), found.placeB, sizeB);
        if (hasHeights()) m_b.copy(found.placeB, sizeB, boxesB.heights);
        std::uint32_t any = 0;
        found.near.fill(0);
        for (std::uint32_t bits = rows; bits; bits &= bits - 1) {
          const auto row = static_cast<std::uint32_t>(std::countr_zero(bits));
          found.near[row] = boxesB.near(boxesA[row], sizeB, m_limit);
          if (hasHeights() && found.near[row])
            found.near[row] &= boxesB.below(m_lowest, m_a[found.placeA + row]);
          any |= found.near[row];
        }
        if (any) setBound(m_test(m_context, found));
      }
    }
  }

  ElementHeights m_a, m_b;
  void* const m_context;
  const TestElements m_test;
  float m_limit = 0;   ///< of computed squared distances of boxes
  float m_lowest = 0;  ///< of computed sums of heights
  decltype(PairScratch::waiting)& m_waiting;
};

HWY_ATTR void searchPairsKernel(const PairSide& a, const PairSide& b, const PairBound& bound,
                                PairScratch& scratch, void* context, TestElements test) {
  PairDescent(a, b, scratch, context, test).run(bound);
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(searchPairsKernel);

void searchPairs(const PairSide& a, const PairSide& b, const PairBound& bound, PairScratch& scratch,
                 void* context, TestElements test) {
  a.octree.requireBuilt();
  b.octree.requireBuilt();
  PALPATE_ASSERT(bound.distance >= 0);
  HWY_DYNAMIC_DISPATCH(searchPairsKernel)(a, b, bound, scratch, context, test);
}

}  // namespace palpate
#endif
