// For files with SIMD code, after Core/Simd.h: included once for each instruction set.
#if defined(PALPATE_OCTREE_PLACED_TREES) == defined(HWY_TARGET_TOGGLE)
#ifdef PALPATE_OCTREE_PLACED_TREES
#undef PALPATE_OCTREE_PLACED_TREES
#else
#define PALPATE_OCTREE_PLACED_TREES
#endif

#include "Octree/BoxLanes.h"
#include "Octree/Traversal.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

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

/// The bounds of two trees in the frame in which they are compared. K: the number of directions.
template <Placement placement, int K = 3>
class PlacedTrees {
 public:
  using Bounds = BoundsOf<K>;

  explicit PlacedTrees(const TreePair& trees)
      : m_pair(trees), m_boundsA(*trees.a), m_boundsB(*trees.b) {}

  const TreePair& pair() const { return m_pair; }
  const auto& elementsA() const { return m_boundsA.elements; }
  const auto& elementsB() const { return m_boundsB.elements; }

  template <class D>
  HWY_ATTR HWY_INLINE BoxLanes<D, K> placedA(const BoxLanes<D, K>& boxes) const {
    if constexpr (K > 3) {
      return boxes.mapped(m_pair.dops);
    } else {
      if (placement == Placement::None) return boxes;
      if (placement == Placement::Shifted)
        return boxes.shifted(m_pair.shiftLower, m_pair.shiftUpper);
      if (m_pair.mapA.count > 0) return boxes.mapped(m_pair.mapA);
      return boxes.unclamped().shifted(m_pair.shiftLower, m_pair.shiftUpper);
    }
  }
  template <class D>
  HWY_ATTR HWY_INLINE BoxLanes<D, K> placedB(const BoxLanes<D, K>& boxes) const {
    if constexpr (K == 3 && placement == Placement::Mapped)
      return m_pair.mapB.count > 0 ? boxes.mapped(m_pair.mapB) : boxes.unclamped();
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
    for (std::size_t i = 0; i < kChildren; i += hn::Lanes(d)) {
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
    alignas(32) float lower[K][kChildren];
    alignas(32) float upper[K][kChildren];
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
    for (std::size_t i = 0; i < kChildren; i += hn::Lanes(d)) {
      const auto boxes = placedA(BoxLanes<NodeTag, K>::load(siblings, i));
      for (int k = 0; k < K; ++k) {
        hn::Store(boxes.lower[k], d, out.lower[k] + i);
        hn::Store(boxes.upper[k], d, out.upper[k] + i);
      }
      bits |= bitsOf(d, boxes.overlapping(bounds)) << i;
    }
    return bits;
  }

 private:
  const TreePair& m_pair;
  const TreeBounds<K> m_boundsA, m_boundsB;
};

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
