#pragma once

#include "Octree/BoxMap.h"
#include "Octree/Octree.h"
#include "Core/Buffer.h"

#include <cstddef>
#include <cstdint>

namespace palpate {

/// Scratch of point queries, which keeps its peak capacity. Each query clears it first, so that a
/// query that ended with an exception does not affect the next one.
struct PointQueryStack {
  Buffer<OctreeNode> nodes;
  Buffer<std::uint32_t> found;     ///< of findOverlapping()
  std::size_t exactDecisions = 0;  ///< of all queries, until the caller clears it
};

/// Descends from the root into the nodes that `enter(node)` accepts. It calls enter() for each node
/// that is not empty if the parent was accepted. It calls f(begin, end) with the range of the
/// octree's order that each accepted node holds itself. This and all queries below throw if the
/// octree is not built.
template <class Enter, class F>
void forEachEntered(const Octree& octree, Enter&& enter, PointQueryStack& stack, F&& f) {
  octree.requireBuilt();
  stack.nodes.clear();
  if (enter(OctreeNode{0})) stack.nodes.push_back(0);
  while (!stack.nodes.empty()) {
    const OctreeNode node = stack.nodes.back();
    stack.nodes.pop_back();
    const auto [begin, end] = octree.ownRange(node);
    if (begin < end) f(begin, end);
    const OctreeNode first = octree.firstChild(node);
    for (unsigned slot = 0; first != 0 && slot < 8; ++slot)
      if (!octree.isEmpty(first + slot) && enter(first + slot)) stack.nodes.push_back(first + slot);
  }
}

/// Calls f(begin, end) for ranges of the octree's order that together hold every element whose box
/// `overlaps` accepts. A box around an accepted box must be accepted, too.
template <class Overlaps, class F>
void forEachOverlapping(const Octree& octree, Overlaps&& overlaps, PointQueryStack& stack, F&& f) {
  forEachEntered(
      octree, [&](OctreeNode node) { return overlaps(octree.box(node)); }, stack, f);
}

/// Finds the elements whose boxes, as the map places them, overlap `box`. Their places in the
/// octree's order are written to stack.found.
void findOverlapping(const Octree&, const BoxMap&, const FloatBox& box, PointQueryStack& stack);

}  // namespace palpate
