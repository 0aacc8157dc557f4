#include <palpate/LooseOctree.h>

#include "Octree/Forest.h"
#include "Core/FloatingPoint.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

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

namespace {

/// Appends a node and those below it.
void appendNodes(const Tree& tree, OctreeNode node, const CellOfNode& cell, std::uint32_t parent,
                 std::vector<LooseOctree::Node>& out) {
  const Octree& octree = *tree.octree;
  const auto& [cube, depth] = cell;
  const auto place = static_cast<std::uint32_t>(out.size());
  std::array<double, 3> lower = cube.lower;
  for (double& l : lower) l -= cube.edge * 0.5;
  const FloatBox box = octree.box(node);
  Eigen::AlignedBox3d fitted;
  for (int k = 0; k < 3; ++k) {
    fitted.min()[k] = nextDown(tree.origin[k] + box.lower[k] / tree.scale);
    fitted.max()[k] = nextUp(tree.origin[k] + box.upper[k] / tree.scale);
  }
  const auto [begin, end] = octree.ownRange(node);
  out.push_back({tree.geometry, depth, cubeInScene(tree, cube.lower, cube.edge),
                 cubeInScene(tree, lower, 2 * cube.edge), fitted, parent,
                 octree.order().subspan(begin, end - begin)});
  const OctreeNode first = octree.firstChild(node);
  for (unsigned slot = 0; first != 0 && slot < kChildren; ++slot)
    if (!octree.isEmpty(first + slot))
      appendNodes(tree, first + slot, {cube.child(slot), depth + 1}, place, out);
}

}  // namespace

std::vector<LooseOctree::Node> LooseOctree::nodes(GeometryId geometry) const {
  const StandardFloatingPoint standard;
  std::vector<Node> nodes;
  if (const Tree* tree = treeOf(m_state, geometry))
    appendNodes(*tree, 0, cellOf(*tree->octree, 0), kNoElement, nodes);
  return nodes;
}

std::vector<GeometryId> LooseOctree::geometries() const {
  std::vector<GeometryId> ids;
  for (const Tree& tree : m_state.trees) ids.push_back(tree.geometry);
  return ids;
}

LooseOctree::Update LooseOctree::lastUpdate(GeometryId geometry) const {
  const Tree* tree = treeOf(m_state, geometry);
  return tree ? tree->lastUpdate : Update::Unchanged;
}

OctreeStatistics LooseOctree::statistics() const {
  OctreeStatistics statistics;
  for (const Tree& tree : m_state.trees) {
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
  for (const Tree& tree : m_state.trees)
    for (const std::string& failure :
         palpate::validate(*tree.octree, tree.lastUpdate == Update::Rebuilt))
      failures.push_back("geometry " + std::to_string(static_cast<std::uint32_t>(tree.geometry)) +
                         ": " + failure);
  return failures;
}

}  // namespace palpate
