#pragma once

#include "Core/Buffer.h"
#include "Octree/BoxMap.h"
#include "Octree/Octree.h"

#include <cstdint>
#include <type_traits>

namespace palpate {

/// Scratch of point queries, which remembers its peak. Each query clears it first, so a query that
/// an exception ended leaves nothing to the next.
struct PointQueryStack {
  struct Entry {
    float distanceSquared;
    OctreeNode node;
  };
  Buffer<Entry> entries;
  Buffer<std::uint32_t> found;  ///< of findOverlapping()
};

/// Descends from the root into the nodes that `enter(node)` accepts, which is asked for each node
/// that is not empty, a parent before its children; f(begin, end): the ranges of the octree's order
/// that accepted nodes hold themselves. This and all queries below throw if the octree is not
/// built.
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

/// f(begin, end) for ranges of the octree's order that hold every element whose box `overlaps`, as
/// do all boxes around it.
template <class Overlaps, class F>
void forEachOverlapping(const Octree& octree, Overlaps&& overlaps, PointQueryStack& stack, F&& f) {
  forEachEntered(
      octree, [&](OctreeNode node) { return overlaps(octree.box(node)); }, stack, f);
}

/// The elements whose boxes, as the map places them, overlap `box`, by their places in the
/// octree's order: in stack.found.
void findOverlapping(const Octree&, const BoxMap&, const FloatBox& box, PointQueryStack& stack);

/// Of an element's place in the octree's order: the least squared distance seen so far.
using TryElement = double (*)(void* context, std::uint32_t place);

/// Nearest nodes first: tries elements until no other one's box, as the map places it, comes as
/// near to the point as the least squared distance seen, all in the octree's floats. point: a box
/// around it; distanceSquared: no element further away is of interest.
void tryNearest(const Octree&, const BoxMap&, const FloatBox& point, double distanceSquared,
                PointQueryStack& stack, void* context, TryElement tryElement);

/// tryNearest() by f(place).
template <class F>
void forEachNearest(const Octree& octree, const BoxMap& map, const FloatBox& point,
                    double distanceSquared, PointQueryStack& stack, F&& f) {
  const auto call = [](void* context, std::uint32_t place) {
    return (*static_cast<std::remove_reference_t<F>*>(context))(place);
  };
  tryNearest(octree, map, point, distanceSquared, stack, &f, call);
}

}  // namespace palpate
