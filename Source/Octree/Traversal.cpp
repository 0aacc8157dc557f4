#include "Octree/Traversal.h"

#include "Core/Assert.h"

#include <algorithm>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/Traversal.cpp"
#include "Core/Simd.h"
#include "Octree/LeafPairs.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

/// K: the number of directions of the bounds.
template <Placement placement, int K = 3>
class PairWalk {
 public:
  PairWalk(const TreePair& trees, TraversalStack& stack, PairSink& sink)
      : m_pair(trees),
        m_a(trees.a->blocks()),
        m_b(trees.b->blocks()),
        m_leaves(trees, sink),
        m_stack(stack.pairs) {}

  HWY_ATTR bool rootsOverlap() const { return trees().overlaps(0, trees().boundsOfA(0)) & 1; }

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
      if (m_pair.self() && pair.a == pair.b)
        return leafA ? m_leaves.compareWithin(range(*m_pair.a, pair.a)) : descendWithinNode(pair.a);
    }
    if (leafA && leafB)
      m_leaves.compare(range(*m_pair.a, pair.a), range(*m_pair.b, pair.b),
                       trees().boundsOfB(pair.b & ~NodePair::kOwn));
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

  using Trees = PlacedTrees<placement, K>;

  const Trees& trees() const { return m_leaves.trees(); }

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
    pushChildrenOfB(pair.a, child, trees().overlaps(child, trees().boundsOfA(nodeA)));
  }

  HWY_ATTR void descendA(NodePair pair) {
    const OctreeNode nodeB = pair.b & ~NodePair::kOwn;
    const OctreeNode child = m_a[blockOf(pair.a)].child[slotOf(pair.a)];
    if (hasOwn(m_a, pair.a)) push(pair.a | NodePair::kOwn, pair.b);
    typename Trees::PlacedBlock block;
    std::uint32_t bits = trees().placeBlock(child, nodeB, block);
    for (; bits; bits &= bits - 1)
      push(nodeOf(child, static_cast<unsigned>(std::countr_zero(bits))), pair.b);
  }

  HWY_ATTR void descendBoth(NodePair pair) {
    const OctreeNode childA = m_a[blockOf(pair.a)].child[slotOf(pair.a)],
                     childB = m_b[blockOf(pair.b)].child[slotOf(pair.b)];
    const bool ownB = hasOwn(m_b, pair.b);
    if (hasOwn(m_a, pair.a)) push(pair.a | NodePair::kOwn, pair.b);
    typename Trees::PlacedBlock block;
    std::uint32_t bits = trees().placeBlock(childA, pair.b, block);
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<unsigned>(std::countr_zero(bits));
      const OctreeNode a = nodeOf(childA, slot);
      if (ownB) push(a, pair.b | NodePair::kOwn);
      pushChildrenOfB(a, childB, trees().overlaps(childB, block.bounds(slot)));
    }
  }

  HWY_ATTR void descendWithinNode(OctreeNode node) {
    const OctreeNode child = m_a[blockOf(node)].child[slotOf(node)];
    const bool own = hasOwn(m_a, node);
    if (own) push(node | NodePair::kOwn, node | NodePair::kOwn);
    typename Trees::PlacedBlock block;
    std::uint32_t bits = trees().placeBlock(child, node, block);
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<unsigned>(std::countr_zero(bits));
      const OctreeNode a = nodeOf(child, slot);
      if (own) push(node | NodePair::kOwn, a);
      push(a, a);
      pushChildrenOfB(a, child, trees().overlaps(child, block.bounds(slot)) & ~((2u << slot) - 1));
    }
  }

  const TreePair& m_pair;
  const OctreeBlock* m_a;
  const OctreeBlock* m_b;
  LeafPairs<placement, K> m_leaves;
  Buffer<NodePair>& m_stack;
};

/// A function of its own, so that the compiler inlines the others as before.
template <class F>
HWY_NOINLINE HWY_ATTR void withDops(const TreePair& trees, TraversalStack& stack, PairSink& sink,
                                    F&& f) {
  PALPATE_ASSERT(!trees.self() && (trees.dops.directions == 7 || trees.dops.directions == 9));
  if (trees.dops.directions == 7)
    f(PairWalk<Placement::Mapped, 7>(trees, stack, sink));
  else
    f(PairWalk<Placement::Mapped, 9>(trees, stack, sink));
}

template <class F>
HWY_ATTR void withWalk(const TreePair& trees, TraversalStack& stack, PairSink& sink, F&& f) {
  if (trees.dops.count > 0)
    withDops(trees, stack, sink, f);
  else if (trees.isMapped())
    f(PairWalk<Placement::Mapped>(trees, stack, sink));
  else if (trees.isShifted())
    f(PairWalk<Placement::Shifted>(trees, stack, sink));
  else
    f(PairWalk<Placement::None>(trees, stack, sink));
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
  PALPATE_ASSERT(!trees.swapped || !trees.self());
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
  PALPATE_ASSERT(std::all_of(pairs.begin(), pairs.end(), [&](NodePair pair) {
    return blockOf(pair.a & ~NodePair::kOwn) < trees.a->pool().used() &&
           blockOf(pair.b & ~NodePair::kOwn) < trees.b->pool().used();
  }));
  HWY_DYNAMIC_DISPATCH(traverseKernel)(trees, pairs, stack, sink);
}

}  // namespace palpate
#endif
