#include "DistanceField/FieldMinimum.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace palpate {

namespace {

/// A corner of a part of the feature. Lengths are in units of the field.
struct Corner {
  std::array<double, 3> at;       ///< in the cell, whose side is 1
  std::array<double, 3> weights;  ///< of the feature's corners
  double radius;
};

Corner between(const Corner& a, const Corner& b, double share) {
  const auto mix = [=](double p, double q) { return p + share * (q - p); };
  Corner corner;
  for (int k = 0; k < 3; ++k) {
    corner.at[k] = mix(a.at[k], b.at[k]);
    corner.weights[k] = mix(a.weights[k], b.weights[k]);
  }
  corner.radius = mix(a.radius, b.radius);
  return corner;
}

/// The part of a feature in a cell: a segment, or a convex polygon. A triangle clipped by a box has
/// at most 9 corners. Rounding may add some to it.
struct FeaturePart {
  static constexpr std::size_t kMostCorners = 16;

  std::array<Corner, kMostCorners> corners;
  std::size_t size = 0;

  /// A corner too many is on a side that is straight but for rounding, and is left out.
  void add(const Corner& corner) {
    if (size < kMostCorners) corners[size++] = corner;
  }
};

/// The part on one side of the plane at[axis] = plane. Its corners are exactly on that side.
void clip(const FeaturePart& part, int axis, double plane, bool upper, FeaturePart& out) {
  out.size = 0;
  const auto isOn = [&](const Corner& c) {
    return upper ? c.at[axis] >= plane : c.at[axis] <= plane;
  };
  const bool isSegment = part.size == 2;
  for (std::size_t i = 0; i < part.size; ++i) {
    const Corner& corner = part.corners[i];
    const bool on = isOn(corner);
    if (on) out.add(corner);
    if (isSegment && i == 1) break;
    const Corner& next = part.corners[(i + 1) % part.size];
    if (on == isOn(next) || corner.at[axis] == plane || next.at[axis] == plane) continue;
    // The same two corners give the same point in either order.
    const Corner &low = corner.at[axis] < next.at[axis] ? corner : next,
                 &high = corner.at[axis] < next.at[axis] ? next : corner;
    Corner cut = between(low, high, (plane - low.at[axis]) / (high.at[axis] - low.at[axis]));
    cut.at[axis] = plane;
    out.add(cut);
  }
  if (out.size < 2) out.size = 0;  // a point of the plane, which the other side has, too
}

class DeepPointSearch {
 public:
  DeepPointSearch(const FieldLookup& lookup, std::span<const Eigen::Vector3d> corners,
                  std::span<const double> radii, double target, double tolerance)
      : m_cells(lookup.cells()),
        m_toUnits(std::ldexp(1.0, -m_cells.exponent)),
        m_band(m_cells.band * m_toUnits),
        m_limit(target * m_toUnits),
        m_tolerance(tolerance * m_toUnits) {
    FeaturePart part;
    const double unit = std::ldexp(1.0, m_cells.exponent);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      Corner corner{{}, {}, radii[i] * m_toUnits};
      for (int k = 0; k < 3; ++k)
        corner.at[k] = (corners[i][k] - static_cast<double>(m_cells.origin[k]) * unit) * m_toUnits;
      corner.weights[i] = 1.0;
      m_largestRadius = std::max(m_largestRadius, corner.radius);
      part.add(corner);
    }
    if (m_limit < -m_band - m_largestRadius) return;  // no value is below
    searchRoots(part, 0, {});
  }

  std::optional<DeepPoint> found() const {
    if (!m_found) return {};
    Eigen::Vector3d weights;
    for (int k = 0; k < 3; ++k) weights[k] = std::max(0.0, m_best.weights[k]);
    return DeepPoint{weights, m_value * std::ldexp(1.0, m_cells.exponent)};
  }

