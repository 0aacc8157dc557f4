#include <palpate/LooseOctree.h>

#include <palpate/Error.h>

#include "Octree/Forest.h"
#include "Core/FloatingPoint.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

namespace {

using Tree = LooseOctree::State::Tree;

const Tree* treeOf(const LooseOctree::State& state, GeometryId geometry) {
  const auto found = std::find_if(state.trees.begin(), state.trees.end(),
                                  [=](const Tree& t) { return t.geometry == geometry; });
  return found == state.trees.end() ? nullptr : &*found;
}

/// Calls f(node, depth) for each node in use, parents before children.
template <class F>
void forEachNode(const Octree& octree, OctreeNode node, int depth, F&& f) {
  f(node, depth);
  const OctreeNode first = octree.firstChild(node);
  for (unsigned slot = 0; first != 0 && slot < kChildren; ++slot)
    if (!octree.isEmpty(first + slot)) forEachNode(octree, first + slot, depth + 1, f);
}

double nextDown(double v) { return std::nextafter(v, -std::numeric_limits<double>::infinity()); }
double nextUp(double v) { return std::nextafter(v, std::numeric_limits<double>::infinity()); }

Eigen::AlignedBox3d cubeInScene(const Tree& tree, const std::array<double, 3>& lower, double edge) {
  const Eigen::Vector3d corner(lower[0], lower[1], lower[2]);
  return {tree.origin + corner / tree.scale,
          tree.origin + (corner.array() + edge).matrix() / tree.scale};
}

}  // namespace

CellOfNode cellOf(const Octree& octree, OctreeNode node) {
  std::vector<unsigned> path;
  while (node != 0) {
    path.push_back(slotOf(node));
    node = octree.parent(blockOf(node));
  }
  Cube cube = octree.rootCube();
  for (auto octant = path.rbegin(); octant != path.rend(); ++octant) cube = cube.child(*octant);
  return {cube, static_cast<int>(path.size())};
}

std::vector<LooseOctree::NodeId> LooseOctree::nodes(GeometryId geometry) const {
  std::vector<NodeId> ids;
  if (const Tree* tree = treeOf(*m_state, geometry))
    forEachNode(*tree->octree, 0, 0,
                [&](OctreeNode node, int) { ids.push_back(NodeId{tree->firstNode + node}); });
  return ids;
}

std::vector<LooseOctree::NodeId> LooseOctree::nodes() const {
  std::vector<NodeId> ids;
  for (const Tree& tree : m_state->trees)
    for (const NodeId id : nodes(tree.geometry)) ids.push_back(id);
  return ids;
}

std::optional<LooseOctree::NodeId> LooseOctree::root(GeometryId geometry) const {
  const Tree* tree = treeOf(*m_state, geometry);
  return tree ? std::optional(NodeId{tree->firstNode}) : std::nullopt;
}

LooseOctree::Node LooseOctree::node(NodeId id) const {
  const StandardFloatingPoint standard;
  const auto index = static_cast<std::uint32_t>(id);
  const auto next =
      std::upper_bound(m_state->trees.begin(), m_state->trees.end(), index,
                       [](std::uint32_t i, const Tree& t) { return i < t.firstNode; });
  if (next == m_state->trees.begin())
    throw Error(ErrorCode::IndexOutOfRange,
                "octree node " + std::to_string(index) + " does not exist");
  const Tree& tree = *std::prev(next);
  const Octree& octree = *tree.octree;
  const OctreeNode node = index - tree.firstNode;
  if (node >= octree.pool().used() * kChildren || octree.isEmpty(node))
    throw Error(ErrorCode::IndexOutOfRange,
                "octree node " + std::to_string(index) + " does not exist or is empty");
  const auto [cube, depth] = cellOf(octree, node);

  Node result;
  result.geometry = tree.geometry;
  result.depth = depth;
  result.bounds = cubeInScene(tree, cube.lower, cube.edge);
  std::array<double, 3> lower = cube.lower;
  for (double& l : lower) l -= cube.edge * 0.5;
  result.looseBounds = cubeInScene(tree, lower, 2 * cube.edge);
  const FloatBox box = octree.box(node);
  for (int k = 0; k < 3; ++k) {
    result.fittedBox.min()[k] = nextDown(tree.origin[k] + box.lower[k] / tree.scale);
    result.fittedBox.max()[k] = nextUp(tree.origin[k] + box.upper[k] / tree.scale);
  }
  result.geometries = std::uint64_t{1} << (static_cast<std::uint32_t>(tree.geometry) % 64);
  if (node != 0) result.parent = NodeId{tree.firstNode + octree.parent(blockOf(node))};
  const OctreeNode first = octree.firstChild(node);
  result.leaf = first == 0;
  for (unsigned slot = 0; !result.leaf && slot < kChildren; ++slot)
    if (!octree.isEmpty(first + slot))
      result.children[slot] = NodeId{tree.firstNode + first + slot};
  const auto [begin, end] = octree.ownRange(node);
  result.elements = octree.order().subspan(begin, end - begin);
  return result;
}

LooseOctree::Update LooseOctree::lastUpdate(GeometryId geometry) const {
  const Tree* tree = treeOf(*m_state, geometry);
  return tree ? tree->lastUpdate : Update::Unchanged;
}

OctreeStatistics LooseOctree::statistics() const {
  OctreeStatistics statistics;
  for (const Tree& tree : m_state->trees) {
    const Octree& octree = *tree.octree;
    statistics.blocksInUse += octree.pool().used();
    statistics.blocksFree += octree.pool().free();
    statistics.blocksAllocated += octree.pool().allocated();
    statistics.elements += octree.size();
    statistics.bytes += octree.bytes() + tree.otherBytes;
    forEachNode(octree, 0, 0, [&](OctreeNode node, int depth) {
      const auto [begin, end] = octree.ownRange(node);
      const auto level = static_cast<std::size_t>(depth);
      if (statistics.nodesByDepth.size() <= level) {
        statistics.nodesByDepth.resize(level + 1);
        statistics.elementsByDepth.resize(level + 1);
      }
      ++statistics.nodesInUse;
      ++statistics.nodesByDepth[level];
      statistics.elementsByDepth[level] += end - begin;
      statistics.deepestLevel = std::max(statistics.deepestLevel, depth);
      statistics.maxElementsInNode =
          std::max<std::size_t>(statistics.maxElementsInNode, end - begin);
    });
  }
  statistics.nodesAllocated = kChildren * statistics.blocksAllocated;
  return statistics;
}

std::vector<std::string> LooseOctree::validate() const {
  std::vector<std::string> failures;
  for (const Tree& tree : m_state->trees)
    for (const std::string& failure :
         palpate::validate(*tree.octree, tree.lastUpdate == Update::Rebuilt))
      failures.push_back("geometry " + std::to_string(static_cast<std::uint32_t>(tree.geometry)) +
                         ": " + failure);
  return failures;
}

}  // namespace palpate
