#pragma once

#include "Core/Buffer.h"
#include "Octree/BoxMap.h"
#include "Octree/Octree.h"

#include <cstdint>
#include <type_traits>

namespace palpate {

/// Scratch of point queries, which keeps its peak capacity. Each query clears it first, so that a
/// query that ended with an exception does not affect the next one.
struct PointQueryStack {
  struct Entry {
    float distanceSquared;
    OctreeNode node;
  };
  Buffer<Entry> entries;
  Buffer<std::uint32_t> found;  ///< of findOverlapping()
};

/// Descends from the root into the nodes that `enter(node)` accepts. It calls enter() for each node
/// that is not empty if the parent was accepted. It calls f(begin, end) with the range of the
/// octree's order that each accepted node holds itself. This and all queries below throw if the
/// octree is not built.
template <class Enter, class F>
void forEachEntered(const Octree& octree, Enter&& enter, PointQueryStack& stack, F&& f) {
  octree.requireBuilt();
  stack.entries.clear();
  if (enter(OctreeNode{0})) stack.entries.push_back({0, 0});
  while (!stack.entries.empty()) {
    const OctreeNode node = stack.entries.back().node;
    stack.entries.pop_back();
    const auto [begin, end] = octree.ownRange(node);
    if (begin < end) f(begin, end);
    const OctreeNode first = octree.firstChild(node);
    for (unsigned slot = 0; first != 0 && slot < 8; ++slot)
      if (!octree.isEmpty(first + slot) && enter(first + slot))
        stack.entries.push_back({0, first + slot});
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

/// Tests the element at a place of the octree's order. Returns the least squared distance found so
/// far.
using VisitElement = double (*)(void* context, std::uint32_t place);

/// Visits nearest nodes first. Stops when the box of no other element, as the map places it, is as
/// near to the point as the least squared distance found. All distances are in the octree's floats.
/// point: a box around the point. distanceSquared: elements further away than this are ignored.
void visitNearest(const Octree&, const BoxMap&, const FloatBox& point, double distanceSquared,
                  PointQueryStack& stack, void* context, VisitElement visitElement);

/// visitNearest() with f(place) in place of the function pointer.
template <class F>
void forEachNearest(const Octree& octree, const BoxMap& map, const FloatBox& point,
                    double distanceSquared, PointQueryStack& stack, F&& f) {
  const auto call = [](void* context, std::uint32_t place) {
    return (*static_cast<std::remove_reference_t<F>*>(context))(place);
  };
  visitNearest(octree, map, point, distanceSquared, stack, &f, call);
}

}  // namespace palpate
