#pragma once

#include "Octree/BoxMap.h"
#include "Octree/Octree.h"
#include "Octree/Walk.h"
#include "Core/Buffer.h"

#include <cstddef>
#include <cstdint>

namespace palpate {

/// Scratch of point queries, which keeps its peak capacity. Each query clears it first, so that a
/// query that ended with an exception does not affect the next one.
struct PointQueryStack {
  Buffer<std::uint32_t> found;     ///< of findOverlapping()
  std::size_t exactDecisions = 0;  ///< of all queries, until the caller clears it
};

/// Descends from the root into the nodes that `enter(node)` accepts. It calls enter() for each node
/// that is not empty if the parent was accepted. It calls f(begin, end) with the range of the
/// octree's order that each accepted node holds itself. This and all queries below throw if the
/// octree is not built.
template <class Enter, class F>
void forEachEntered(const Octree& octree, Enter&& enter, F&& f) {
  octree.requireBuilt();
  if (!enter(OctreeNode{0})) return;
  for (Walk walk(octree); walk.next();) {
    if (walk.begin() < walk.end()) f(walk.begin(), walk.end());
    if (!walk.hasChildren()) continue;
    std::uint32_t bits = 0;
    for (unsigned slot = 0; slot < kChildren; ++slot)
      if (!walk.children().isEmpty(slot) && enter(walk.child(slot))) bits |= 1u << slot;
    walk.enter(bits);
  }
}

/// Calls f(begin, end) for ranges of the octree's order that together hold every element whose box
/// `overlaps` accepts. A box around an accepted box must be accepted, too.
template <class Overlaps, class F>
void forEachOverlapping(const Octree& octree, Overlaps&& overlaps, F&& f) {
  forEachEntered(
      octree, [&](OctreeNode node) { return overlaps(octree.box(node)); }, f);
}

/// Finds the elements whose boxes, as the map places them, overlap `box`. Their places in the
/// octree's order are written to stack.found.
void findOverlapping(const Octree&, const BoxMap&, const FloatBox& box, PointQueryStack& stack);

}  // namespace palpate
