#pragma once

#include <palpate/DistanceField.h>

#include "Math/StableLength.h"
#include "Core/Assert.h"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace palpate {

/// What a cell of a field is: the upper two bits of its entry.
enum class CellKind : std::uint32_t {
  Block,    ///< it has eight children; the entry's index is that of their block
  Leaf,     ///< it has corner values; the index is that of the leaf
  Outside,  ///< every point of it has at least the distance `band`, outside
  Inside,   ///< the same inside
};

/// A cell: its kind, whether its sign is unreliable, and the index of its block or leaf.
struct CellEntry {
  static constexpr std::uint32_t kKindShift = 30, kUnreliable = 1u << 29, kMostIndices = 1u << 29;

  std::uint32_t bits = 0;

  static CellEntry of(CellKind kind, bool isReliable = true, std::uint32_t index = 0) {
    PALPATE_ASSERT(index < kMostIndices);
    PALPATE_ASSERT(isReliable || kind == CellKind::Leaf || kind == CellKind::Outside);
    return {static_cast<std::uint32_t>(kind) << kKindShift | (isReliable ? 0 : kUnreliable) |
            index};
  }
  CellKind kind() const { return static_cast<CellKind>(bits >> kKindShift); }
  /// False only in a leaf without negative values, or in a cell outside.
  bool isReliable() const { return (bits & kUnreliable) == 0; }
  std::uint32_t index() const { return bits & (kMostIndices - 1); }
};

/// Most halvings of a root cell.
constexpr int kMostLevels = 16;
/// Most root cells along an axis. Integer coordinates of corners on the finest level have 21 bits.
constexpr std::uint32_t kMostRoots = 31;
/// Units: the largest coordinate of a domain's origin.
constexpr std::int64_t kMostOrigin = std::int64_t{1} << 48;

/// The cells of a field: a grid of root cells, which are octrees. Corners and children are numbered
/// by octant (bit 0: x, 1: y, 2: z).
///
/// Lengths are in units: the side of a root cell, which is a power of two. Corners are multiples of
/// a cell's side. Their coordinates and those of points are therefore exact, except for the one
/// rounding of `point - origin`.
struct FieldCells {
  using Leaf = std::array<float, 8>;       ///< units: the values at the corners
  using Block = std::array<CellEntry, 8>;  ///< the children

  double errorBound = 0.0, band = 0.0;         ///< L
  int exponent = 0;                            ///< a unit is 2^exponent L
  std::array<std::int64_t, 3> origin{};        ///< units
  std::array<std::uint32_t, 3> size{1, 1, 1};  ///< root cells along each axis
  bool isClosed = true;                        ///< whether all signs are reliable
  double unreliableMargin = 0.0;  ///< L: around the domain; the sign is reliable further away
  std::vector<CellEntry> roots;   ///< x runs fastest
  std::vector<Block> blocks;      ///< the children of a block come after it
  std::vector<Leaf> leaves;

  static double mix(double a, double b, double t) { return a + t * (b - a); }
  /// Units: trilinear, between the values at the corners.
  static double interpolate(const Leaf& v, double x, double y, double z) {
    return mix(mix(mix(v[0], v[1], x), mix(v[2], v[3], x), y),
               mix(mix(v[4], v[5], x), mix(v[6], v[7], x), y), z);
  }
  CellEntry root(const std::array<std::uint32_t, 3>& at) const {
    return roots[(at[2] * size[1] + at[1]) * size[0] + at[0]];
  }
  std::size_t bytes() const {
    return roots.capacity() * sizeof(CellEntry) + blocks.capacity() * sizeof(Block) +
           leaves.capacity() * sizeof(Leaf);
  }
};

/// Where a field is.
struct FieldFrame {
  double toUnits, unit;          ///< units of a length L, and L of a unit
  double band;                   ///< units
  std::array<double, 3> origin;  ///< L
  std::array<double, 3> size;    ///< units

  explicit FieldFrame(const FieldCells& cells)
      : toUnits(std::ldexp(1.0, -cells.exponent)),
        unit(std::ldexp(1.0, cells.exponent)),
        band(cells.band * toUnits) {
    if (band * unit > cells.band) band = std::nextafter(band, 0.0);  // a denormal, rounded up
    for (std::size_t k = 0; k < 3; ++k) {
      origin[k] = static_cast<double>(cells.origin[k]) * unit;
      size[k] = cells.size[k];
    }
  }
};

/// Finds cells of a field and interpolates in them.
class FieldLookup {
 public:
  explicit FieldLookup(const FieldCells& cells) : m_cells(cells), m_frame(cells) {
    PALPATE_ASSERT(cells.roots.size() ==
                   std::size_t{cells.size[0]} * cells.size[1] * cells.size[2]);
  }

  /// value() of many points, with the same bits. All must be finite.
  void values(std::span<const Eigen::Vector3d> points, double* out) const;

  const FieldCells& cells() const { return m_cells; }

