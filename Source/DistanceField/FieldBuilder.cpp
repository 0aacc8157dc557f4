#include "DistanceField/FieldBuilder.h"

#include <palpate/Error.h>

#include "DistanceField/CellCertifier.h"
#include "DistanceField/CornerTable.h"
#include "DistanceField/NearestTriangle.h"
#include "DistanceField/SurfaceSign.h"
#include "Math/Tolerances.h"
#include "Core/Text.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <string>
#include <vector>

namespace palpate {

using Eigen::Vector3d;

namespace {

constexpr std::uint32_t kNone = 0xffffffff;
/// The part of the error bound that a cell's own interpolation may use. The rest is for corners
/// that hang.
constexpr double kShareOfCells = 0.96;
constexpr std::size_t kSlice = 1 << 14;  ///< points or cells between two calls of `progress`
constexpr std::size_t kGrain = 64;
/// Cells on lower levels are split where only some of their points may have a reliable sign.
constexpr int kSignLevel = 2;
/// The need for memory is estimated when there are so many cells, and they use this part of the
/// limit. The estimate takes about as long as the cells that are there by then.
constexpr std::size_t kFewestForEstimate = std::size_t{1} << 14, kPartBeforeEstimate = 64;
/// Cells of each level that an estimate splits. It is then right to some tens of percent.
constexpr std::size_t kSampledPerLevel = 256;
constexpr double kSureExcess = 1.5;  ///< an estimate above so many limits is a refusal

/// L. Squares of lengths in this range neither overflow nor lose bits.
constexpr double kLargestDomain = 0x1p400, kSmallestDomain = 0x1p-400;

constexpr std::uint32_t sideOf(int level) { return 1u << (kMostLevels - level); }

class FieldBuilder {
 public:
  FieldBuilder(const Body& geometry, bool isClosed, const DistanceFieldSettings& settings,
               const Threads& threads)
      : m_geometry(geometry),
        m_settings(settings),
        m_threads(threads),
        m_errorBound(std::min(settings.errorBound, settings.band)),
        m_tolerance(kCornerError * m_errorBound),
        m_sign(geometry, isClosed),
        m_nearestTriangle(geometry, m_tolerance),
        m_certifier(geometry, m_sign, m_tolerance) {
    chooseDomain();
  }

  FieldCells build() {
    addRoots();
    refine(0);
    for (std::vector<std::uint32_t> tooLarge = joinCells(0); !tooLarge.empty();) {
      const std::size_t first = m_cells.size();
      for (const std::uint32_t cell : tooLarge) split(cell);
      refine(first);
      tooLarge = joinCells(first);
    }
    report(1.0);
    return assemble();
  }

 private:
  enum class State : std::uint8_t {
    Split,
    Certified,
    Beyond,   ///< the band
    Adjusted  ///< beyond the band, with corner values, because it touches a larger cell with such
  };
  struct Cell {
    std::array<std::uint32_t, 8> corners;
    std::uint32_t children = kNone;  ///< the first of eight
    float allowed = 0;  ///< units: the deviation of corners up to which the bound is proven
    std::uint8_t level = 0;
    State state = State::Split;
    bool isOff = false;           ///< the deviation of its corners is larger than allowed
    bool isReliable = false;      ///< the sign in all of it; otherwise its values have none
    bool isUnreliable = false;    ///< the sign in all of it
    bool isSplitForSign = false;  ///< only some of its points may have a reliable sign

    bool isLeaf() const { return state == State::Certified || state == State::Adjusted; }
    /// Whether its neighbours have the same values where they meet.
    bool isJoined() const { return isLeaf() && isReliable; }
  };

