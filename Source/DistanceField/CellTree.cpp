#include "DistanceField/CellTree.h"

#include <palpate/Error.h>

#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Text.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <string>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// L. Squares of lengths in this range neither overflow nor lose bits.
constexpr double kLargestDomain = 0x1p400, kSmallestDomain = 0x1p-400;

constexpr std::size_t kBytesPerCell =
    sizeof(TreeCell) + 2 * sizeof(std::uint32_t);  // of lists in adjustCellsBeyond()
constexpr std::size_t kBytesPerCorner = 2 * sizeof(float) + 3 * sizeof(std::uint32_t) +
                                        3 * sizeof(std::uint8_t) +
                                        2 * sizeof(std::uint32_t);  // of lists in computeValues()

constexpr std::uint32_t sideOf(int level) { return 1u << (kMostLevels - level); }

}  // namespace

FieldDomain::FieldDomain(const TriangleMesh& mesh, const SurfaceSign& sign,
                         const DistanceFieldSettings& settings) {
  Eigen::AlignedBox3d box;
  for (const Triangle& triangle : mesh.topology.elements)
    for (const std::uint32_t vertex : triangle) box.extend(mesh.now[vertex]);
  const double largest = std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff());
  // Room for the rounding of distances: values at the domain's border are beyond the band.
  const double margin = settings.band * (1.0 + 0x1p-16);
  const Vector3d low = box.min().array() - margin, high = box.max().array() + margin;
  const double longest = (high - low).maxCoeff();
  if (!(longest >= kSmallestDomain && longest <= kLargestDomain))
    throw Error(ErrorCode::InvalidSettings,
                "the longest side of the box around the mesh and the band is " + textOf(longest) +
                    "; it must be from 2^-400 to 2^400");
  // At most the band, or values beyond the band could have the wrong sign.
  const double errorBound = std::min(settings.errorBound, settings.band);
  if (!(errorBound >= 0x1p-18 * longest && errorBound >= 0x1p-36 * largest))
    throw Error(ErrorCode::InvalidSettings,
                "errorBound is " + textOf(settings.errorBound) + " and band is " +
                    textOf(settings.band) + "; both must be at least 2^-18 of " + textOf(longest) +
                    ", the longest side of the box around the band, and at least 2^-36 of " +
                    textOf(largest) + ", the largest coordinate");
  empty.errorBound = errorBound;
  empty.band = settings.band;
  empty.isClosed = sign.isClosed();
  empty.unreliableMargin = std::max(0.0, sign.reach() - settings.band);
  empty.exponent = std::ilogb(longest) - 3;
  unit = std::ldexp(1.0, empty.exponent);
  for (int k = 0; k < 3; ++k) {
    const double first = std::floor(low[k] / unit);
    empty.origin[k] = static_cast<std::int64_t>(first);
    empty.size[k] = static_cast<std::uint32_t>(std::ceil(high[k] / unit) - first);
    PALPATE_ASSERT(empty.size[k] >= 1 && empty.size[k] <= kMostRoots);
    PALPATE_ASSERT(std::abs(empty.origin[k]) <= kMostOrigin);
    lower[k] = first * unit;
  }
  tolerance = kCornerError * errorBound;
  bound = errorBound - kStoredError * (settings.band + 4.0 * unit) -
          kFieldError * (largest + longest) - tolerance;
  PALPATE_ASSERT(bound > 0.0);
}

CellTree::CellTree(const FieldDomain& newDomain, std::size_t newLimit)
    : domain(newDomain), memoryLimit(newLimit) {
  const auto& size = domain.empty.size;
  for (std::uint32_t z = 0; z < size[2]; ++z)
    for (std::uint32_t y = 0; y < size[1]; ++y)
      for (std::uint32_t x = 0; x < size[0]; ++x) {
        makeRoom();
        std::array<std::uint32_t, 8> ofRoot;
        for (std::uint32_t i = 0; i < 8; ++i)
          ofRoot[i] = cornerAt({(x + (i & 1)) * sideOf(0), (y + (i >> 1 & 1)) * sideOf(0),
                                (z + (i >> 2)) * sideOf(0)},
                               kNone);
        addCell(ofRoot, nullptr);
      }
}

/// parent: the cell that is split, or kNone.
std::uint32_t CellTree::cornerAt(const Corner& corner, std::uint32_t parent) {
  const std::uint32_t number = corners.find(corner);
  if (number == parents.size()) {
    parents.push_back(parent);
    covered.push_back(0);
  }
  return number;
}

void CellTree::addCell(const std::array<std::uint32_t, 8>& ofCell, const TreeCell* parent) {
  TreeCell cell{ofCell};
  cell.isReliable = parent ? parent->isReliable : domain.empty.isClosed;
  cell.isUnreliable = parent && parent->isUnreliable;
  cell.level = static_cast<std::uint8_t>(parent ? parent->level + 1 : 0);
  for (unsigned i = 0; i < 8; ++i)
    covered[ofCell[i]] = static_cast<std::uint8_t>(covered[ofCell[i]] | 1u << (7 - i));
  cells.push_back(cell);
}

