#include "DistanceField/CellJoining.h"

#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace palpate {

namespace {

constexpr std::uint32_t kNone = CellTree::kNone;
using ByLevel = std::array<std::vector<std::uint32_t>, kMostLevels + 1>;

/// Gives values to cells from `first` on that are beyond the band and touch a larger cell with
/// values, so that both agree where they meet. Older cells need none: what they touch was not
/// smaller before.
void adjustCellsBeyond(CellTree& tree, std::size_t first) {
  ByLevel byLevel;
  for (std::size_t i = first; i < tree.cells.size(); ++i)
    if (tree.cells[i].state == TreeCell::State::Beyond && tree.cells[i].isReliable)
      byLevel[tree.cells[i].level].push_back(static_cast<std::uint32_t>(i));
  for (const std::vector<std::uint32_t>& cells : byLevel)
    for (const std::uint32_t i : cells) {
      TreeCell& cell = tree.cells[i];
      if (std::any_of(cell.corners.begin(), cell.corners.end(), [&](std::uint32_t corner) {
            const std::uint32_t largest = tree.largestAround(corner);
            return largest != kNone && tree.cells[largest].level < cell.level;
          }))
        cell.state = TreeCell::State::Adjusted;
    }
}

/// The largest cell around a corner stays the largest until it is split.
void findOwners(CellTree& tree, const Threads& threads) {
  std::vector<std::uint32_t>& owners = tree.owners;
  const std::size_t known = owners.size();
  owners.resize(tree.corners.size(), kNone);
  threads.forChunks(owners.size(), 1024, [&](std::size_t, std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i)
      if (i >= known || (owners[i] != kNone && tree.cells[owners[i]].hasChildren()))
        owners[i] = tree.largestAround(static_cast<std::uint32_t>(i));
  });
}

/// Computes the values of all corners. Returns for each whether it is another one than before.
std::vector<std::uint8_t> computeValues(CellTree& tree, const Threads& threads) {
  const std::vector<float>& distances = tree.distances;
  std::vector<float>& values = tree.values;
  const std::size_t known = values.size();
  values.insert(values.end(), distances.begin() + static_cast<std::ptrdiff_t>(known),
                distances.end());
  std::vector<std::uint8_t> hasChanged(tree.corners.size());
  // A corner of a larger cell hangs on still larger ones only.
  ByLevel byLevel;
  for (std::uint32_t i = 0; i < tree.owners.size(); ++i) {
    if (tree.owners[i] != kNone) {
      byLevel[tree.cells[tree.owners[i]].level].push_back(i);
    } else if (values[i] != distances[i]) {
      values[i] = distances[i];
      hasChanged[i] = 1;
    }
  }
  for (const std::vector<std::uint32_t>& corners : byLevel)
    threads.forChunks(corners.size(), 1024, [&](std::size_t, std::size_t from, std::size_t to) {
      for (std::size_t j = from; j < to; ++j) {
        const std::uint32_t i = corners[j];
        const TreeCell& owner = tree.cells[tree.owners[i]];
        PALPATE_ASSERT(owner.isJoined());
        const auto value = static_cast<float>(tree.interpolate(owner, tree.corners[i]));
        hasChanged[i] = value != values[i];
        values[i] = value;
      }
    });
  return hasChanged;
}

/// Units: how far what hangs is off.
double deviationOf(const CellTree& tree, std::uint32_t corner) {
  return std::abs(double{tree.values[corner]} - tree.distances[corner]);
}
double deviationOf(const CellTree& tree, const TreeCell& cell) {
  double most = 0.0;
  for (const std::uint32_t corner : cell.corners) most = std::max(most, deviationOf(tree, corner));
  return most;
}

/// Whether a cell's error and the deviation of its values are together within the bound.
bool isAllowed(const CellTree& tree, TreeCell& cell, const CellCertifier& certifier,
               PointQueryStack& stack) {
  if (cell.state != TreeCell::State::Certified || !cell.isReliable) return true;
  const double deviation = deviationOf(tree, cell);
  if (deviation <= cell.allowed) return true;
  auto share = static_cast<float>(deviation);
  if (share < deviation) share = std::nextafter(share, std::numeric_limits<float>::infinity());
  const double left = tree.domain.bound - share * tree.domain.unit;
  if (!(left > 0) || !certifier.isWithin(tree.interpolated(cell), left, stack)) return false;
  cell.allowed = share;
  return true;
}

}  // namespace

std::vector<std::uint32_t> joinCells(CellTree& tree, std::size_t first,
                                     const CellCertifier& certifier, const Threads& threads) {
  PALPATE_ASSERT(tree.distances.size() == tree.corners.size());
  adjustCellsBeyond(tree, first);
  findOwners(tree, threads);
  const std::vector<std::uint8_t> hasChanged = computeValues(tree, threads);
  threads.forChunks(tree.cells.size(), 256, [&](std::size_t, std::size_t from, std::size_t to) {
    PointQueryStack stack;
    for (std::size_t i = from; i < to; ++i) {
      TreeCell& cell = tree.cells[i];
      if (i >= first || cell.isOff ||
          std::any_of(cell.corners.begin(), cell.corners.end(),
                      [&](std::uint32_t corner) { return hasChanged[corner] != 0; }))
        cell.isOff = !isAllowed(tree, cell, certifier, stack);
    }
  });
  std::vector<std::uint32_t> tooLarge;
  for (const TreeCell& cell : tree.cells)
    for (const std::uint32_t corner : cell.corners)
      if (cell.isOff && deviationOf(tree, corner) > 0.5 * deviationOf(tree, cell)) {
        PALPATE_ASSERT(tree.owners[corner] != kNone);
        tooLarge.push_back(tree.owners[corner]);
      }
  std::sort(tooLarge.begin(), tooLarge.end());
  tooLarge.erase(std::unique(tooLarge.begin(), tooLarge.end()), tooLarge.end());
  return tooLarge;
}

}  // namespace palpate
