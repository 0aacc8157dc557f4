#pragma once

#include "Octree/Traversal.h"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace palpate::testing {

/// The pairs that a traversal finds, sorted. wanted: node pairs to start from.
inline std::vector<ElementPair> traversedPairs(const TreePair& trees, std::size_t wanted = 30) {
  TraversalStack stack;
  PairSink sink;
  sink.start(nullptr, nullptr);
  startPairs(trees, wanted, stack);
  const std::vector<NodePair> roots(stack.pairs.begin(), stack.pairs.end());
  traverse(trees, roots, stack, sink);
  std::vector<ElementPair> pairs(sink.kept().begin(), sink.kept().end());
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace palpate::testing
