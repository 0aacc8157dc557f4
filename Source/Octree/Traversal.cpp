#include "Octree/Traversal.h"

#include <bit>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/Traversal.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

/// Elements of one node, in the tree's order.
struct LeafRange {
  std::uint32_t begin, end;
};

/// How boxes are transformed: not at all, a's boxes are shifted, or the boxes of at least one tree
/// are mapped by a BoxMap. a's k-DOPs are mapped by a DopMap.
enum class Placement { None, Shifted, Mapped };

/// k-DOPs in the form of OctreeBlock and BoxArrays.
template <int K>
struct DopArrays {
  const float *lower[K], *upper[K];

  DopArrays(const OctreeBlock& block, const OctreeDops::Siblings* further) {
    for (int k = 0; k < 3; ++k) {
      lower[k] = block.lower[k];
      upper[k] = block.upper[k];
    }
    for (int k = 3; k < K; ++k) {
      lower[k] = further[k - 3].lower;
      upper[k] = further[k - 3].upper;
    }
  }
  DopArrays(const BoxArrays& boxes, const OctreeDops& dops) {
    for (int k = 0; k < K; ++k) {
      lower[k] = (k < 3 ? boxes.lower[k] : dops.lower[k]).data();
      upper[k] = (k < 3 ? boxes.upper[k] : dops.upper[k]).data();
    }
  }
};

/// The boxes of a tree, or its k-DOPs.
template <int K>
struct TreeBounds {
  explicit TreeBounds(const Octree& tree)
      : blocks(tree.blocks()), dops(tree.dops()), elements(tree.boxes(), tree.dops()) {}
  HWY_INLINE DopArrays<K> siblings(OctreeNode block) const {
    return {blocks[block], dops.block(block)};
  }

  const OctreeBlock* blocks;
  const OctreeDops& dops;
  const DopArrays<K> elements;
};
template <>
struct TreeBounds<3> {
  explicit TreeBounds(const Octree& tree) : blocks(tree.blocks()), elements(tree.boxes()) {}
  HWY_INLINE const OctreeBlock& siblings(OctreeNode block) const { return blocks[block]; }

  const OctreeBlock* blocks;
  const BoxArrays& elements;
};

/// K: the number of directions of the bounds.
template <Placement placement, int K = 3>
class Walk {
 public:
  Walk(const TreePair& trees, TraversalStack& stack, PairSink& sink)
      : m_trees(trees),
        m_a(trees.a->blocks()),
        m_b(trees.b->blocks()),
        m_boundsA(*trees.a),
        m_boundsB(*trees.b),
        m_idsA(trees.a->order().data()),
        m_idsB(trees.b->order().data()),
        m_stack(stack.pairs),
        m_sink(sink) {}

  HWY_ATTR bool rootsOverlap() const { return overlaps(0, boundsOfA(0)) & 1; }

  HWY_ATTR void all(std::size_t bottom) {
    while (m_stack.size() > bottom) {
      const NodePair pair = m_stack.back();
      m_stack.pop_back();
      step(pair);
    }
  }

  /// Whether a pair has only elements below it.
  bool isLast(NodePair pair) const { return isLeaf(m_a, pair.a) && isLeaf(m_b, pair.b); }

  /// Replaces a node pair by the pairs below it. Two leaves are replaced by the pairs of their
  /// elements.
  HWY_ATTR void step(NodePair pair) {
    const bool leafA = isLeaf(m_a, pair.a), leafB = isLeaf(m_b, pair.b);
    if constexpr (K == 3) {
      if (m_trees.self() && pair.a == pair.b)
        return leafA ? compareWithinLeaf(range(*m_trees.a, pair.a)) : descendWithinNode(pair.a);
    }
    if (leafA && leafB)
      compareLeaves(pair);
    else if (leafA)
      descendB(pair);
    else if (leafB)
      descendA(pair);
    else
      descendLarger(pair);
  }