void CellTree::split(std::uint32_t index) {
  makeRoom();
  const TreeCell cell = cells[index];
  PALPATE_ASSERT(!cell.hasChildren() && cell.level < kMostLevels);
  cells[index].state = TreeCell::State::Split;
  cells[index].children = static_cast<std::uint32_t>(cells.size());
  const Corner low = corners[cell.corners[0]];
  const std::uint32_t half = sideOf(cell.level + 1);
  std::array<std::uint32_t, 27> ofChildren;  // x runs fastest
  for (std::uint32_t i = 0; i < 27; ++i) {
    const Corner at{i % 3, i / 3 % 3, i / 9};
    ofChildren[i] =
        ((at[0] | at[1] | at[2]) & 1) == 0
            ? cell.corners[at[0] / 2 | (at[1] / 2) << 1 | (at[2] / 2) << 2]
            : cornerAt({low[0] + at[0] * half, low[1] + at[1] * half, low[2] + at[2] * half},
                       index);
  }
  for (std::uint32_t child = 0; child < 8; ++child) {
    std::array<std::uint32_t, 8> ofChild;
    for (std::uint32_t i = 0; i < 8; ++i) {
      std::uint32_t at = 0;
      for (std::uint32_t k = 0, step = 1; k < 3; ++k, step *= 3)
        at += ((child >> k & 1) + (i >> k & 1)) * step;
      ofChild[i] = ofChildren[at];
    }
    addCell(ofChild, &cell);
  }
}

/// The leaf that a corner touches in an octant; kNone beyond the domain.
std::uint32_t CellTree::leafAround(const Corner& corner, std::uint32_t octant) const {
  const auto& size = domain.empty.size;
  Corner at = corner;
  std::uint32_t index = 0;
  for (int k = 2; k >= 0; --k) {
    if (!(octant >> k & 1) && at[k]-- == 0) return kNone;
    const std::uint32_t root = at[k] / sideOf(0);
    if (root >= size[k]) return kNone;
    index = index * size[k] + root;
  }
  for (int level = 1; cells[index].hasChildren(); ++level) {
    std::uint32_t child = 0;
    for (int k = 0; k < 3; ++k) child |= (at[k] / sideOf(level) & 1) << k;
    index = cells[index].children + child;
  }
  return index;
}

std::uint32_t CellTree::largestAround(std::uint32_t number) const {
  std::uint32_t largest = kNone;
  if (covered[number] == 0xff) return largest;
  const Corner corner = corners[number];
  for (std::uint32_t octant = 0; octant < 8; ++octant) {
    if (covered[number] >> octant & 1) continue;
    const std::uint32_t index = leafAround(corner, octant);
    if (index == kNone || !cells[index].isJoined()) continue;
    if (largest == kNone || cells[index].level < cells[largest].level) largest = index;
  }
  return largest;
}

InterpolatedCell CellTree::interpolated(const TreeCell& cell) const {
  InterpolatedCell result;
  result.isSigned = cell.isReliable;
  result.halfSide = domain.halfSideOf(cell.level);
  result.centre = positionOf(cell.corners[0]) + Vector3d::Constant(result.halfSide);
  std::size_t least = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    result.values[i] = valueAt(cell, i, distances) * domain.unit;
    if (std::abs(result.values[i]) < std::abs(result.values[least])) least = i;
  }
  result.nearTriangle = nearest[cell.corners[least]];
  return result;
}

double CellTree::interpolate(const TreeCell& cell, const Corner& corner) const {
  const Corner low = corners[cell.corners[0]];
  std::array<double, 3> t;
  for (int k = 0; k < 3; ++k) {
    t[k] = static_cast<double>(corner[k] - low[k]) / sideOf(cell.level);
    PALPATE_ASSERT(t[k] <= 1.0);
  }
  double sum = 0.0;
  for (std::uint32_t i = 0; i < 8; ++i) {
    double weight = 1.0;
    for (int k = 0; k < 3; ++k) weight *= i >> k & 1 ? t[k] : 1.0 - t[k];
    sum += weight * values[cell.corners[i]];
  }
  return sum;
}

std::size_t CellTree::bytesUsed() const {
  return cells.size() * kBytesPerCell + corners.size() * kBytesPerCorner + corners.bytes();
}

/// For the eight cells of a split.
void CellTree::makeRoom() {
  if (cells.size() + 8 > cells.capacity()) {
    const std::size_t size = std::max<std::size_t>(1 << 10, 2 * cells.capacity());
    checkMemory(size * kBytesPerCell);
    cells.reserve(size);
  }
  if (corners.hasRoom(27)) return;
  // Each vector's old memory is held until its new one is filled.
  checkMemory(corners.bytesToGrow() + 2 * corners.capacity() * kBytesPerCorner);
  corners.grow();
  for (auto* const column : {&parents, &nearest, &owners}) column->reserve(corners.capacity());
  for (auto* const column : {&distances, &values}) column->reserve(corners.capacity());
  for (auto* const column : {&covered, &hasSign}) column->reserve(corners.capacity());
}

void CellTree::checkMemory(std::size_t more) const {
  const std::size_t needed = cells.capacity() * kBytesPerCell + corners.bytes() +
                             corners.capacity() * kBytesPerCorner + more;
  if (memoryLimit == 0 || needed <= memoryLimit) return;
  throw Error(ErrorCode::MemoryLimit, "memoryLimit is " + std::to_string(memoryLimit) +
                                          " bytes; the distance field needs at least " +
                                          std::to_string(needed) + " bytes");
}

}  // namespace palpate
