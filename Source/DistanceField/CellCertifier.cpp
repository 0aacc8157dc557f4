#include "DistanceField/CellCertifier.h"

#include <palpate/SpatialQueries.h>

#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Queries/Containment.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// A convex set, relative to the centre of a cell, given by corners or as a box.
struct TriangleSet {
  Vector3d corners[3];

  Vector3d centre() const { return (corners[0] + corners[1] + corners[2]) / 3.0; }
  /// The largest component along a direction.
  double along(const Vector3d& w) const {
    return std::max({w.dot(corners[0]), w.dot(corners[1]), w.dot(corners[2])});
  }
};

struct PointSet {
  std::array<Vector3d, 6> points;
  std::size_t size = 0;

  double along(const Vector3d& w) const {
    double most = -kInfinity;
    for (std::size_t i = 0; i < size; ++i) most = std::max(most, w.dot(points[i]));
    return most;
  }
};

struct BoxSet {
  Vector3d middle, halfSides;

  const Vector3d& centre() const { return middle; }
  double along(const Vector3d& w) const { return w.dot(middle) + w.cwiseAbs().dot(halfSides); }
};

/// A cell in which the signed distance f is compared with a linear function H, about the cell's
/// centre in the octree's floats. It is to be proven that f >= H - level (side 0) and f <= H +
/// level (side 1). Both are one claim, for (f, H) and for (-f, -H).
struct AffineCell {
  struct Side {
    Vector3d normal;     ///< unit: the gradient of H
    double atCentre;     ///< H at the centre
    bool needsDistance;  ///< whether H exceeds the level in the cell
    /// Whether the surface must separate the cell from the plane H = level on the cell's shadow.
    bool needsCrossing;
    bool isWanted;
  };
  double halfSide, level, error, reach;
  std::array<Side, 2> sides;

  /// Whether all points of the set have a distance of at least H(x) - level from each point x of
  /// the cell. For any unit vector w the distance of x and y is at least w (x - y). The best w
  /// leads from y to the point of the cell where the distance less H is least.
  template <class Set>
  bool isFar(const Side& side, const Set& set, const Vector3d& w) const {
    return -halfSide * (w - side.normal).cwiseAbs().sum() - side.atCentre - set.along(w) >=
           error - level;
  }
  Vector3d wayFrom(const Side& side, const Vector3d& point) const {
    const Vector3d above = point - side.normal.dot(point) * side.normal;
    const Vector3d nearest = above.cwiseMax(-halfSide).cwiseMin(halfSide);
    return (nearest - point).normalized();
  }
  bool isFar(const Side& side, const BoxSet& box) const {
    return isFar(side, box, wayFrom(side, box.middle));
  }
  bool isFar(const Side& side, const TriangleSet& triangle) const {
    if (isFar(side, triangle, wayFrom(side, triangle.centre()))) return true;
    const auto& [a, b, c] = triangle.corners;
    const Vector3d normal = (b - a).cross(c - a).stableNormalized();
    if (isFar(side, triangle, normal) || isFar(side, triangle, -normal)) return true;
    const Vector3d nearest = -finiteVertexTriangleDistance(Vector3d::Zero(), a, b, c).difference;
    return isFar(side, triangle, wayFrom(side, nearest));
  }
  /// Whether the set is beside the cell's shadow along the normal: separated by a direction across
  /// the normal.
  template <class Set>
  bool isBeside(const Set& set, const Vector3d& across) const {
    const double most = halfSide * across.cwiseAbs().sum() + error;
    return -set.along(-across) > most || set.along(across) < -most;
  }
  template <class Set>
  bool isBesideFaces(const Side& side, const Set& set) const {
    for (int k = 0; k < 3; ++k)
      if (isBeside(set, side.normal.cross(Vector3d::Unit(k)))) return true;
    return false;
  }
  bool isBeside(const Side& side, const BoxSet& box) const { return isBesideFaces(side, box); }
  /// Only the part of a triangle near the plane H = level counts: a thin polygon.
  bool isBeside(const Side& side, const TriangleSet& triangle) const {
    PointSet part;
    for (int i = 0; i < 3; ++i) {
      const Vector3d &p = triangle.corners[i], &q = triangle.corners[(i + 1) % 3];
      const double start = side.normal.dot(p) + side.atCentre - level,
                   rise = side.normal.dot(q) + side.atCentre - level - start;
      // The edge's points p + t (q - p) with |start + t rise| <= error.
      double first = 0, last = 1;
      if (rise != 0) {
        const double one = (-error - start) / rise, two = (error - start) / rise;
        first = std::max(first, std::min(one, two));
        last = std::min(last, std::max(one, two));
      } else if (std::abs(start) > error) {
        continue;
      }
      if (!(first <= last)) continue;
      part.points[part.size++] = p + first * (q - p);
      part.points[part.size++] = p + last * (q - p);
    }
    if (part.size == 0 || isBesideFaces(side, part)) return true;
    const auto& [a, b, c] = triangle.corners;
    const Vector3d normal = (b - a).cross(c - a).stableNormalized();
    return isBeside(part, normal - side.normal.dot(normal) * side.normal);
  }
  /// Whether the triangles in the set do not disprove the claims.
  template <class Set>
  bool allows(const Set& set) const {
    for (const Side& side : sides) {
      if (!side.isWanted) continue;
      const double most = set.along(side.normal) + side.atCentre;
      if (most < level - error) continue;
      if (side.needsDistance && !isFar(side, set)) return false;
      if (side.needsCrossing && -set.along(-side.normal) + side.atCentre <= level + error &&
          !isBeside(side, set))
        return false;
    }
    return true;
  }
};