 private:
  static bool isLeaf(const OctreeBlock* blocks, OctreeNode node) {
    return node & NodePair::kOwn || blocks[blockOf(node)].isLeaf(slotOf(node));
  }
  static LeafRange range(const Octree& tree, OctreeNode node) {
    const auto [begin, end] = tree.ownRange(node & ~NodePair::kOwn);
    return {begin, end};
  }

  using Bounds = BoundsOf<K>;

  template <class D>
  HWY_ATTR HWY_INLINE BoxLanes<D, K> placedA(const BoxLanes<D, K>& boxes) const {
    if constexpr (K > 3) {
      return boxes.mapped(m_trees.dops);
    } else {
      if (placement == Placement::None) return boxes;
      if (placement == Placement::Shifted)
        return boxes.shifted(m_trees.shiftLower, m_trees.shiftUpper);
      if (m_trees.mapA.count > 0) return boxes.mapped(m_trees.mapA);
      return boxes.unclamped().shifted(m_trees.shiftLower, m_trees.shiftUpper);
    }
  }
  template <class D>
  HWY_ATTR HWY_INLINE BoxLanes<D, K> placedB(const BoxLanes<D, K>& boxes) const {
    if constexpr (K == 3 && placement == Placement::Mapped)
      return m_trees.mapB.count > 0 ? boxes.mapped(m_trees.mapB) : boxes.unclamped();
    return boxes;
  }

  /// The bounds of one node of a, in the frame in which they are compared.
  HWY_ATTR HWY_INLINE Bounds boundsOfA(OctreeNode node) const {
    return placedA(BoxLanes<BoxTag, K>::load(m_boundsA.siblings(blockOf(node)), slotOf(node)))
        .first();
  }
  HWY_ATTR HWY_INLINE Bounds boundsOfB(OctreeNode node) const {
    return placedB(BoxLanes<BoxTag, K>::load(m_boundsB.siblings(blockOf(node)), slotOf(node)))
        .first();
  }

