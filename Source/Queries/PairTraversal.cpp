#include "Queries/PairTraversal.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/PairTraversal.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

class PairDescent {
 public:
  PairDescent(const PairSearch& search, void* context, TestElements test)
      : m_search(search), m_context(context), m_test(test) {}

  HWY_ATTR void run(float bound) {
    setBound(bound);
    push(0.0f, 0, 0);
    while (m_count > 0) {
      const Entry entry = m_entries[--m_count];
      if (entry.square > m_limit) continue;
      const FloatBox boxA = boxOf(m_search.a, m_search.mapA, entry.a),
                     boxB = boxOf(m_search.b, m_search.mapB, entry.b);
      const OctreeNode childA = childOf(m_search.a, entry.a), childB = childOf(m_search.b, entry.b);
      if (childA != 0 && (childB == 0 || sizeOf(boxA) >= sizeOf(boxB)))
        expand(m_search.a, m_search.mapA, entry.a, childA, boxB, entry.square,
               [&](float square, OctreeNode node) { push(square, node, entry.b); });
      else if (childB != 0)
        expand(m_search.b, m_search.mapB, entry.b, childB, boxA, entry.square,
               [&](float square, OctreeNode node) { push(square, entry.a, node); });
      else
        testElements(entry.a & ~kOwn, entry.b & ~kOwn, boxB);
    }
  }

 private:
  static constexpr std::size_t kSide = NearElements::kSide;
  /// The bit of a node of which only its own elements are left, without its children.
  static constexpr OctreeNode kOwn = 0x80000000u;
  struct Entry {
    float square;
    OctreeNode a, b;
  };

  void setBound(float bound) {
    // Computed squares are off by less than 2^-20 of themselves.
    m_limit = OutwardRounding::up(bound * bound * (1.0f + 0x1p-19f));
    if (!(m_limit >= 0)) m_limit = std::numeric_limits<float>::infinity();
  }
  void push(float square, OctreeNode a, OctreeNode b) { m_entries[m_count++] = {square, a, b}; }
  static OctreeNode childOf(const Octree& octree, OctreeNode node) {
    return node & kOwn ? 0 : octree.firstChild(node);
  }
  HWY_ATTR static FloatBox boxOf(const Octree& octree, const BoxMap& map, OctreeNode node) {
    return BoxLanes<BoxTag>::of(octree.box(node & ~kOwn)).mapped(map).first();
  }
  static float sizeOf(const FloatBox& box) {
    return (box.upper[0] - box.lower[0]) + (box.upper[1] - box.lower[1]) +
           (box.upper[2] - box.lower[2]);
  }

  /// Pushes the node's own elements and its children near the box, the nearest last.
  template <class Push>
  HWY_ATTR HWY_INLINE void expand(const Octree& octree, const BoxMap& map, OctreeNode node,
                                  OctreeNode child, const FloatBox& other, float square,
                                  Push&& push) {
    const std::size_t first = m_count;
    alignas(64) float squares[8];
    std::uint32_t bits = 0;
    const NodeTag d;
    for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
      const auto distances =
          BoxLanes<NodeTag>::load(octree.blocks()[child >> 3], i).mapped(map).distanceFrom(other);
      hn::Store(distances, d, squares + i);
      bits |= bitsOf(d, hn::Le(distances, hn::Set(d, m_limit))) << i;
    }
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<std::uint32_t>(std::countr_zero(bits));
      if (octree.isEmpty(child + slot)) continue;
      push(squares[slot], child + slot);
      for (std::size_t i = m_count - 1; i > first && m_entries[i - 1].square < squares[slot]; --i)
        std::swap(m_entries[i], m_entries[i - 1]);
    }
    const auto [begin, end] = octree.ownRange(node);
    if (begin < end) push(square, node | kOwn);
  }

  /// Boxes of elements, in the common floats.
  struct Boxes {
    alignas(64) float lower[3][kSide], upper[3][kSide];

    HWY_ATTR HWY_INLINE void load(const Octree& octree, const BoxMap& map, std::uint32_t first) {
      const LeafTag d;
      for (std::size_t i = 0; i < kSide; i += hn::Lanes(d)) {
        const auto boxes = BoxLanes<LeafTag>::load(octree.boxes(), first + i).mapped(map);
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
  };

  HWY_ATTR void testElements(OctreeNode a, OctreeNode b, const FloatBox& boxB) {
    NearElements found;
    Boxes boxesA, boxesB;
    const auto [beginA, endA] = m_search.a.ownRange(a);
    const auto [beginB, endB] = m_search.b.ownRange(b);
    for (found.placeA = beginA; found.placeA < endA; found.placeA += kSide) {
      boxesA.load(m_search.a, m_search.mapA, found.placeA);
      const std::uint32_t rows =
          boxesA.near(boxB, std::min<std::size_t>(kSide, endA - found.placeA), m_limit);
      if (rows == 0) continue;
      for (found.placeB = beginB; found.placeB < endB; found.placeB += kSide) {
        boxesB.load(m_search.b, m_search.mapB, found.placeB);
        const std::size_t size = std::min<std::size_t>(kSide, endB - found.placeB);
        std::uint32_t any = 0;
        found.near.fill(0);
        for (std::uint32_t bits = rows; bits; bits &= bits - 1) {
          const auto row = static_cast<std::uint32_t>(std::countr_zero(bits));
          any |= found.near[row] = boxesB.near(boxesA[row], size, m_limit);
        }
        if (any) setBound(m_test(m_context, found));
      }
    }
  }

  const PairSearch& m_search;
  void* const m_context;
  const TestElements m_test;
  float m_limit = 0;  ///< of computed squared distances of boxes
  std::size_t m_count = 0;
  // Eight entries remain on each of at most 61 levels of each octree.
  std::array<Entry, 1024> m_entries;
};

HWY_ATTR void searchPairsKernel(const PairSearch& search, float bound, void* context,
                                TestElements test) {
  PairDescent(search, context, test).run(bound);
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(searchPairsKernel);

void searchPairs(const PairSearch& search, float bound, void* context, TestElements test) {
  search.a.requireBuilt();
  search.b.requireBuilt();
  HWY_DYNAMIC_DISPATCH(searchPairsKernel)(search, bound, context, test);
}

}  // namespace palpate
#endif