/// Lower bounds of the least and the largest distance of the corners.
std::pair<double, double> magnitudesOf(const InterpolatedCell& cell) {
  double least = kInfinity, most = 0;
  for (const double value : cell.values) {
    least = std::min(least, std::abs(value));
    most = std::max(most, std::abs(value));
  }
  return {least * (1.0 - kStoredError), most * (1.0 - kStoredError)};
}

}  // namespace

double InterpolatedCell::halfDiagonal() const { return std::numbers::sqrt3 * halfSide; }

CellCertifier::CellCertifier(const SearchableGeometry& geometry) : m_geometry(geometry) {
  const FloatBox box = geometry.tree.octree().box(0);
  float reach = 0;
  for (int k = 0; k < 3; ++k) reach = std::max({reach, -box.lower[k], box.upper[k]});
  m_reach = reach;
}

bool CellCertifier::isBeyond(const InterpolatedCell& cell, double distance) {
  const auto [least, most] = magnitudesOf(cell);
  // All points are within half a diagonal of a corner, and within a diagonal of each.
  const double radius = cell.halfDiagonal() * (1.0 + kFieldError);
  return std::max(least - radius, most - 2.0 * radius) > distance * (1.0 + kFieldError);
}

/// Whether the triangle's distance at all corners is at most `bound` larger than their value.
bool CellCertifier::isNearTriangle(const InterpolatedCell& cell, double bound) const {
  const Triangle& corners = m_geometry.tree.ordered()[cell.nearTriangle];
  const Positions& now = m_geometry.mesh.now;
  const Vector3d a = now[corners[0]], b = now[corners[1]], c = now[corners[2]];
  for (std::size_t i = 0; i < 8; ++i)
    if (finiteVertexTriangleDistance(cell.centre + cornerOf(i, cell.halfSide), a, b, c).distance >
        std::abs(cell.values[i]) + bound)
      return false;
  return true;
}