  /// Bit i: child i of b's block overlaps the bounds.
  HWY_ATTR HWY_INLINE std::uint32_t overlaps(OctreeNode block, const Bounds& bounds) const {
    const NodeTag d;
    const auto& siblings = m_boundsB.siblings(block);
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
      if constexpr (K == 3) {
        bits |= bitsOf(d, placedB(BoxLanes<NodeTag>::load(siblings, i)).overlapping(bounds)) << i;
      } else {
        auto mask = hn::FirstN(d, 8);
        const auto compare = [&](int k) HWY_ATTR {
          mask = hn::And(mask,
                         hn::Le(hn::Load(d, siblings.lower[k] + i), hn::Set(d, bounds.upper[k])));
          mask = hn::And(mask,
                         hn::Ge(hn::Load(d, siblings.upper[k] + i), hn::Set(d, bounds.lower[k])));
        };
        for (int k = 0; k < 3; ++k) compare(k);
        if (hn::AllFalse(d, mask)) continue;
        for (int k = 3; k < K; ++k) compare(k);
        bits |= bitsOf(d, mask) << i;
      }
    }
    return bits;
  }

  struct PlacedBlock {
    alignas(32) float lower[K][8];
    alignas(32) float upper[K][8];
    Bounds bounds(unsigned slot) const {
      Bounds bounds;
      for (int k = 0; k < K; ++k) {
        bounds.lower[k] = lower[k][slot];
        bounds.upper[k] = upper[k][slot];
      }
      return bounds;
    }
  };

  /// Places the bounds of the eight children in a's block. Returns which of them overlap b's node.
  HWY_ATTR std::uint32_t placeBlock(OctreeNode block, OctreeNode nodeB, PlacedBlock& out) const {
    const NodeTag d;
    const Bounds bounds = boundsOfB(nodeB);
    const auto& siblings = m_boundsA.siblings(block);
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
      const auto boxes = placedA(BoxLanes<NodeTag, K>::load(siblings, i));
      for (int k = 0; k < K; ++k) {
        hn::Store(boxes.lower[k], d, out.lower[k] + i);
        hn::Store(boxes.upper[k], d, out.upper[k] + i);
      }
      bits |= bitsOf(d, boxes.overlapping(bounds)) << i;
    }
    return bits;
  }

  static bool hasOwn(const OctreeBlock* blocks, OctreeNode node) {
    const OctreeBlock& block = blocks[blockOf(node)];
    return block.begin[slotOf(node)] != blocks[block.child[slotOf(node)]].begin[0];
  }

  void push(OctreeNode a, OctreeNode b) { m_stack.push_back({a, b}); }

  void pushChildrenOfB(OctreeNode a, OctreeNode blockB, std::uint32_t bits) {
    for (; bits; bits &= bits - 1)
      push(a, nodeOf(blockB, static_cast<unsigned>(std::countr_zero(bits))));
  }

  static float extent(const OctreeBlock* blocks, OctreeNode node) {
    const OctreeBlock& block = blocks[blockOf(node)];
    const unsigned slot = slotOf(node);
    float longest = 0;
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, block.upper[k][slot] - block.lower[k][slot]);
    return longest;
  }

  /// Descends into a much larger node alone. Otherwise the smaller node would be at its leaves
  /// before the larger one has reached its size.
  HWY_ATTR void descendLarger(NodePair pair) {
    const float a = extent(m_a, pair.a), b = extent(m_b, pair.b);
    if (a > 2 * b)
      descendA(pair);
    else if (b > 2 * a)
      descendB(pair);
    else
      descendBoth(pair);
  }

  HWY_ATTR void descendB(NodePair pair) {
    const OctreeNode nodeA = pair.a & ~NodePair::kOwn;
    const OctreeNode child = m_b[blockOf(pair.b)].child[slotOf(pair.b)];
    if (hasOwn(m_b, pair.b)) push(pair.a, pair.b | NodePair::kOwn);
    pushChildrenOfB(pair.a, child, overlaps(child, boundsOfA(nodeA)));
  }

  HWY_ATTR void descendA(NodePair pair) {
    const OctreeNode nodeB = pair.b & ~NodePair::kOwn;
    const OctreeNode child = m_a[blockOf(pair.a)].child[slotOf(pair.a)];
    if (hasOwn(m_a, pair.a)) push(pair.a | NodePair::kOwn, pair.b);
    PlacedBlock block;
    std::uint32_t bits = placeBlock(child, nodeB, block);
    for (; bits; bits &= bits - 1)
      push(nodeOf(child, static_cast<unsigned>(std::countr_zero(bits))), pair.b);
  }

  HWY_ATTR void descendBoth(NodePair pair) {
    const OctreeNode childA = m_a[blockOf(pair.a)].child[slotOf(pair.a)],
                     childB = m_b[blockOf(pair.b)].child[slotOf(pair.b)];
    const bool ownB = hasOwn(m_b, pair.b);
    if (hasOwn(m_a, pair.a)) push(pair.a | NodePair::kOwn, pair.b);
    PlacedBlock block;
    std::uint32_t bits = placeBlock(childA, pair.b, block);
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<unsigned>(std::countr_zero(bits));
      const OctreeNode a = nodeOf(childA, slot);
      if (ownB) push(a, pair.b | NodePair::kOwn);
      pushChildrenOfB(a, childB, overlaps(childB, block.bounds(slot)));
    }
  }

  HWY_ATTR void descendWithinNode(OctreeNode node) {
    const OctreeNode child = m_a[blockOf(node)].child[slotOf(node)];
    const bool own = hasOwn(m_a, node);
    if (own) push(node | NodePair::kOwn, node | NodePair::kOwn);
    PlacedBlock block;
    std::uint32_t bits = placeBlock(child, node, block);
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<unsigned>(std::countr_zero(bits));
      const OctreeNode a = nodeOf(child, slot);
      if (own) push(node | NodePair::kOwn, a);
      push(a, a);
      pushChildrenOfB(a, child, overlaps(child, block.bounds(slot)) & ~((2u << slot) - 1));
    }
  }

  /// Up to kMost elements of a, their bounds in b's frame.
  struct Rows {
    static constexpr std::size_t kMost = 16;
    alignas(64) float placed[2][K][kMost];
    const float *lower[K], *upper[K];  ///< in `placed`, or in the tree's boxes
    std::size_t first;                 ///< in a's order
    std::uint32_t bits;                ///< elements that may overlap the other leaf
  };

  HWY_ATTR HWY_INLINE void compareLeaves(NodePair pair) {
    const LeafRange a = range(*m_trees.a, pair.a), b = range(*m_trees.b, pair.b);
    const Bounds bounds = boundsOfB(pair.b & ~NodePair::kOwn);
    Rows rows;
    for (std::size_t i = a.begin; i < a.end; i += Rows::kMost) {
      load(rows, i, a.end, bounds);
      if (rows.bits) compare<false>(rows, b);
    }
  }

  HWY_ATTR void compareWithinLeaf(LeafRange leaf) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    const FloatBox all{{-kInfinity, -kInfinity, -kInfinity, 0},
                       {kInfinity, kInfinity, kInfinity, 0}};
    Rows rows;
    for (std::size_t i = leaf.begin; i < leaf.end; i += Rows::kMost) {
      load(rows, i, leaf.end, all);
      compare<true>(rows, {static_cast<std::uint32_t>(i), leaf.end});
    }
  }

  /// Loads the elements from `first` on. Their bit is set if they overlap the bounds.
  HWY_ATTR HWY_INLINE void load(Rows& rows, std::size_t first, std::size_t end,
                                const Bounds& bounds) const {
    const LeafTag d;
    rows.first = first;
    rows.bits = 0;
    for (int k = 0; k < K; ++k) {
      const bool usesTreeBoxes = placement == Placement::None;
      rows.lower[k] = usesTreeBoxes ? &m_boundsA.elements.lower[k][first] : rows.placed[0][k];
      rows.upper[k] = usesTreeBoxes ? &m_boundsA.elements.upper[k][first] : rows.placed[1][k];
    }
    for (std::size_t lane = 0; lane < Rows::kMost && first + lane < end; lane += hn::Lanes(d)) {
      const std::size_t i = first + lane;
      const auto boxes = placedA(BoxLanes<LeafTag, K>::load(m_boundsA.elements, i));
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
    const LeafTag d;
    const hn::RebindToUnsigned<LeafTag> du;
    for (std::size_t j = b.begin; j < b.end; j += hn::Lanes(d)) {
      BoxLanes<LeafTag> boxes = BoxLanes<LeafTag>::load(m_boundsB.elements, j);
      if constexpr (K == 3) boxes = placedB(boxes);
      const auto ids = hn::LoadU(du, m_idsB + j);
      hn::Vec<decltype(du)> corners[3];
      if (m_trees.adjacency)
        hn::LoadInterleaved3(du, m_trees.adjacency[j].data(), corners[0], corners[1], corners[2]);
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
            mask = hn::And(mask, hn::Le(hn::LoadU(d, m_boundsB.elements.lower[k] + j),
                                        hn::Set(d, rows.upper[k][lane])));
            mask = hn::And(mask, hn::Ge(hn::LoadU(d, m_boundsB.elements.upper[k] + j),
                                        hn::Set(d, rows.lower[k][lane])));
          }
          if (hn::AllFalse(d, mask)) continue;
        }
        auto found = hn::RebindMask(du, mask);
        if (m_trees.adjacency)
          for (const std::uint32_t corner : m_trees.adjacency[i])
            for (const auto& others : corners)
              found = hn::AndNot(hn::Eq(others, hn::Set(du, corner)), found);
        emit(hn::Set(du, m_idsA[i]), ids, found);
      }
    }
  }

  template <class V, class M>
  HWY_ATTR HWY_INLINE void emit(V a, V b, M found) {
    const hn::DFromV<V> du;
    ElementPair* const out = m_sink.reserveSpace();
    if (K > 3 && m_trees.swapped) std::swap(a, b);
    if (m_trees.self()) {
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
      if (m_trees.self() || (K > 3 && m_trees.swapped))
        a = hn::Compress(a, found);  // otherwise all lanes are equal
      hn::StoreInterleaved2(a, hn::Compress(b, found), du, reinterpret_cast<std::uint32_t*>(out));
      m_sink.advance(hn::CountTrue(du, found));
    }
  }

  const TreePair& m_trees;
  const OctreeBlock* m_a;
  const OctreeBlock* m_b;
  const TreeBounds<K> m_boundsA, m_boundsB;
  const std::uint32_t* m_idsA;
  const std::uint32_t* m_idsB;
  Buffer<NodePair>& m_stack;
  PairSink& m_sink;
};

