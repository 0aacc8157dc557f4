// Part of Octree/Forest.h: the invariants of an octree.
#include "Octree/Forest.h"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

class Validation {
 public:
  Validation(const Octree& octree, bool cells) : m_octree(octree), m_cells(cells) {}

  std::vector<std::string> run() {
    if (m_octree.size() == 0) return m_failures;
    if (!m_octree.isBuilt()) {
      fail(0, "the tree is not built");
      return m_failures;
    }
    m_holders.assign(m_octree.size(), 0);
    m_blockVisited.assign(m_octree.pool().used(), false);
    m_blockVisited[0] = true;
    const FloatBox all = visit(0, m_octree.rootCube());
    if (all.empty()) fail(0, "the root is empty");
    for (std::size_t i = 0; i < m_holders.size(); ++i)
      if (m_holders[i] != 1)
        fail(0, "element " + std::to_string(m_octree.order()[i]) + " is in " +
                    std::to_string(m_holders[i]) + " nodes instead of 1");
    std::vector<std::uint32_t> ids(m_octree.order().begin(), m_octree.order().end());
    std::sort(ids.begin(), ids.end());
    if (const auto twice = std::adjacent_find(ids.begin(), ids.end()); twice != ids.end())
      fail(0, "element " + std::to_string(*twice) + " is repeated in the order");
    for (std::size_t block = 0; block < m_blockVisited.size(); ++block)
      for (unsigned slot = 0; slot < kChildren && !m_blockVisited[block]; ++slot)
        if (!m_octree.blocks()[block].isEmpty(slot))
          fail(nodeOf(static_cast<std::uint32_t>(block), slot), "a node in use has no parent");
    return std::move(m_failures);
  }

 private:
  void fail(OctreeNode node, const std::string& what) {
    if (m_failures.size() < 20) m_failures.push_back("node " + std::to_string(node) + ": " + what);
  }

  /// Returns the box that the node's fitted box must equal.
  FloatBox visit(OctreeNode node, const Cube& cube) {
    const OctreeBlock& block = m_octree.blocks()[blockOf(node)];
    const unsigned slot = slotOf(node);
    const std::uint32_t child = block.child[slot];
    FloatBox box;
    if (!block.isLeaf(slot) && (child >= m_blockVisited.size() || m_blockVisited[child])) {
      fail(node, "its child block is shared or out of bounds");
      return box;
    }
    const auto [begin, end] = m_octree.ownRange(node);
    if (begin > end || end > m_octree.size()) {
      fail(node, "its range of elements is out of bounds");
      return box;
    }
    for (std::uint32_t i = begin; i < end; ++i) {
      ++m_holders[i];
      box.add(m_octree.boxes()[i]);
      if (m_cells) checkCell(node, cube, i, block.isLeaf(slot));
    }
    if (!block.isLeaf(slot)) {
      m_blockVisited[child] = true;
      if (m_octree.parent(child) != node) fail(node, "its child block refers to another parent");
      bool isUsed = false;
      for (unsigned octant = 0; octant < kChildren; ++octant) {
        if (m_octree.blocks()[child].isEmpty(octant)) {
          if (!m_octree.blocks()[child].box(octant).empty())
            fail(nodeOf(child, octant), "an empty slot has a box");
        } else {
          isUsed = true;
          box.add(visit(nodeOf(child, octant), cube.child(octant)));
        }
      }
      if (!isUsed) fail(node, "all slots of its child block are empty");
    }
    const FloatBox fitted = block.box(slot);
    if (fitted.lower != box.lower || fitted.upper != box.upper)
      fail(node, "its fitted box differs from the bounds of its elements and children");
    checkDops(node);
    return box;
  }

  void checkDops(OctreeNode node) {
    const OctreeDops& dops = m_octree.dops();
    const auto [begin, end] = m_octree.ownRange(node);
    const OctreeNode child = blockOf(m_octree.firstChild(node));
    for (int k = 3; k < dops.directions; ++k) {
      float lower = FloatBox::kEmptyLower, upper = -lower;
      const auto add = [&](float from, float to) {
        lower = std::min(lower, from);
        upper = std::max(upper, to);
      };
      for (std::uint32_t i = begin; i < end; ++i) add(dops.lower[k][i], dops.upper[k][i]);
      for (unsigned slot = 0; child != 0 && slot < kChildren; ++slot)
        add(dops.block(child)[k - 3].lower[slot], dops.block(child)[k - 3].upper[slot]);
      const OctreeDops::Siblings& fitted = dops.block(blockOf(node))[k - 3];
      if (fitted.lower[slotOf(node)] != lower || fitted.upper[slotOf(node)] != upper)
        fail(node, "its k-DOP differs from the bounds of its elements and children");
    }
  }

  void checkCell(OctreeNode node, const Cube& cube, std::uint32_t i, bool leaf) {
    const FloatBox box = m_octree.boxes()[i];
    const auto element = [&] { return "element " + std::to_string(m_octree.order()[i]); };
    double longest = 0;
    for (int k = 0; k < 3; ++k) {
      const double lower = double{box.lower[k]} - cube.lower[k],
                   upper = double{box.upper[k]} - cube.lower[k];
      longest = std::max(longest, upper - lower);
      // The cell of the centre is computed in float arithmetic, relative to the root's cube or to
      // one further down, with four roundings of 2^-24 of that cube's edge. An element on the wrong
      // side of a border is as far outside all cells further down. Elements that are no longer than
      // their cell are then within its loose bounds, up to the same slack.
      const double centre = 0.5 * (lower + upper), slack = m_octree.rootCube().edge * 0x1p-22;
      if (centre < -slack || centre > cube.edge + slack)
        fail(node, "the centre of " + element() + " is outside its cell");
    }
    if (longest > cube.edge) fail(node, element() + " is longer than its cell");
    // A split cell's own element is too large for the cell's children. A leaf may have elements of
    // any size.
    if (!leaf && longest * (1.0 + 0x1p-9) < 0.5 * cube.edge)
      fail(node, element() + " fits into a child cell");
  }

  const Octree& m_octree;
  bool m_cells;
  std::vector<std::string> m_failures;
  std::vector<int> m_holders;
  std::vector<bool> m_blockVisited;
};

}  // namespace

std::vector<std::string> validate(const Octree& octree, bool cells) {
  return Validation(octree, cells).run();
}

}  // namespace palpate
