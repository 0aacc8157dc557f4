#include "DistanceField/CellRefinement.h"

#include <palpate/Error.h>

#include "Queries/PointDistances.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Text.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <string>
#include <vector>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// The part of the error bound that a cell's own interpolation may use. The rest is for corners
/// that hang.
constexpr double kShareOfCells = 0.96;
constexpr std::size_t kSlice = 1 << 14;  ///< points or cells between two reports
constexpr std::size_t kItemsPerPart = 64;
/// Cells on lower levels are split where only some of their points may have a reliable sign.
constexpr int kSignLevel = 2;
/// The need for memory is estimated when there are so many cells, and they use this part of the
/// limit. The estimate takes about as long as the cells that are there by then.
constexpr std::size_t kFewestForEstimate = std::size_t{1} << 14, kPartBeforeEstimate = 64;
/// Cells of each level that an estimate splits. It is then right to some tens of percent.
constexpr std::size_t kSampledPerLevel = 256;
constexpr double kSureExcess = 1.5;  ///< an estimate above so many limits is a refusal

/// Calls f(from, to) for parts of [first, end), on all threads, and reports the progress. done:
/// share of this round before the call; the call does half of it.
template <class F>
void inSlices(std::size_t first, std::size_t end, double done, const BuildProgress& build, F&& f) {
  for (std::size_t at = first; at < end; at += kSlice) {
    // An estimate: half of the work that is left is done in a round.
    const double inRound =
        done + 0.5 * static_cast<double>(at - first) / static_cast<double>(end - first);
    build.report(1.0 - std::ldexp(1.0 - 0.5 * inRound, 1 - build.rounds));
    const std::size_t size = std::min(kSlice, end - at);
    build.threads.forChunks(
        size, kItemsPerPart,
        [&](std::size_t, std::size_t from, std::size_t to) { f(at + from, at + to); });
  }
}

/// Finds whether the cell has a reliable sign, or has to be split to know more.
void findSign(const FieldDomain& domain, const Vector3d& lower, const SurfaceSign& sign,
              TreeCell& cell) {
  if (cell.isReliable || cell.isUnreliable) return;
  const double half = domain.halfSideOf(cell.level);
  const auto reliability =
      sign.in(lower + Vector3d::Constant(half), std::numbers::sqrt3 * half * (1.0 + kFieldError));
  cell.isReliable = reliability == SurfaceSign::Reliability::Reliable;
  cell.isUnreliable = reliability == SurfaceSign::Reliability::Unreliable;
  cell.isSplitForSign = cell.level < kSignLevel && reliability == SurfaceSign::Reliability::Unknown;
}

/// Finds the distance of a new corner. Its sign is found if it has one, and else as of points
/// outside.
void evaluate(CellTree& tree, std::size_t i, const FieldSurface& surface, PointQueryStack& stack) {
  const Vector3d point = tree.domain.positionOf(tree.corners[i]);
  std::array<std::uint32_t, 8> likely{};
  // Where it is reliable, the sign changes only at the surface.
  int sign = tree.hasSign[i] ? 0 : 1;
  const std::uint32_t parent = tree.parents[i];
  if (parent != CellTree::kNone)
    for (std::size_t k = 0; k < 8; ++k) {
      const std::uint32_t corner = tree.cells[parent].corners[k];
      PALPATE_ASSERT(corner < i);
      likely[k] = tree.nearest[corner];
      if (sign != 0 || !tree.cells[parent].isReliable) continue;
      const double distance = std::abs(tree.distances[corner]) * tree.domain.unit;
      if ((point - tree.positionOf(corner)).norm() < 0.999 * distance - tree.domain.tolerance)
        sign = tree.distances[corner] < 0.0f ? -1 : 1;
    }
  const auto near = PointDistances(surface.body, point, false)
                        .roughlyNearest(tree.domain.tolerance,
                                        std::span(likely).first(parent == CellTree::kNone ? 1 : 8));
  if (sign == 0) sign = surface.sign.isInside(point, stack) ? -1 : 1;
  tree.distances[i] = static_cast<float>(sign * near.distance / tree.domain.unit);
  tree.nearest[i] = near.place;
}

/// Finds the distances of all corners that are new, and the signs of those of reliable cells from
/// `firstCell` on. All other signs are as of points outside.
void evaluateCorners(CellTree& tree, std::size_t firstCell, const FieldSurface& surface,
                     const BuildProgress& build) {
  const std::size_t first = tree.distances.size(), size = tree.corners.size();
  tree.distances.resize(size);
  tree.nearest.resize(size);
  tree.hasSign.resize(size);
  std::vector<std::uint32_t> known;
  for (std::size_t i = firstCell; i < tree.cells.size(); ++i) {
    if (!tree.cells[i].isReliable) continue;
    for (const std::uint32_t corner : tree.cells[i].corners) {
      if (corner < first && !tree.hasSign[corner]) known.push_back(corner);
      tree.hasSign[corner] = 1;
    }
  }
  build.threads.forChunks(known.size(), kItemsPerPart,
                          [&](std::size_t, std::size_t from, std::size_t to) {
                            PointQueryStack stack;
                            for (std::size_t i = from; i < to; ++i)
                              if (surface.sign.isInside(tree.positionOf(known[i]), stack))
                                tree.distances[known[i]] = -tree.distances[known[i]];
                          });
  inSlices(first, size, 0.0, build, [&](std::size_t from, std::size_t to) {
    PointQueryStack stack;
    for (std::size_t i = from; i < to; ++i) evaluate(tree, i, surface, stack);
  });
}

