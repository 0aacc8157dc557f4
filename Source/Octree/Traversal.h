#pragma once

#include <palpate/Types.h>

#include "Core/Buffer.h"
#include "Math/Box.h"
#include "Octree/BoxMap.h"
#include "Octree/Octree.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// Two nodes whose boxes overlap. kOwn in one: only the elements that the node holds itself.
struct NodePair {
  static constexpr OctreeNode kOwn = 0x80000000u;
  OctreeNode a, b;
};

/// Found pairs: handed on in batches, or kept until taken where there is no function to hand them
/// to. After an exception, start() again: it forgets what was found.
class PairSink {
 public:
  using Function = void (*)(void* context, std::span<const ElementPair>);
  static constexpr std::size_t kBatch = 4096;
  static constexpr std::size_t kMostAtOnce = 16;  ///< pairs that room() makes room for

  void start(Function function, void* context) {
    m_function = function;
    m_context = context;
    m_size = 0;
    m_total = 0;
    m_pairs.resize(std::max(m_pairs.capacity(), kBatch));
  }
  /// Room for kMostAtOnce pairs; advance() says how many were written.
  ElementPair* room() {
    if (m_size + kMostAtOnce > m_pairs.size()) {
      if (m_function) flush();
      if (m_size + kMostAtOnce > m_pairs.size())
        m_pairs.resize(std::max({2 * m_pairs.size(), m_size + kMostAtOnce, kBatch}));
    }
    return m_pairs.data() + m_size;
  }
  void advance(std::size_t count) { m_size += count; }
  void flush() {
    if (m_function && m_size > 0) {
      m_function(m_context, std::span(m_pairs).first(m_size));
      m_total += m_size;
      m_size = 0;
    }
  }
  std::span<const ElementPair> kept() const { return std::span(m_pairs).first(m_size); }
  /// Takes what was kept, in exchange for a buffer to fill next time.
  void takeKept(Buffer<ElementPair>& pairs) {
    m_pairs.resize(m_size);
    m_pairs.swap(pairs);
    m_size = 0;
  }
  std::size_t total() const { return m_total + m_size; }
  std::size_t bytes() const { return m_pairs.capacity() * sizeof(ElementPair); }

 private:
  Buffer<ElementPair> m_pairs;
  std::size_t m_size = 0, m_total = 0;
  Function m_function = nullptr;
  void* m_context = nullptr;
};

/// One pair of octrees (or one octree with itself), with what brings a's boxes into b's frame.
struct TreePair {
  const Octree* a;
  const Octree* b;  ///< the same one: each unordered pair once, a < b
  /// Triangles in the order of each tree, readable BoxArrays::kPadding past their end: pairs that
  /// share a vertex are left out. Null: nothing is.
  const Triangle* adjacency = nullptr;
  /// Added to a's bounds: the distance between the frames, and half the thickness on each side
  /// twice.
  std::array<float, 4> shiftLower{}, shiftUpper{};
  /// Where a tree is of a rigid body that was moved, what brings its boxes into the world; a's then
  /// in place of the shift. Not of one tree with itself.
  BoxMap mapA{}, mapB{};

  bool self() const { return a == b; }
  bool turned() const { return mapA.count > 0 || mapB.count > 0; }
  bool shifted() const {
    const std::array<float, 4> none{};
    return shiftLower != none || shiftUpper != none;
  }
};

/// Shifts of a's boxes for frames whose origins are `offset` apart (a's minus b's, in units of the
/// frame), and a thickness.
void setShift(TreePair&, const std::array<double, 3>& offset, double thickness);

/// Scratch of one traversal, which remembers its peak. Each traversal overwrites it first, so one
/// that an exception ended leaves nothing to the next.
struct TraversalStack {
  Buffer<NodePair> pairs, level;
};

/// The node pairs to start from, into stack.pairs: none if the roots do not overlap; else at least
/// `wanted` if the trees are large enough, found breadth first. Throws if a tree is not built, as
/// traverse() does.
void startPairs(const TreePair&, std::size_t wanted, TraversalStack&);

/// All element pairs below the node pairs whose boxes overlap. Empties the span's pairs depth
/// first.
/// Cost     about a nanosecond for each eight boxes compared.
void traverse(const TreePair&, std::span<const NodePair>, TraversalStack&, PairSink&);

}  // namespace palpate