 private:
  /// Cuts the part by the planes between root cells, axis by axis. Outside the domain the distance
  /// is beyond the band.
  void searchRoots(const FeaturePart& part, int axis, std::array<std::uint32_t, 3> root) {
    if (part.size == 0) return;
    if (axis == 3) {
      const CellEntry entry = m_cells.root(root);
      if (entry.kind() == CellKind::Outside) return;
      FeaturePart inCell;
      inCell.size = part.size;
      for (std::size_t i = 0; i < part.size; ++i) {
        inCell.corners[i] = part.corners[i];
        for (int k = 0; k < 3; ++k) inCell.corners[i].at[k] -= root[k];
      }
      return searchCell(inCell, entry);
    }
    double lower = std::numeric_limits<double>::infinity(), upper = -lower;
    for (std::size_t i = 0; i < part.size; ++i) {
      lower = std::min(lower, part.corners[i].at[axis]);
      upper = std::max(upper, part.corners[i].at[axis]);
    }
    const double size = m_cells.size[axis];
    if (!(upper >= 0.0 && lower <= size)) return;
    const auto first = static_cast<std::uint32_t>(std::max(lower, 0.0)),
               last = static_cast<std::uint32_t>(std::min(upper, size));
    FeaturePart above, slab;
    for (root[axis] = std::min(first, m_cells.size[axis] - 1);
         root[axis] <= std::min(last, m_cells.size[axis] - 1); ++root[axis]) {
      const double bottom = root[axis], top = bottom + 1.0;
      if (lower >= bottom && upper <= top) {
        searchRoots(part, axis + 1, root);
        continue;
      }
      clip(part, axis, bottom, true, above);
      clip(above, axis, top, false, slab);
      searchRoots(slab, axis + 1, root);
    }
  }

  void searchCell(const FeaturePart& part, CellEntry entry) {
    if (part.size == 0) return;
    switch (entry.kind()) {
      case CellKind::Outside:
        return;  // the target is below the band
      case CellKind::Inside:
        for (std::size_t i = 0; i < part.size; ++i)
          sample(part.corners[i], -m_band - part.corners[i].radius);
        return;
      case CellKind::Leaf:
        return searchLeaf(part, m_cells.leaves[entry.index()]);
      case CellKind::Block:
        return searchBlock(part, m_cells.blocks[entry.index()], 0, 0);
    }
  }

  /// Cuts the part by the middle planes of a cell, axis by axis.
  void searchBlock(const FeaturePart& part, const FieldCells::Block& children, int axis,
                   unsigned octant) {
    if (part.size == 0) return;
    if (axis == 3) {
      if (children[octant].kind() == CellKind::Outside) return;  // as searchCell() does
      FeaturePart inChild;
      inChild.size = part.size;
      for (std::size_t i = 0; i < part.size; ++i) {
        inChild.corners[i] = part.corners[i];
        for (int k = 0; k < 3; ++k)  // exact
          inChild.corners[i].at[k] = 2.0 * part.corners[i].at[k] - (octant >> k & 1);
      }
      return searchCell(inChild, children[octant]);
    }
    bool below = true, above = true;
    for (std::size_t i = 0; i < part.size; ++i) {
      below = below && part.corners[i].at[axis] <= 0.5;
      above = above && part.corners[i].at[axis] >= 0.5;
    }
    if (below) return searchBlock(part, children, axis + 1, octant);
    if (above) return searchBlock(part, children, axis + 1, octant | 1u << axis);
    FeaturePart half;
    for (const bool upper : {false, true}) {
      clip(part, axis, 0.5, upper, half);
      searchBlock(half, children, axis + 1, octant | (upper ? 1u << axis : 0u));
    }
  }

  void searchLeaf(const FeaturePart& part, const FieldCells::Leaf& leaf) {
    const auto least = static_cast<double>(*std::min_element(leaf.begin(), leaf.end()));
    if (bounded(least - m_largestRadius, m_largestRadius) > m_limit) return;
    if (part.size == 2) return searchSegment(leaf, part.corners[0], part.corners[1]);
    for (std::size_t i = 2; i < part.size; ++i)
      searchTriangle(leaf, part.corners[0], part.corners[i - 1], part.corners[i]);
  }

