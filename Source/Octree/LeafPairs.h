// For files with SIMD code, after Core/Simd.h: included once for each instruction set.
#if defined(PALPATE_OCTREE_LEAF_PAIRS) == defined(HWY_TARGET_TOGGLE)
#ifdef PALPATE_OCTREE_LEAF_PAIRS
#undef PALPATE_OCTREE_LEAF_PAIRS
#else
#define PALPATE_OCTREE_LEAF_PAIRS
#endif

#include "Octree/PlacedTrees.h"

#include <bit>
#include <limits>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

/// Elements of one node, in the tree's order.
struct LeafRange {
  std::uint32_t begin, end;
};

/// Finds the pairs of elements of two nodes whose bounds overlap.
template <Placement placement, int K>
class LeafPairs {
 public:
  using Trees = PlacedTrees<placement, K>;
  using Bounds = typename Trees::Bounds;

  LeafPairs(const TreePair& trees, PairSink& sink)
      : m_trees(trees),
        m_idsA(trees.a->order().data()),
        m_idsB(trees.b->order().data()),
        m_sink(sink) {}

  const Trees& trees() const { return m_trees; }

  /// Compares the elements of two nodes. bounds: of b's node.
  HWY_ATTR HWY_INLINE void compare(LeafRange a, LeafRange b, const Bounds& bounds) {
    Rows rows;
    for (std::size_t i = a.begin; i < a.end; i += Rows::kMost) {
      load(rows, i, a.end, bounds);
      if (rows.bits) compare<false>(rows, b);
    }
  }
  HWY_ATTR void compareWithin(LeafRange leaf) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    const FloatBox all{{-kInfinity, -kInfinity, -kInfinity, 0},
                       {kInfinity, kInfinity, kInfinity, 0}};
    Rows rows;
    for (std::size_t i = leaf.begin; i < leaf.end; i += Rows::kMost) {
      load(rows, i, leaf.end, all);
      compare<true>(rows, {static_cast<std::uint32_t>(i), leaf.end});
    }
  }

 private:
  /// Up to kMost elements of a, their bounds in b's frame.
  struct Rows {
    static constexpr std::size_t kMost = 16;
    alignas(64) float placed[2][K][kMost];
    const float *lower[K], *upper[K];  ///< in `placed`, or in the tree's boxes
    std::size_t first;                 ///< in a's order
    std::uint32_t bits;                ///< elements that may overlap the other leaf
  };

  /// Loads the elements from `first` on. Their bit is set if they overlap the bounds.
  HWY_ATTR HWY_INLINE void load(Rows& rows, std::size_t first, std::size_t end,
                                const Bounds& bounds) const {
    const LeafTag d;
    rows.first = first;
    rows.bits = 0;
    for (int k = 0; k < K; ++k) {
      const bool usesTreeBoxes = placement == Placement::None;
      rows.lower[k] = usesTreeBoxes ? &m_trees.elementsA().lower[k][first] : rows.placed[0][k];
      rows.upper[k] = usesTreeBoxes ? &m_trees.elementsA().upper[k][first] : rows.placed[1][k];
    }
    for (std::size_t lane = 0; lane < Rows::kMost && first + lane < end; lane += hn::Lanes(d)) {
      const std::size_t i = first + lane;
      const auto boxes = m_trees.placedA(BoxLanes<LeafTag, K>::load(m_trees.elementsA(), i));
      for (int k = 0; k < K && placement != Placement::None; ++k) {
        hn::Store(boxes.lower[k], d, rows.placed[0][k] + lane);
        hn::Store(boxes.upper[k], d, rows.placed[1][k] + lane);
      }
      rows.bits |= bitsOf(d, hn::And(hn::FirstN(d, end - i), boxes.overlapping(bounds))) << lane;
    }
  }

  /// Compares rows with a range of b. One vector of b stays in registers for all rows. kWithin:
  /// both are in one leaf, and each row is compared with the elements after it.
  template <bool kWithin>
  HWY_ATTR HWY_INLINE void compare(const Rows& rows, LeafRange b) {
    const TreePair& pair = m_trees.pair();
    const LeafTag d;
    const hn::RebindToUnsigned<LeafTag> du;
    for (std::size_t j = b.begin; j < b.end; j += hn::Lanes(d)) {
      BoxLanes<LeafTag> boxes = BoxLanes<LeafTag>::load(m_trees.elementsB(), j);
      if constexpr (K == 3) boxes = m_trees.placedB(boxes);
      const auto ids = hn::LoadU(du, m_idsB + j);
      hn::Vec<decltype(du)> corners[3];
      if (pair.adjacency)
        hn::LoadInterleaved3(du, pair.adjacency[j].data(), corners[0], corners[1], corners[2]);
      else
        corners[0] = corners[1] = corners[2] = hn::Zero(du);
      const auto inside = hn::FirstN(d, b.end - j);
      for (std::uint32_t bits = rows.bits; bits; bits &= bits - 1) {
        const auto lane = static_cast<unsigned>(std::countr_zero(bits));
        const std::size_t i = rows.first + lane;
        auto mask = inside;
        if (kWithin && i >= j) mask = hn::AndNot(hn::FirstN(d, i - j + 1), mask);
        for (int k = 0; k < 3; ++k) {
          mask = hn::And(mask, hn::Le(boxes.lower[k], hn::Set(d, rows.upper[k][lane])));
          mask = hn::And(mask, hn::Ge(boxes.upper[k], hn::Set(d, rows.lower[k][lane])));
        }
        if (hn::AllFalse(d, mask)) continue;
        if constexpr (K > 3) {
          for (int k = 3; k < K; ++k) {
            mask = hn::And(mask, hn::Le(hn::LoadU(d, m_trees.elementsB().lower[k] + j),
                                        hn::Set(d, rows.upper[k][lane])));
            mask = hn::And(mask, hn::Ge(hn::LoadU(d, m_trees.elementsB().upper[k] + j),
                                        hn::Set(d, rows.lower[k][lane])));
          }
          if (hn::AllFalse(d, mask)) continue;
        }
        auto found = hn::RebindMask(du, mask);
        if (pair.adjacency)
          for (const std::uint32_t corner : pair.adjacency[i])
            for (const auto& others : corners)
              found = hn::AndNot(hn::Eq(others, hn::Set(du, corner)), found);
        emit(hn::Set(du, m_idsA[i]), ids, found);
      }
    }
  }

  template <class V, class M>
  HWY_ATTR HWY_INLINE void emit(V a, V b, M found) {
    const TreePair& pair = m_trees.pair();
    const hn::DFromV<V> du;
    ElementPair* const out = m_sink.reserveSpace();
    if (K > 3 && pair.swapped) std::swap(a, b);
    if (pair.self()) {
      const V lower = hn::Min(a, b);
      b = hn::Max(a, b);
      a = lower;
    }
    if constexpr (HWY_TARGET == HWY_AVX2) {  // compression would need a table, slower than a loop
      alignas(32) std::uint32_t ids[2][8];
      hn::Store(a, du, ids[0]);
      hn::Store(b, du, ids[1]);
      std::size_t count = 0;
      for (std::uint32_t bits = bitsOf(du, found); bits; bits &= bits - 1) {
        const auto lane = static_cast<unsigned>(std::countr_zero(bits));
        out[count++] = {ids[0][lane], ids[1][lane]};
      }
      m_sink.advance(count);
    } else {
      if (pair.self() || (K > 3 && pair.swapped))
        a = hn::Compress(a, found);  // otherwise all lanes are equal
      hn::StoreInterleaved2(a, hn::Compress(b, found), du, reinterpret_cast<std::uint32_t*>(out));
      m_sink.advance(hn::CountTrue(du, found));
    }
  }

  const Trees m_trees;
  const std::uint32_t* m_idsA;
  const std::uint32_t* m_idsB;
  PairSink& m_sink;
};

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