  void chooseDomain() {
    Eigen::AlignedBox3d box;
    for (const Triangle& triangle : m_geometry.mesh.topology.triangles)
      for (const std::uint32_t vertex : triangle) box.extend(m_geometry.mesh.now[vertex]);
    const double largest =
        std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff());
    // Room for the rounding of distances: values at the domain's border are beyond the band.
    const double margin = m_settings.band * (1.0 + 0x1p-16);
    const Vector3d low = box.min().array() - margin, high = box.max().array() + margin;
    const double longest = (high - low).maxCoeff();
    if (!(longest >= kSmallestDomain && longest <= kLargestDomain))
      throw Error(ErrorCode::InvalidSettings,
                  "the longest side of the box around the mesh and the band is " + textOf(longest) +
                      "; it must be from 2^-400 to 2^400");
    if (!(m_errorBound >= 0x1p-18 * longest && m_errorBound >= 0x1p-36 * largest))
      throw Error(ErrorCode::InvalidSettings,
                  "errorBound is " + textOf(m_settings.errorBound) + " and band is " +
                      textOf(m_settings.band) + "; both must be at least 2^-18 of " +
                      textOf(longest) +
                      ", the longest side of the box around the band, and at least 2^-36 of " +
                      textOf(largest) + ", the largest coordinate");
    m_field.errorBound = m_errorBound;
    m_field.band = m_settings.band;
    m_field.isClosed = m_sign.isClosed();
    m_field.unreliableMargin = std::max(0.0, m_sign.reach() - m_settings.band);
    m_field.exponent = std::ilogb(longest) - 3;
    m_unit = std::ldexp(1.0, m_field.exponent);
    for (int k = 0; k < 3; ++k) {
      const double first = std::floor(low[k] / m_unit);
      m_field.origin[k] = static_cast<std::int64_t>(first);
      m_field.size[k] = static_cast<std::uint32_t>(std::ceil(high[k] / m_unit) - first);
      m_origin[k] = first * m_unit;
    }
    m_bound = m_errorBound - kStoredError * (m_settings.band + 4.0 * m_unit) -
              kFieldError * (largest + longest) - m_tolerance;
    m_allowed =
        static_cast<float>((1.0 - kShareOfCells) * (1.0 - kStoredError) * (m_bound / m_unit));
  }

  Vector3d positionOf(const Corner& corner) const {
    return m_origin + std::ldexp(m_unit, -kMostLevels) * Vector3d(corner[0], corner[1], corner[2]);
  }
  double halfSideOf(const Cell& cell) const { return std::ldexp(0.5 * m_unit, -cell.level); }
  /// values: of all corners, with signs.
  static float valueAt(const Cell& cell, std::size_t corner, const std::vector<float>& values) {
    const float value = values[cell.corners[corner]];
    return cell.isReliable ? value : std::abs(value);
  }
  InterpolatedCell interpolatedCell(const Cell& cell) const {
    InterpolatedCell result;
    result.isSigned = cell.isReliable;
    result.halfSide = halfSideOf(cell);
    result.centre = positionOf(m_corners[cell.corners[0]]) + Vector3d::Constant(result.halfSide);
    std::size_t nearest = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      result.values[i] = valueAt(cell, i, m_distances) * m_unit;
      if (std::abs(result.values[i]) < std::abs(result.values[nearest])) nearest = i;
    }
    result.nearTriangle = m_nearest[cell.corners[nearest]];
    return result;
  }

  // ---- Refinement ----