/// A function of its own, so that the compiler inlines the others as before.
template <class F>
HWY_NOINLINE HWY_ATTR void withDops(const TreePair& trees, TraversalStack& stack, PairSink& sink,
                                    F&& f) {
  if (trees.dops.directions == 7)
    f(Walk<Placement::Mapped, 7>(trees, stack, sink));
  else
    f(Walk<Placement::Mapped, 9>(trees, stack, sink));
}

template <class F>
HWY_ATTR void withWalk(const TreePair& trees, TraversalStack& stack, PairSink& sink, F&& f) {
  if (trees.dops.count > 0)
    withDops(trees, stack, sink, f);
  else if (trees.isMapped())
    f(Walk<Placement::Mapped>(trees, stack, sink));
  else if (trees.isShifted())
    f(Walk<Placement::Shifted>(trees, stack, sink));
  else
    f(Walk<Placement::None>(trees, stack, sink));
}

template <class W>
HWY_ATTR void start(W& walk, std::size_t wanted, TraversalStack& stack) {
  stack.pairs.clear();
  if (!walk.rootsOverlap()) return;
  stack.pairs.push_back({0, 0});
  // Proceeds level by level. Each round replaces every pair that is not two leaves by the pairs
  // below it.
  for (bool progress = true; progress && stack.pairs.size() < wanted;) {
    progress = false;
    stack.level.swap(stack.pairs);
    stack.pairs.clear();
    for (const NodePair pair : stack.level) {
      if (walk.isLast(pair)) {
        stack.pairs.push_back(pair);
      } else {
        walk.step(pair);
        progress = true;
      }
    }
  }
}