  /// The mean over all ways to take one coordinate from each of three corners, less the radius: the
  /// Bezier ordinate of these corners.
  static double ordinate(const FieldCells::Leaf& leaf, const Corner& a, const Corner& b,
                         const Corner& c) {
    const auto at = [&](const Corner& x, const Corner& y, const Corner& z) {
      return FieldCells::interpolate(leaf, x.at[0], y.at[1], z.at[2]);
    };
    return ((at(a, b, c) + at(b, c, a) + at(c, a, b)) + (at(a, c, b) + at(b, a, c) + at(c, b, a))) /
               6.0 -
           (a.radius + b.radius + c.radius) / 3.0;
  }
  /// The same if two of the three corners are `a`.
  static double ordinate(const FieldCells::Leaf& leaf, const Corner& a, const Corner& b) {
    return (FieldCells::interpolate(leaf, b.at[0], a.at[1], a.at[2]) +
            FieldCells::interpolate(leaf, a.at[0], b.at[1], a.at[2]) +
            FieldCells::interpolate(leaf, a.at[0], a.at[1], b.at[2])) /
               3.0 -
           (2.0 * a.radius + b.radius) / 3.0;
  }
  /// A lower bound of interpolated values is also one of the field's, which end at the band.
  /// radius: the largest of the part.
  double bounded(double lower, double radius) const { return std::max(lower, -m_band - radius); }
  /// The ordinate of a corner: the interpolated value, less the radius.
  static double ordinate(const FieldCells::Leaf& leaf, const Corner& c) {
    return FieldCells::interpolate(leaf, c.at[0], c.at[1], c.at[2]) - c.radius;
  }
  /// The field's value, less the radius, where the ordinate is that of the corner.
  double valueOf(double ordinate, const Corner& c) const {
    return std::min(std::max(ordinate, -m_band - c.radius), m_band - c.radius);
  }

  void sample(const Corner& corner, double value) {
    if (m_found ? !(value < m_value) : !(value <= m_limit)) return;
    m_found = true;
    m_value = value;
    m_best = corner;
    m_limit = value - m_tolerance;
  }
  /// Whether a part needs to be split: values below the limit are possible, and may be further
  /// below those of its corners than the tolerance.
  bool isOpen(double lowest, double sampled) const {
    return lowest <= m_limit && sampled - lowest > m_tolerance;
  }

  void searchSegment(const FieldCells::Leaf& leaf, const Corner& a, const Corner& b) {
    const double ofA = ordinate(leaf, a), ofB = ordinate(leaf, b);
    const double atA = valueOf(ofA, a), atB = valueOf(ofB, b);
    sample(a, atA), sample(b, atB);
    const double ends = std::min(atA, atB);
    const double lowest = bounded(std::min({ofA, ofB, ordinate(leaf, a, b), ordinate(leaf, b, a)}),
                                  std::max(a.radius, b.radius));
    if (!isOpen(lowest, ends)) return;
    const Corner middle = between(a, b, 0.5);
    searchSegment(leaf, a, middle);
    searchSegment(leaf, middle, b);
  }

  void searchTriangle(const FieldCells::Leaf& leaf, const Corner& a, const Corner& b,
                      const Corner& c) {
    const double ofA = ordinate(leaf, a), ofB = ordinate(leaf, b), ofC = ordinate(leaf, c);
    const double atA = valueOf(ofA, a), atB = valueOf(ofB, b), atC = valueOf(ofC, c);
    sample(a, atA), sample(b, atB), sample(c, atC);
    const double ends = std::min({atA, atB, atC});
    const double lowest =
        bounded(std::min({ofA, ofB, ofC, ordinate(leaf, a, b), ordinate(leaf, b, a),
                          ordinate(leaf, b, c), ordinate(leaf, c, b), ordinate(leaf, c, a),
                          ordinate(leaf, a, c), ordinate(leaf, a, b, c)}),
                std::max({a.radius, b.radius, c.radius}));
    if (!isOpen(lowest, ends)) return;
    const Corner ab = between(a, b, 0.5), bc = between(b, c, 0.5), ca = between(c, a, 0.5);
    searchTriangle(leaf, ab, bc, ca);
    searchTriangle(leaf, a, ab, ca);
    searchTriangle(leaf, ab, b, bc);
    searchTriangle(leaf, ca, bc, c);
  }

  const FieldCells& m_cells;
  const double m_toUnits, m_band;
  double m_limit;  ///< values above it are not wanted
  const double m_tolerance;
  double m_largestRadius = 0.0;
  bool m_found = false;
  double m_value = 0.0;  ///< of m_best
  Corner m_best{};
};

}  // namespace

std::optional<DeepPoint> findDeepPoint(const FieldLookup& lookup,
                                       std::span<const Eigen::Vector3d> corners,
                                       std::span<const double> radii, double target,
                                       double tolerance) {
  PALPATE_ASSERT(corners.size() == 2 || corners.size() == 3);
  PALPATE_ASSERT(radii.size() == corners.size() && tolerance > 0.0);
  PALPATE_ASSERT(target + *std::max_element(radii.begin(), radii.end()) <
                 lookup.cells().band - lookup.cells().errorBound);
  return DeepPointSearch(lookup, corners, radii, target, tolerance).found();
}

}  // namespace palpate