  void addRoots() {
    for (std::uint32_t z = 0; z < m_field.size[2]; ++z)
      for (std::uint32_t y = 0; y < m_field.size[1]; ++y)
        for (std::uint32_t x = 0; x < m_field.size[0]; ++x) {
          makeRoom();
          std::array<std::uint32_t, 8> corners;
          for (std::uint32_t i = 0; i < 8; ++i)
            corners[i] = cornerAt({(x + (i & 1)) * sideOf(0), (y + (i >> 1 & 1)) * sideOf(0),
                                   (z + (i >> 2)) * sideOf(0)},
                                  kNone);
          addCell(corners, 0);
        }
  }
  /// parent: the cell that is split, or kNone.
  std::uint32_t cornerAt(const Corner& corner, std::uint32_t parent) {
    const std::uint32_t number = m_corners.find(corner);
    if (number == m_parents.size()) {
      m_parents.push_back(parent);
      m_covered.push_back(0);
    }
    return number;
  }
  /// Its sign is known where that of `parent`, if any, is.
  void addCell(const std::array<std::uint32_t, 8>& corners, int level,
               const Cell* parent = nullptr) {
    Cell cell{corners};
    cell.isReliable = parent ? parent->isReliable : m_sign.isClosed();
    cell.isUnreliable = parent && parent->isUnreliable;
    cell.level = static_cast<std::uint8_t>(level);
    for (unsigned i = 0; i < 8; ++i)
      m_covered[corners[i]] = static_cast<std::uint8_t>(m_covered[corners[i]] | 1u << (7 - i));
    m_cells.push_back(cell);
  }
  void split(std::uint32_t index) {
    makeRoom();
    const Cell cell = m_cells[index];
    m_cells[index].state = State::Split;
    m_cells[index].children = static_cast<std::uint32_t>(m_cells.size());
    const Corner low = m_corners[cell.corners[0]];
    const std::uint32_t half = sideOf(cell.level + 1);
    std::array<std::uint32_t, 27> corners;  // of the children: x runs fastest
    for (std::uint32_t i = 0; i < 27; ++i) {
      const Corner at{i % 3, i / 3 % 3, i / 9};
      corners[i] =
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
        ofChild[i] = corners[at];
      }
      addCell(ofChild, cell.level + 1, &cell);
    }
  }
  /// Evaluates, tests and splits the cells from `first` on.
  void refine(std::size_t first) {
    while (first < m_cells.size()) {
      ++m_rounds;
      const std::size_t end = m_cells.size();
      if (!m_sign.isClosed())
        m_threads.forChunks(end - first, kGrain,
                            [&](std::size_t, std::size_t from, std::size_t to) {
                              for (std::size_t i = first + from; i < first + to; ++i)
                                findSign(m_cells[i]);
                            });
      evaluateCorners(first);
      inSlices(first, end, 0.5, [&](std::size_t from, std::size_t to) {
        PointQueryStack stack;
        for (std::size_t i = from; i < to; ++i) {
          m_cells[i].state = test(m_cells[i], stack);
          m_cells[i].allowed = m_allowed;
        }
      });
      checkEstimate();
      std::vector<std::uint32_t> open;
      for (std::size_t i = first; i < end; ++i)
        if (m_cells[i].state == State::Split) open.push_back(static_cast<std::uint32_t>(i));
      m_representedCells += m_eachStandsFor * static_cast<double>(end - first);
      const std::size_t count = std::min(open.size(), m_mostSplit);
      if (count > 0)
        m_eachStandsFor *= static_cast<double>(open.size()) / static_cast<double>(count);
      for (std::size_t i = 0; i < count; ++i) split(open[i * open.size() / count]);
      first = end;
    }
  }
  State test(Cell& cell, PointQueryStack& stack) const {
    if (cell.isSplitForSign) return State::Split;
    const InterpolatedCell interpolated = interpolatedCell(cell);
    if (m_certifier.isBeyond(interpolated, m_settings.band)) return State::Beyond;
    const bool isWithin = m_certifier.isWithin(interpolated, kShareOfCells * m_bound, stack);
    return isWithin ? State::Certified : State::Split;
  }
  /// Finds whether the cell has a reliable sign, or has to be split to know more.
  void findSign(Cell& cell) const {
    if (cell.isReliable || cell.isUnreliable) return;
    const double half = halfSideOf(cell);
    const Vector3d centre = positionOf(m_corners[cell.corners[0]]) + Vector3d::Constant(half);
    const auto reliability = m_sign.in(centre, std::numbers::sqrt3 * half * (1.0 + kFieldError));
    cell.isReliable = reliability == SurfaceSign::Reliability::Reliable;
    cell.isUnreliable = reliability == SurfaceSign::Reliability::Unreliable;
    cell.isSplitForSign =
        cell.level < kSignLevel && reliability == SurfaceSign::Reliability::Unknown;
  }
  /// Finds the distances of all corners that are new, and the signs of those of reliable cells from
  /// `firstCell` on. All other signs are as of points outside.
  void evaluateCorners(std::size_t firstCell) {
    const std::size_t first = m_distances.size();
    m_distances.resize(m_corners.size());
    m_nearest.resize(m_corners.size());
    m_hasSign.resize(m_corners.size());
    std::vector<std::uint32_t> known;
    for (std::size_t i = firstCell; i < m_cells.size(); ++i) {
      if (!m_cells[i].isReliable) continue;
      for (const std::uint32_t corner : m_cells[i].corners) {
        if (corner < first && !m_hasSign[corner]) known.push_back(corner);
        m_hasSign[corner] = 1;
      }
    }
    m_threads.forChunks(known.size(), kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
      PointQueryStack stack;
      for (std::size_t i = from; i < to; ++i)
        if (m_sign.isInside(positionOf(m_corners[known[i]]), stack))
          m_distances[known[i]] = -m_distances[known[i]];
    });
    inSlices(first, m_corners.size(), 0.0, [&](std::size_t from, std::size_t to) {
      PointQueryStack stack;
      for (std::size_t i = from; i < to; ++i) evaluate(i, stack);
    });
  }
  void evaluate(std::size_t i, PointQueryStack& stack) {
    const Vector3d point = positionOf(m_corners[i]);
    std::array<std::uint32_t, 8> likely{};
    // Where it is reliable, the sign changes only at the surface.
    int sign = m_hasSign[i] ? 0 : 1;
    if (const std::uint32_t parent = m_parents[i]; parent != kNone)
      for (std::size_t k = 0; k < 8; ++k) {
        const std::uint32_t corner = m_cells[parent].corners[k];
        likely[k] = m_nearest[corner];
        if (sign != 0 || !m_cells[parent].isReliable) continue;
        const double distance = std::abs(m_distances[corner]) * m_unit;
        if ((point - positionOf(m_corners[corner])).norm() < 0.999 * distance - m_tolerance)
          sign = m_distances[corner] < 0.0f ? -1 : 1;
      }
    const auto near =
        m_nearestTriangle.at(point, std::span(likely).first(m_parents[i] == kNone ? 1 : 8));
    if (sign == 0) sign = m_sign.isInside(point, stack) ? -1 : 1;
    m_distances[i] = static_cast<float>(sign * near.distance / m_unit);
    m_nearest[i] = near.place;
  }
  /// Calls f(from, to) for parts of [first, end), on all threads, and reports the progress. done:
  /// share of this round before the call; the call does half of it.
  template <class F>
  void inSlices(std::size_t first, std::size_t end, double done, F&& f) {
    for (std::size_t at = first; at < end; at += kSlice) {
      // An estimate: half of the work that is left is done in a round.
      const double inRound =
          done + 0.5 * static_cast<double>(at - first) / static_cast<double>(end - first);
      report(1.0 - std::ldexp(1.0 - 0.5 * inRound, 1 - m_rounds));
      const std::size_t size = std::min(kSlice, end - at);
      m_threads.forChunks(size, kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
        f(at + from, at + to);
      });
    }
  }
  void report(double fraction) const {
    if (m_settings.progress && !m_settings.progress(fraction))
      throw Error(ErrorCode::Cancelled, "the build of the distance field was cancelled");
  }
  // ---- Memory ----

  /// Throws if the build will need far more memory than the limit. Before that it has used a small
  /// part of what the limit allows.
  void checkEstimate() {
    const std::size_t used =
        m_cells.size() * kBytesPerCell + m_corners.size() * kBytesPerCorner + m_corners.bytes();
    if (m_settings.memoryLimit == 0 || m_isEstimated || m_cells.size() < kFewestForEstimate ||
        used < m_settings.memoryLimit / kPartBeforeEstimate)
      return;
    m_isEstimated = true;
    const double perCell = static_cast<double>(used) / static_cast<double>(m_cells.size()),
                 needed = perCell * estimateCells(),
                 limit = static_cast<double>(m_settings.memoryLimit);
    if (!(needed > kSureExcess * limit)) return;
    throw Error(ErrorCode::MemoryLimit, "memoryLimit is " + std::to_string(m_settings.memoryLimit) +
                                            " bytes; the build of the distance field needs about " +
                                            textOf(needed) +
                                            " bytes, as estimated from a sample of its cells");
  }
  /// The number of cells after all are refined, from a build that splits few cells of each level.
  double estimateCells() const {
    DistanceFieldSettings settings = m_settings;
    settings.memoryLimit = 0;
    settings.progress = {};
    FieldBuilder sample(m_geometry, m_sign.isClosed(), settings, m_threads);
    sample.m_mostSplit = kSampledPerLevel;
    sample.addRoots();
    sample.refine(0);
    return sample.m_representedCells;
  }
  /// For the eight cells of a split.
  void makeRoom() {
    if (m_cells.size() + 8 > m_cells.capacity()) {
      const std::size_t size = std::max<std::size_t>(1 << 10, 2 * m_cells.capacity());
      checkMemory(size * kBytesPerCell);
      m_cells.reserve(size);
    }
    if (m_corners.hasRoom(27)) return;
    // Each vector's old memory is held until its new one is filled.
    checkMemory(m_corners.bytesToGrow() + 2 * m_corners.capacity() * kBytesPerCorner);
    m_corners.grow();
    m_parents.reserve(m_corners.capacity());
    m_covered.reserve(m_corners.capacity());
    m_distances.reserve(m_corners.capacity());
    m_hasSign.reserve(m_corners.capacity());
    m_nearest.reserve(m_corners.capacity());
    m_values.reserve(m_corners.capacity());
    m_owners.reserve(m_corners.capacity());
  }
  /// Throws if the build may not allocate so many bytes.
  void checkMemory(std::size_t more) const {
    const std::size_t needed = m_cells.capacity() * kBytesPerCell + m_corners.bytes() +
                               m_corners.capacity() * kBytesPerCorner + more;
    if (m_settings.memoryLimit == 0 || needed <= m_settings.memoryLimit) return;
    throw Error(ErrorCode::MemoryLimit, "memoryLimit is " + std::to_string(m_settings.memoryLimit) +
                                            " bytes; the distance field needs at least " +
                                            std::to_string(needed) + " bytes");
  }

  // ---- Continuity ----

  /// The leaf that a corner touches in an octant; kNone beyond the domain.
  std::uint32_t leafAround(const Corner& corner, std::uint32_t octant) const {
    Corner at = corner;
    std::uint32_t index = 0;
    for (int k = 2; k >= 0; --k) {
      if (!(octant >> k & 1) && at[k]-- == 0) return kNone;
      const std::uint32_t root = at[k] / sideOf(0);
      if (root >= m_field.size[k]) return kNone;
      index = index * m_field.size[k] + root;
    }
    for (int level = 1; m_cells[index].children != kNone; ++level) {
      std::uint32_t child = 0;
      for (int k = 0; k < 3; ++k) child |= (at[k] / sideOf(level) & 1) << k;
      index = m_cells[index].children + child;
    }
    return index;
  }
  /// The largest cell with values that the corner touches other than with a corner, or kNone. The
  /// corner hangs on it, unless its values have no sign.
  std::uint32_t largestAround(std::uint32_t number) const {
    std::uint32_t largest = kNone;
    if (m_covered[number] == 0xff) return largest;
    const Corner corner = m_corners[number];
    for (std::uint32_t octant = 0; octant < 8; ++octant) {
      if (m_covered[number] >> octant & 1) continue;
      const std::uint32_t index = leafAround(corner, octant);
      if (index == kNone || !m_cells[index].isJoined()) continue;
      if (largest == kNone || m_cells[index].level < m_cells[largest].level) largest = index;
    }
    return largest;
  }
  double interpolate(const Cell& cell, const Corner& corner) const {
    const Corner low = m_corners[cell.corners[0]];
    std::array<double, 3> t;
    for (int k = 0; k < 3; ++k) t[k] = static_cast<double>(corner[k] - low[k]) / sideOf(cell.level);
    double sum = 0.0;
    for (std::uint32_t i = 0; i < 8; ++i) {
      double weight = 1.0;
      for (int k = 0; k < 3; ++k) weight *= i >> k & 1 ? t[k] : 1.0 - t[k];
      sum += weight * m_values[cell.corners[i]];
    }
    return sum;
  }

  /// Computes m_values, after cells from `first` on were added. Returns the cells that have to be
  /// split, because values that hang on them are too far off.
  std::vector<std::uint32_t> joinCells(std::size_t first) {
    adjustCellsBeyond(first);
    findOwners();
    const std::vector<std::uint8_t> hasChanged = computeValues();
    std::vector<std::uint32_t> tooLarge;
    m_threads.forChunks(m_cells.size(), 256, [&](std::size_t, std::size_t from, std::size_t to) {
      PointQueryStack stack;
      for (std::size_t i = from; i < to; ++i) {
        Cell& cell = m_cells[i];
        if (i >= first || cell.isOff ||
            std::any_of(cell.corners.begin(), cell.corners.end(),
                        [&](std::uint32_t corner) { return hasChanged[corner] != 0; }))
          cell.isOff = !isAllowed(cell, stack);
      }
    });
    for (const Cell& cell : m_cells)
      for (const std::uint32_t corner : cell.corners)
        if (cell.isOff && deviationOf(corner) > 0.5 * deviationOf(cell))
          tooLarge.push_back(m_owners[corner]);
    std::sort(tooLarge.begin(), tooLarge.end());
    tooLarge.erase(std::unique(tooLarge.begin(), tooLarge.end()), tooLarge.end());
    return tooLarge;
  }
  /// The largest cell around a corner stays the largest until it is split.
  void findOwners() {
    const std::size_t known = m_owners.size();
    m_owners.resize(m_corners.size(), kNone);
    m_threads.forChunks(m_owners.size(), 1024, [&](std::size_t, std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i)
        if (i >= known || (m_owners[i] != kNone && m_cells[m_owners[i]].children != kNone))
          m_owners[i] = largestAround(static_cast<std::uint32_t>(i));
    });
  }
  /// Returns for each corner whether its value is another one than before.
  std::vector<std::uint8_t> computeValues() {
    const std::size_t known = m_values.size();
    m_values.insert(m_values.end(), m_distances.begin() + static_cast<std::ptrdiff_t>(known),
                    m_distances.end());
    std::vector<std::uint8_t> hasChanged(m_corners.size());
    // A corner of a larger cell hangs on still larger ones only.
    std::array<std::vector<std::uint32_t>, kMostLevels + 1> byLevel;
    for (std::uint32_t i = 0; i < m_owners.size(); ++i) {
      if (m_owners[i] != kNone) {
        byLevel[m_cells[m_owners[i]].level].push_back(i);
      } else if (m_values[i] != m_distances[i]) {
        m_values[i] = m_distances[i];
        hasChanged[i] = 1;
      }
    }
    for (const std::vector<std::uint32_t>& corners : byLevel)
      m_threads.forChunks(corners.size(), 1024, [&](std::size_t, std::size_t from, std::size_t to) {
        for (std::size_t j = from; j < to; ++j) {
          const std::uint32_t i = corners[j];
          const auto value = static_cast<float>(interpolate(m_cells[m_owners[i]], m_corners[i]));
          hasChanged[i] = value != m_values[i];
          m_values[i] = value;
        }
      });
    return hasChanged;
  }
  /// Units: how far what hangs is off.
  double deviationOf(std::uint32_t corner) const {
    return std::abs(double{m_values[corner]} - m_distances[corner]);
  }
  double deviationOf(const Cell& cell) const {
    double most = 0.0;
    for (const std::uint32_t corner : cell.corners) most = std::max(most, deviationOf(corner));
    return most;
  }
  /// Whether a cell's error and the deviation of its values are together within the bound.
  bool isAllowed(Cell& cell, PointQueryStack& stack) const {
    if (cell.state != State::Certified || !cell.isReliable) return true;
    const double deviation = deviationOf(cell);
    if (deviation <= cell.allowed) return true;
    auto share = static_cast<float>(deviation);
    if (share < deviation) share = std::nextafter(share, std::numeric_limits<float>::infinity());
    const double left = m_bound - share * m_unit;
    if (!(left > 0) || !m_certifier.isWithin(interpolatedCell(cell), left, stack)) return false;
    cell.allowed = share;
    return true;
  }
  /// Gives values to cells from `first` on that are beyond the band and touch a larger cell with
  /// values, so that both agree where they meet. Older cells need none: what they touch was not
  /// smaller before.
  void adjustCellsBeyond(std::size_t first) {
    std::array<std::vector<std::uint32_t>, kMostLevels + 1> byLevel;
    for (std::size_t i = first; i < m_cells.size(); ++i)
      if (m_cells[i].state == State::Beyond && m_cells[i].isReliable)
        byLevel[m_cells[i].level].push_back(static_cast<std::uint32_t>(i));
    for (const std::vector<std::uint32_t>& cells : byLevel)
      for (const std::uint32_t i : cells) {
        const auto& corners = m_cells[i].corners;
        if (std::any_of(corners.begin(), corners.end(), [&](std::uint32_t corner) {
              const std::uint32_t largest = largestAround(corner);
              return largest != kNone && m_cells[largest].level < m_cells[i].level;
            }))
          m_cells[i].state = State::Adjusted;
      }
  }

  // ---- Numbering ----

  FieldCells assemble() {
    std::size_t leaves = 0, blocks = 0;
    for (const Cell& cell : m_cells) leaves += cell.isLeaf(), blocks += cell.children != kNone;
    if (std::max(leaves, blocks) >= CellEntry::kMostIndices)
      throw Error(ErrorCode::TooLarge, "the distance field has " + std::to_string(leaves) +
                                           " cells; at most 2^29 are supported");
    const std::size_t roots = std::size_t{m_field.size[0]} * m_field.size[1] * m_field.size[2];
    checkMemory(leaves * sizeof(FieldCells::Leaf) + blocks * sizeof(FieldCells::Block) +
                roots * sizeof(CellEntry));
    m_field.leaves.reserve(leaves);
    m_field.blocks.reserve(blocks);
    m_field.roots.resize(roots);
    for (std::uint32_t i = 0; i < roots; ++i) m_field.roots[i] = number(m_cells[i]);
    return std::move(m_field);
  }
  CellEntry number(const Cell& cell) {
    if (cell.children != kNone) {
      const auto block = static_cast<std::uint32_t>(m_field.blocks.size());
      m_field.blocks.emplace_back();
      for (std::uint32_t i = 0; i < 8; ++i) {
        const CellEntry child = number(m_cells[cell.children + i]);
        m_field.blocks[block][i] = child;
      }
      return CellEntry::of(CellKind::Block, true, block);
    }
    if (cell.state == State::Beyond)
      return CellEntry::of(valueAt(cell, 0, m_distances) < 0 ? CellKind::Inside : CellKind::Outside,
                           cell.isReliable);
    FieldCells::Leaf& leaf = m_field.leaves.emplace_back();
    const std::vector<float>& values = cell.isReliable ? m_values : m_distances;
    for (std::uint32_t i = 0; i < 8; ++i) leaf[i] = valueAt(cell, i, values);
    return CellEntry::of(CellKind::Leaf, cell.isReliable,
                         static_cast<std::uint32_t>(m_field.leaves.size() - 1));
  }

  const Body& m_geometry;
  const DistanceFieldSettings& m_settings;
  const Threads& m_threads;
  /// L: at most the band, or values beyond the band could have the wrong sign.
  const double m_errorBound;
  const double m_tolerance;  ///< L: the error of distances at corners
  const SurfaceSign m_sign;
  const NearestTriangle m_nearestTriangle;
  const CellCertifier m_certifier;
  FieldCells m_field;
  Vector3d m_origin;
  double m_unit = 1.0;   ///< L
  double m_bound = 0.0;  ///< L: the error bound without what rounding may add
  float m_allowed = 0;   ///< units: the part of it that is for corners that hang
  int m_rounds = 0;
  // For an estimate: all cells of a level are split but there.
  std::size_t m_mostSplit = std::numeric_limits<std::size_t>::max();
  double m_eachStandsFor = 1.0, m_representedCells = 0.0;
  bool m_isEstimated = false;
  std::vector<Cell> m_cells;  ///< the roots come first
  static constexpr std::size_t kBytesPerCell =
      sizeof(Cell) + 2 * sizeof(std::uint32_t);  // of lists in adjustCellsBeyond()
  CornerTable m_corners;
  // Of each corner:
  std::vector<std::uint32_t> m_parents;  ///< the cell whose split made it, or kNone
  std::vector<std::uint8_t> m_covered;   ///< octants in which it is the corner of a cell, as bits
  std::vector<float> m_distances;        ///< units
  std::vector<std::uint8_t> m_hasSign;   ///< of the distance: a reliable cell has this corner
  std::vector<std::uint32_t> m_nearest;  ///< the nearest triangle, by its place in the octree
  std::vector<float> m_values;           ///< units: what the cells interpolate
  std::vector<std::uint32_t> m_owners;   ///< the cell on which it hangs, or kNone
  static constexpr std::size_t kBytesPerCorner =
      2 * sizeof(float) + 3 * sizeof(std::uint32_t) + 3 * sizeof(std::uint8_t) +
      2 * sizeof(std::uint32_t);  // of lists in computeValues()
};

}  // namespace

FieldCells buildField(const Body& geometry, bool isClosed, const DistanceFieldSettings& settings,
                      const Threads& threads) {
  return FieldBuilder(geometry, isClosed, settings, threads).build();
}

}  // namespace palpate
