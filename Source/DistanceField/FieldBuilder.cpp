#include "DistanceField/FieldBuilder.h"

#include <palpate/Error.h>

#include "DistanceField/CellJoining.h"
#include "DistanceField/CellRefinement.h"
#include "DistanceField/CellTree.h"
#include "DistanceField/CoincidentTriangles.h"
#include "DistanceField/SurfaceSign.h"
#include "Core/Assert.h"

#include <algorithm>
#include <string>
#include <vector>

namespace palpate {

namespace {

/// Adds what is below a cell to the field, depth first. Returns the cell's entry.
CellEntry addTo(FieldCells& field, const CellTree& tree, const TreeCell& cell) {
  if (cell.hasChildren()) {
    const auto block = static_cast<std::uint32_t>(field.blocks.size());
    field.blocks.emplace_back();
    for (std::uint32_t i = 0; i < 8; ++i) {
      const CellEntry child = addTo(field, tree, tree.cells[cell.children + i]);
      field.blocks[block][i] = child;
    }
    return CellEntry::of(CellKind::Block, true, block);
  }
  if (cell.state == TreeCell::State::Beyond)
    return CellEntry::of(
        CellTree::valueAt(cell, 0, tree.distances) < 0 ? CellKind::Inside : CellKind::Outside,
        cell.isReliable);
  FieldCells::Leaf& leaf = field.leaves.emplace_back();
  for (std::uint32_t i = 0; i < 8; ++i)
    leaf[i] = CellTree::valueAt(cell, i, cell.isReliable ? tree.values : tree.distances);
  return CellEntry::of(CellKind::Leaf, cell.isReliable,
                       static_cast<std::uint32_t>(field.leaves.size() - 1));
}

FieldCells assemble(const CellTree& tree) {
  FieldCells field = tree.domain.empty;
  std::size_t leaves = 0, blocks = 0;
  for (const TreeCell& cell : tree.cells) leaves += cell.isLeaf(), blocks += cell.hasChildren();
  if (std::max(leaves, blocks) >= CellEntry::kMostIndices)
    throw Error(ErrorCode::TooLarge, "the distance field has " + std::to_string(leaves) +
                                         " cells; at most 2^29 are supported");
  const std::size_t roots = std::size_t{field.size[0]} * field.size[1] * field.size[2];
  tree.checkMemory(leaves * sizeof(FieldCells::Leaf) + blocks * sizeof(FieldCells::Block) +
                   roots * sizeof(CellEntry));
  field.leaves.reserve(leaves);
  field.blocks.reserve(blocks);
  field.roots.resize(roots);
  for (std::uint32_t i = 0; i < roots; ++i) field.roots[i] = addTo(field, tree, tree.cells[i]);
  PALPATE_ASSERT(field.leaves.size() == leaves && field.blocks.size() == blocks);
  return field;
}

}  // namespace

FieldCells buildField(const Body& body, bool isClosed, const DistanceFieldSettings& settings,
                      const Threads& threads) {
  const SurfaceSign sign(body, isClosed);
  const FieldDomain domain(body.mesh, sign, settings);
  Body distinct(body.id);
  const std::vector<Triangle> kept = withoutCopies(body);
  if (!kept.empty()) makeBody(body.mesh.now.body(), kept, threads, distinct);
  const Body& distances = kept.empty() ? body : distinct;
  const FieldSurface surface{sign, distances, {distances, sign, domain.tolerance}};
  BuildProgress build{threads, settings.progress};
  CellTree tree(domain, settings.memoryLimit);
  for (std::size_t first = 0; first < tree.cells.size();) {
    refine(tree, first, surface, build);
    const std::vector<std::uint32_t> tooLarge = joinCells(tree, first, surface.certifier, threads);
    first = tree.cells.size();
    for (const std::uint32_t cell : tooLarge) tree.split(cell);
  }
  build.report(1.0);
  return assemble(tree);
}

}  // namespace palpate