  /// L. The point must be finite.
  double value(const Eigen::Vector3d& point) const {
    PALPATE_ASSERT(point.allFinite());
    const Place place = at(point);
    const double inDomain = m_frame.unit * clamped(interpolate(place));
    return place.isOutside ? inDomain + stableLength(outsideOf(point)) : inDomain;
  }
  /// L: value(), but in a cell beyond the band, outside, the band and the distance from the cell's
  /// faces. The surface is at least that far away, as all points of the cell are beyond the band.
  double distanceBound(const Eigen::Vector3d& point) const {
    const Place place = at(point);
    if (place.entry.kind() != CellKind::Outside) return value(point);
    double inside = 1.0;
    for (const double t : place.t) inside = std::fmin(inside, std::fmin(t, 1.0 - t));
    const double beyond = place.isOutside ? stableLength(outsideOf(point)) : 0.0;
    return m_frame.unit * (m_frame.band + inside / place.perSide) + beyond;
  }
  bool signIsReliable(const Eigen::Vector3d& point) const {
    if (m_cells.isClosed) return true;
    const Place place = at(point);
    return place.isOutside ? stableLength(outsideOf(point)) > m_cells.unreliableMargin
                           : place.entry.isReliable();
  }
  Eigen::Vector3d gradient(const Eigen::Vector3d& point) const {
    PALPATE_ASSERT(point.allFinite());
    const Place place = at(point);
    if (place.isOutside) return outsideOf(point).stableNormalized();
    if (place.entry.kind() != CellKind::Leaf) return Eigen::Vector3d::Zero();
    const double value = interpolate(place);
    if (clamped(value) != value) return Eigen::Vector3d::Zero();
    const FieldCells::Leaf& v = m_cells.leaves[place.entry.index()];
    Eigen::Vector3d gradient;
    for (int k = 0; k < 3; ++k) {  // the bilinear interpolation of the differences along axis k
      const int i = 1 << (k + 1) % 3, j = 1 << (k + 2) % 3, step = 1 << k;
      const auto difference = [&](int corner) {
        return double{v[corner + step]} - double{v[corner]};
      };
      const double s = place.t[(k + 1) % 3], t = place.t[(k + 2) % 3];
      gradient[k] =
          place.perSide * FieldCells::mix(FieldCells::mix(difference(0), difference(i), s),
                                          FieldCells::mix(difference(j), difference(i + j), s), t);
    }
    return gradient;
  }

 private:
  struct Place {
    CellEntry entry;
    std::array<double, 3> t;  ///< in [0, 1]: where the point is in the cell
    double perSide;           ///< sides of this cell in a unit
    bool isOutside;           ///< of the domain; the rest is of the nearest point of the domain
  };

  Place at(const Eigen::Vector3d& point) const {
    Place place{{}, {}, 1.0, false};
    std::array<std::uint32_t, 3> root;
    for (int k = 0; k < 3; ++k) {
      const double u = (point[k] - m_frame.origin[k]) * m_frame.toUnits;
      const double in = u > 0.0 ? std::fmin(u, m_frame.size[k]) : 0.0;  // never -0
      place.isOutside |= u != in;
      root[k] = std::min(static_cast<std::uint32_t>(in), m_cells.size[k] - 1);
      place.t[k] = in - root[k];
    }
    place.entry = m_cells.root(root);
    while (place.entry.kind() == CellKind::Block) {
      std::uint32_t octant = 0;
      for (int k = 0; k < 3; ++k) {
        const double doubled = 2.0 * place.t[k];
        const bool upper = doubled >= 1.0;
        octant |= std::uint32_t{upper} << k;
        place.t[k] = doubled - (upper ? 1.0 : 0.0);
      }
      place.perSide *= 2.0;
      PALPATE_ASSERT(place.entry.index() < m_cells.blocks.size());
      place.entry = m_cells.blocks[place.entry.index()][octant];
    }
    return place;
  }
  double interpolate(const Place& place) const {  // units
    if (place.entry.kind() != CellKind::Leaf)
      return place.entry.kind() == CellKind::Inside ? -m_frame.band : m_frame.band;
    PALPATE_ASSERT(place.entry.index() < m_cells.leaves.size());
    return FieldCells::interpolate(m_cells.leaves[place.entry.index()], place.t[0], place.t[1],
                                   place.t[2]);
  }
  /// By comparisons: the sign of the minimum or maximum of 0 and -0 is not defined, and a band that
  /// is far smaller than a unit is 0.
  double clamped(double value) const {
    if (value < -m_frame.band) return -m_frame.band;
    return value > m_frame.band ? m_frame.band : value;
  }
  /// From the nearest point of the domain.
  Eigen::Vector3d outsideOf(const Eigen::Vector3d& point) const {
    Eigen::Vector3d out;
    for (int k = 0; k < 3; ++k) {
      const double end = m_frame.origin[k] + m_frame.size[k] * m_frame.unit;
      out[k] = point[k] < m_frame.origin[k] ? point[k] - m_frame.origin[k]
               : point[k] > end             ? point[k] - end
                                            : 0.0;
    }
    return out;
  }

  const FieldCells& m_cells;
  FieldFrame m_frame;
};

struct DistanceField::Implementation {
  explicit Implementation(FieldCells newCells) : cells(std::move(newCells)), lookup(cells) {}
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  /// Throws if the field was moved from.
  static const FieldLookup& lookupOf(const DistanceField& field) { return field.valid().lookup; }

  const FieldCells cells;
  const FieldLookup lookup;
};

}  // namespace palpate
