#pragma once

#include <palpate/Types.h>

#include "Octree/BoxMap.h"
#include "Octree/Dops.h"
#include "Octree/Octree.h"
#include "Math/Box.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// Two nodes whose boxes overlap. With the bit kOwn, a node stands only for the elements that it
/// holds itself.
struct NodePair {
  static constexpr OctreeNode kOwn = 0x80000000u;
  OctreeNode a, b;
};

/// Receives the pairs that were found. They are passed to a function in batches, or kept if
/// there is no function. start() discards earlier pairs; it is required after an
/// exception.
class PairSink {
 public:
  using Function = void (*)(void* context, std::span<const ElementPair>);
  static constexpr std::size_t kBatch = 4096, kSmallBatch = 512;
  static constexpr std::size_t kMaxAtOnce = 16;  ///< pairs for which reserveSpace() reserves space

  /// With a deadline, batches are small, so that the function is called often.
  void start(Function function, void* context) {
    m_function = function;
    m_context = context;
    m_size = 0;
    m_total = 0;
    m_pairs.resize(!function   ? std::max(m_pairs.capacity(), kBatch)
                   : isTimed() ? kSmallBatch
                               : kBatch);
  }
  /// Returns space for kMaxAtOnce pairs. Call advance() with the number of pairs written there.
  ElementPair* reserveSpace() {
    if (m_size + kMaxAtOnce > m_pairs.size()) {
      if (m_function) flush();
      if (m_size + kMaxAtOnce > m_pairs.size())
        m_pairs.resize(std::max({2 * m_pairs.size(), m_size + kMaxAtOnce, kBatch}));
    }
    return m_pairs.data() + m_size;
  }
  void advance(std::size_t count) {
    PALPATE_ASSERT(count <= kMaxAtOnce && m_size + count <= m_pairs.size());
    m_size += count;
  }
  void flush() {
    if (m_function && m_size > 0) {
      m_function(m_context, std::span(m_pairs).first(m_size));
      m_total += m_size;
      m_size = 0;
    }
  }
  std::span<const ElementPair> kept() const { return std::span(m_pairs).first(m_size); }
  std::size_t total() const { return m_total + m_size; }
  std::size_t bytes() const { return m_pairs.capacity() * sizeof(ElementPair); }

 private:
  Buffer<ElementPair> m_pairs;
  std::size_t m_size = 0, m_total = 0;
  Function m_function = nullptr;
  void* m_context = nullptr;
};

/// One pair of octrees (or one octree with itself), with the transformation from a's frame to b's
/// frame.
struct TreePair {
  const Octree* a;
  const Octree* b;  ///< if equal to a: each unordered pair once, a < b
  /// Triangles in the order of each tree, readable BoxArrays::kPadding past their end. Pairs that
  /// share a vertex are not reported. Null: all pairs are.
  const Triangle* adjacency = nullptr;
  /// Added to a's bounds: the offset between the frames, and the thickness on each side.
  std::array<float, 4> shiftLower{}, shiftUpper{};
  /// For a rigid body that was moved, the map that brings the tree's boxes into the world. mapA
  /// then replaces the shift. Not used for one tree with itself.
  BoxMap mapA{}, mapB{};
  /// If it has ends, as mapA or mapB then has: the map of a's k-DOPs into the frame of b's, which
  /// are compared instead of boxes. Not used for one tree with itself.
  DopMap dops{};
  bool swapped = false;  ///< with `dops`: each element pair names b's element first

  bool self() const { return a == b; }
  /// Whether a box of either tree was clamped to float's range. Clamped bounds in two frames are
  /// not comparable. Not used for one tree with itself.
  bool isClamped = false;

  bool isMapped() const { return mapA.count > 0 || mapB.count > 0 || isClamped; }
  bool isShifted() const {
    const std::array<float, 4> none{};
    return shiftLower != none || shiftUpper != none;
  }
};

/// Sets the shifts of a's boxes. offset: a's origin minus b's, in units of the frame.
void setShift(TreePair&, const std::array<double, 3>& offset, double thickness);

/// Scratch of one traversal, which keeps its peak capacity. Each traversal overwrites it first, so
/// that a traversal that ended with an exception does not affect the next one.
struct TraversalStack {
  Buffer<NodePair> pairs, level;
};

/// Writes the node pairs to start from to stack.pairs. If the roots do not overlap there are none,
/// else there are at least `wanted` if the trees are large enough. They are found breadth first.
/// Throws if a tree is not built, as traverse() does.
void startPairs(const TreePair&, std::size_t wanted, TraversalStack&);

/// Finds all element pairs below the given node pairs whose boxes overlap, depth first.
/// Cost     about a nanosecond for each eight boxes compared.
void traverse(const TreePair&, std::span<const NodePair>, TraversalStack&, PairSink&);

}  // namespace palpate