bool CellCertifier::isWithin(const InterpolatedCell& cell, double bound,
                             PointQueryStack& stack) const {
  const double radius = cell.halfDiagonal() * (1.0 + kFieldError);
  if (radius <= bound) return true;
  const auto [least, most] = magnitudesOf(cell);
  const bool isFree = least > radius;  // of the surface
  const bool isOutside = cell.values[0] > 0;
  AffineCell affine;
  affine.sides[0].isWanted = affine.sides[1].isWanted = true;
  if (const double distance = most - radius; distance > radius) {
    if (radius * radius <= 2.0 * distance * bound) affine.sides[isOutside ? 0 : 1].isWanted = false;
    if (radius * radius <= 4.0 * distance * bound && isNearTriangle(cell, bound))
      affine.sides[isOutside ? 1 : 0].isWanted = false;
    if (!affine.sides[0].isWanted && !affine.sides[1].isWanted) return true;
  }

  // The gradient of the interpolated function at the centre, and its deviation from a linear one.
  const auto& v = cell.values;
  Vector3d gradient{(v[1] - v[0]) + (v[3] - v[2]) + (v[5] - v[4]) + (v[7] - v[6]),
                    (v[2] - v[0]) + (v[3] - v[1]) + (v[6] - v[4]) + (v[7] - v[5]),
                    (v[4] - v[0]) + (v[5] - v[1]) + (v[6] - v[2]) + (v[7] - v[3])};
  gradient /= 8.0 * cell.halfSide;
  if (!(gradient.squaredNorm() > 0.25)) return false;
  const Vector3d normal = gradient.normalized();
  double low = kInfinity, high = -kInfinity;
  for (std::size_t i = 0; i < 8; ++i) {
    const double rest = v[i] - normal.dot(cornerOf(i, cell.halfSide));
    low = std::min(low, rest);
    high = std::max(high, rest);
  }
  const FloatFrame& frame = m_geometry.tree.frame();
  const Vector3d centre = (cell.centre - frame.origin) * frame.scale;
  affine.halfSide = cell.halfSide * frame.scale;
  affine.error = kFieldError * (m_reach + centre.cwiseAbs().sum() + most * frame.scale);
  affine.level = (bound - 0.5 * (high - low)) * frame.scale - 2.0 * affine.error;
  if (!(affine.level > 0)) return false;
  const double middle = 0.5 * (low + high) * frame.scale,
               rise = affine.halfSide * normal.cwiseAbs().sum();
  double reach = 0;
  for (int i = 0; i < 2; ++i) {
    AffineCell::Side& side = affine.sides[i];
    side.normal = i == 0 ? normal : Vector3d(-normal);
    side.atCentre = i == 0 ? middle : -middle;
    side.needsDistance = side.atCentre + rise + affine.error > affine.level;
    side.needsCrossing = !(isFree && isOutside == (i == 0));
    if (!side.isWanted) continue;
    reach = std::max(
        {reach, std::abs(affine.level - side.atCentre), side.atCentre + rise - affine.level});
    if (!side.needsCrossing) continue;
    // The sign in the plane H = level, which has no surface in the shadow.
    const Vector3d inPlane =
        frame.origin + (centre + (affine.level - side.atCentre) * side.normal) / frame.scale;
    if (isInside(m_geometry, inPlane, {}, Engine::Octree, stack) != (i == 1)) return false;
  }
  affine.reach = reach + std::numbers::sqrt3 * affine.halfSide + affine.error;

  bool holds = true;
  const auto enters = [&](const FloatBox& box) {
    if (!holds || box.empty()) return false;
    if (box.mayBeClamped()) return true;
    BoxSet set;
    double distanceSquared = 0;
    for (int k = 0; k < 3; ++k) {
      const double lower = box.lower[k] - centre[k], upper = box.upper[k] - centre[k];
      set.middle[k] = 0.5 * (lower + upper);
      set.halfSides[k] = 0.5 * (upper - lower);
      const double outside = std::max({lower, -upper, 0.0});
      distanceSquared += outside * outside;
    }
    return distanceSquared <= affine.reach * affine.reach && !affine.allows(set);
  };
  const Octree& octree = m_geometry.tree.octree();
  const Positions& now = m_geometry.mesh.now;
  forEachOverlapping(octree, enters, stack, [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end && holds; ++i) {
      if (!enters(octree.boxes()[i])) continue;
      TriangleSet set;
      for (int corner = 0; corner < 3; ++corner)
        set.corners[corner] =
            (now[m_geometry.tree.ordered()[i][corner]] - frame.origin) * frame.scale - centre;
      holds = affine.allows(set);
    }
  });
  return holds;
}

}  // namespace palpate
