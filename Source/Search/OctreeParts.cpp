#include "Search/OctreeParts.h"

#include "Core/Assert.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace palpate {

namespace {

/// Elements of a part, at least, and the largest number of parts.
constexpr std::size_t kElementsPerPart = 512, kMostParts = 512;

/// Appends the parts of a tree below a node.
void addParts(const Octree& tree, OctreeNode node, std::size_t most,
              CountedVector<OctreeNode>& parts) {
  if (tree.isEmpty(node)) return;
  const auto [begin, end] = tree.range(node);
  const OctreeNode children = tree.firstChild(node);
  if (end - begin <= most || children == 0) return parts.push_back(node);
  const auto own = tree.ownRange(node);
  if (own.first < own.second) parts.push_back(node | NodePair::kOwn);
  for (std::uint32_t i = 0; i < kChildren; ++i) addParts(tree, children + i, most, parts);
}

/// The places of a part's elements in the octree's order. Parts follow each other in it.
std::pair<std::uint32_t, std::uint32_t> rangeOf(const Octree& tree, OctreeNode part) {
  return part & NodePair::kOwn ? tree.ownRange(part & ~NodePair::kOwn) : tree.range(part);
}

}  // namespace

void OctreeParts::make(const Body& body) {
  const Octree& tree = body.tree.octree();
  layout = 0;
  nodes.clear();
  groups.assign(1, 0);
  addParts(tree, 0, std::max(kElementsPerPart, tree.size() / kMostParts), nodes);
  CountedVector<std::pair<std::uint32_t, std::uint32_t>> ranges;
  ranges.reserve(nodes.size());
  for (const OctreeNode node : nodes) {
    ranges.push_back(rangeOf(tree, node));
    groups.push_back(static_cast<std::uint32_t>(
        std::ranges::lower_bound(tree.groups(), ranges.back().second) - tree.groups().begin()));
  }
  pieces = piecesOf(body.tree.ordered(), ranges, body.mesh.topology.vertexCount);
  moved.resize(nodes.size());
  isCut.assign(nodes.size(), 0);
  layout = tree.layout();
}

bool OctreeParts::canCut(const Body& body) const {
  const ElementCuts::Cut& cut = body.tree.lastCut();
  return cut.before == layout && cut.after == body.tree.octree().layout();
}

/// Finds the pieces of parts with elements at the cut.
void OctreeParts::cut(const Body& body) {
  PALPATE_ASSERT(canCut(body));
  layout = 0;
  findPiecesAgain(
      body.tree.ordered(), body.tree.octree().groups(), body.tree.lastCut().groups,
      body.mesh.topology.vertexCount, pieces,
      [&](std::size_t part) { return std::pair(groups[part], groups[part + 1]); },
      [&](std::size_t part) { isCut[part] = 1; });
  layout = body.tree.octree().layout();
}

/// Returns the motion of all vertices.
MotionRange OctreeParts::addMotion(const PieceMotion& motion) {
  for (std::size_t part = 0; part < moved.size(); ++part) moved[part] = motion.of(pieces[part]);
  MotionRange all;
  for (const MotionRange& range : motion.ranges()) all.add(range);
  return all;
}

CountedVector<PartPair> nearParts(const OctreeParts& partsA, const OctreeParts& partsB,
                                  const TreePair& trees, bool cut) {
  CountedVector<std::uint32_t> all(partsB.nodes.size()), ofCut;
  std::iota(all.begin(), all.end(), 0u);
  for (const std::uint32_t j : all)
    if (partsB.isCut[j]) ofCut.push_back(j);
  CountedVector<PartPair> near;
  for (std::uint32_t i = 0; i < partsA.nodes.size(); ++i) {
    FloatBox box = trees.a->box(partsA.nodes[i] & ~NodePair::kOwn);
    for (std::size_t k = 0; k < 3; ++k) {
      box.lower[k] = OutwardRounding::down(box.lower[k] + trees.shiftLower[k]);
      box.upper[k] = OutwardRounding::up(box.upper[k] + trees.shiftUpper[k]);
    }
    for (const std::uint32_t j : cut && !partsA.isCut[i] ? ofCut : all)
      if ((!trees.self() || j >= i) &&
          box.overlaps(trees.b->box(partsB.nodes[j] & ~NodePair::kOwn)))
        near.push_back({i, j});
  }
  return near;
}

}  // namespace palpate