TreeCell::State stateOf(const CellTree& tree, const TreeCell& cell, const CellCertifier& certifier,
                        PointQueryStack& stack) {
  if (cell.isSplitForSign) return TreeCell::State::Split;
  const InterpolatedCell interpolated = tree.interpolated(cell);
  if (certifier.isBeyond(interpolated, tree.domain.empty.band)) return TreeCell::State::Beyond;
  const bool isWithin = certifier.isWithin(interpolated, kShareOfCells * tree.domain.bound, stack);
  return isWithin ? TreeCell::State::Certified : TreeCell::State::Split;
}

/// Evaluates and tests the cells from `first` on. Returns those that have to be split.
std::vector<std::uint32_t> testCells(CellTree& tree, std::size_t first, const FieldSurface& surface,
                                     BuildProgress& build) {
  ++build.rounds;
  const FieldDomain& domain = tree.domain;
  const std::size_t end = tree.cells.size();
  if (!surface.sign.isClosed())
    build.threads.forChunks(
        end - first, kItemsPerPart, [&](std::size_t, std::size_t from, std::size_t to) {
          for (TreeCell& cell : std::span(tree.cells).subspan(first + from, to - from))
            findSign(domain, tree.positionOf(cell.corners[0]), surface.sign, cell);
        });
  evaluateCorners(tree, first, surface, build);
  const auto allowed = static_cast<float>((1.0 - kShareOfCells) * (1.0 - kStoredError) *
                                          (domain.bound / domain.unit));
  inSlices(first, end, 0.5, build, [&](std::size_t from, std::size_t to) {
    PointQueryStack stack;
    for (TreeCell& cell : std::span(tree.cells).subspan(from, to - from)) {
      cell.state = stateOf(tree, cell, surface.certifier, stack);
      cell.allowed = allowed;
    }
  });
  std::vector<std::uint32_t> open;
  for (std::size_t i = first; i < end; ++i)
    if (tree.cells[i].state == TreeCell::State::Split)
      open.push_back(static_cast<std::uint32_t>(i));
  return open;
}

/// The number of cells after all are refined, from a build that splits few cells of each level.
double estimateCells(const FieldDomain& domain, const FieldSurface& surface,
                     const Threads& threads) {
  CellTree sample(domain, 0);
  BuildProgress silent{threads, {}};
  double eachStandsFor = 1.0, represented = 0.0;
  for (std::size_t first = 0; first < sample.cells.size();) {
    const std::size_t end = sample.cells.size();
    const std::vector<std::uint32_t> open = testCells(sample, first, surface, silent);
    represented += eachStandsFor * static_cast<double>(end - first);
    const std::size_t count = std::min(open.size(), kSampledPerLevel);
    if (count > 0) eachStandsFor *= static_cast<double>(open.size()) / static_cast<double>(count);
    for (std::size_t i = 0; i < count; ++i) sample.split(open[i * open.size() / count]);
    first = end;
  }
  return represented;
}

/// Throws if the build will need far more memory than the limit. Before that it has used a small
/// part of what the limit allows.
void checkEstimate(const CellTree& tree, const FieldSurface& surface, BuildProgress& build) {
  const std::size_t used = tree.bytesUsed();
  if (tree.memoryLimit == 0 || build.isEstimated || tree.cells.size() < kFewestForEstimate ||
      used < tree.memoryLimit / kPartBeforeEstimate)
    return;
  build.isEstimated = true;
  const double perCell = static_cast<double>(used) / static_cast<double>(tree.cells.size()),
               needed = perCell * estimateCells(tree.domain, surface, build.threads),
               limit = static_cast<double>(tree.memoryLimit);
  if (!(needed > kSureExcess * limit)) return;
  throw Error(ErrorCode::MemoryLimit, "memoryLimit is " + std::to_string(tree.memoryLimit) +
                                          " bytes; the build of the distance field needs about " +
                                          textOf(needed) +
                                          " bytes, as estimated from a sample of its cells");
}

}  // namespace

void BuildProgress::report(double fraction) const {
  if (progress && !progress(fraction))
    throw Error(ErrorCode::Cancelled, "the build of the distance field was cancelled");
}

void refine(CellTree& tree, std::size_t first, const FieldSurface& surface, BuildProgress& build) {
  while (first < tree.cells.size()) {
    const std::size_t end = tree.cells.size();
    const std::vector<std::uint32_t> open = testCells(tree, first, surface, build);
    checkEstimate(tree, surface, build);
    for (const std::uint32_t cell : open) tree.split(cell);
    first = end;
  }
}

}  // namespace palpate
