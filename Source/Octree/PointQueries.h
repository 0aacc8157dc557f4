#pragma once

#include "Core/Buffer.h"
#include "Octree/Octree.h"

#include <cstdint>
#include <span>

namespace palpate {

/// Scratch of point queries, which remembers its peak.
struct PointQueryStack {
  struct Entry {
    double distanceSquared;
    OctreeNode node;
  };
  Buffer<Entry> entries;
};

/// f(begin, end) for ranges of the octree's order that hold every primitive whose box `overlaps`,
/// as do all boxes around it.
template <class Overlaps, class F>
void forEachOverlapping(const Octree& octree, Overlaps&& overlaps, PointQueryStack& stack, F&& f) {
  const OctreeBlock* blocks = octree.blocks();
  stack.entries.clear();
  if (overlaps(blocks[0].box(0))) stack.entries.push_back({0, 0});
  while (!stack.entries.empty()) {
    const OctreeNode node = stack.entries.back().node;
    stack.entries.pop_back();
    const auto [begin, end] = octree.ownRange(node);
    if (begin < end) f(begin, end);
    const OctreeBlock& block = blocks[node >> 3];
    if (block.isLeaf(node & 7)) continue;
    const std::uint32_t child = block.child[node & 7];
    for (unsigned slot = 0; slot < 8; ++slot)
      if (overlaps(blocks[child].box(slot))) stack.entries.push_back({0, child * 8 + slot});
  }
}

/// Nearest first: f(begin, end) for ranges of the octree's order until no other node's box comes as
/// near to the point as f's last answer, a squared distance in the octree's floats.
///
/// squareTo(box): of the point's distance. Boxes hold their primitives with more to spare than its
/// roundings.
template <class SquareTo, class F>
void forEachNearest(const Octree& octree, SquareTo&& squareTo, double distanceSquared,
                    PointQueryStack& stack, F&& f) {
  const OctreeBlock* blocks = octree.blocks();
  using Entry = PointQueryStack::Entry;
  stack.entries.assign(1, {squareTo(blocks[0].box(0)), 0});
  while (!stack.entries.empty()) {
    const Entry entry = stack.entries.back();
    stack.entries.pop_back();
    if (entry.distanceSquared > distanceSquared) continue;
    const auto [begin, end] = octree.ownRange(entry.node);
    if (begin < end) distanceSquared = f(begin, end);
    const OctreeBlock& block = blocks[entry.node >> 3];
    if (block.isLeaf(entry.node & 7)) continue;
    const std::uint32_t child = block.child[entry.node & 7];
    const std::size_t first = stack.entries.size();
    for (unsigned slot = 0; slot < 8; ++slot) {
      if (blocks[child].isEmpty(slot)) continue;
      const Entry next{squareTo(blocks[child].box(slot)), child * 8 + slot};
      if (next.distanceSquared > distanceSquared) continue;
      // Nearest last, to be taken first.
      std::size_t place = stack.entries.size();
      stack.entries.push_back(next);
      for (; place > first && stack.entries[place - 1].distanceSquared < next.distanceSquared;
           --place)
        stack.entries[place] = stack.entries[place - 1];
      stack.entries[place] = next;
    }
  }
}

}  // namespace palpate