HWY_ATTR void startPairsKernel(const TreePair& trees, std::size_t wanted, TraversalStack& stack) {
  PairSink none;
  withWalk(trees, stack, none, [&](auto&& walk) HWY_ATTR { start(walk, wanted, stack); });
}

HWY_ATTR void traverseKernel(const TreePair& trees, std::span<const NodePair> pairs,
                             TraversalStack& stack, PairSink& sink) {
  stack.pairs.assign(pairs.rbegin(), pairs.rend());
  withWalk(trees, stack, sink, [](auto&& walk) HWY_ATTR { walk.all(0); });
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(startPairsKernel);
HWY_EXPORT(traverseKernel);

void setShift(TreePair& trees, const std::array<double, 3>& offset, double thickness) {
  setShift(trees.shiftLower, trees.shiftUpper, offset, thickness);
}

void startPairs(const TreePair& trees, std::size_t wanted, TraversalStack& stack) {
  trees.a->requireBuilt();
  trees.b->requireBuilt();
  HWY_DYNAMIC_DISPATCH(startPairsKernel)(trees, wanted, stack);
}

void traverse(const TreePair& trees, std::span<const NodePair> pairs, TraversalStack& stack,
              PairSink& sink) {
  trees.a->requireBuilt();
  trees.b->requireBuilt();
  HWY_DYNAMIC_DISPATCH(traverseKernel)(trees, pairs, stack, sink);
}

}  // namespace palpate
#endif
