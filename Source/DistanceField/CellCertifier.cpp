#include "DistanceField/CellCertifier.h"

#include <palpate/SpatialQueries.h>

#include "DistanceField/AffineClaim.h"
#include "Math/DistanceBounds.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

double InterpolatedCell::halfDiagonal() const { return std::numbers::sqrt3 * halfSide; }

CellCertifier::CellCertifier(const Body& geometry, const SurfaceSign& sign, double tolerance)
    : m_geometry(geometry), m_sign(sign), m_tolerance(tolerance) {
  PALPATE_ASSERT(geometry.tree.octree().isBuilt());
  PALPATE_ASSERT(tolerance >= 0.0);
  const FloatBox box = geometry.tree.octree().box(0);
  float reach = 0;
  for (int k = 0; k < 3; ++k) reach = std::max({reach, -box.lower[k], box.upper[k]});
  m_reach = reach;
}

/// Lower bounds of the least and the largest distance of the corners.
std::pair<double, double> CellCertifier::magnitudesOf(const InterpolatedCell& cell) const {
  double least = kInfinity, most = 0;
  for (const double value : cell.values) {
    least = std::min(least, std::abs(value));
    most = std::max(most, std::abs(value));
  }
  return {least * (1.0 - kStoredError) - m_tolerance, most * (1.0 - kStoredError) - m_tolerance};
}

bool CellCertifier::isBeyond(const InterpolatedCell& cell, double distance) const {
  const auto [least, most] = magnitudesOf(cell);
  // All points are within half a diagonal of a corner, and within a diagonal of each.
  const double radius = cell.halfDiagonal() * (1.0 + kFieldError);
  return std::max(least - radius, most - 2.0 * radius) > distance * (1.0 + kFieldError);
}

/// Whether the triangle's distance at all corners is at most `bound` larger than their value.
bool CellCertifier::isNearTriangle(const InterpolatedCell& cell, double bound) const {
  PALPATE_ASSERT(cell.nearTriangle < m_geometry.tree.ordered().size());
  const Triangle& corners = m_geometry.tree.ordered()[cell.nearTriangle];
  const Positions& now = m_geometry.mesh.now;
  const Vector3d a = now[corners[0]], b = now[corners[1]], c = now[corners[2]];
  TriangleBatch batch;
  for (std::size_t i = 0; i < 8; ++i) {
    const Vector3d corner = cell.centre + cornerOf(i, cell.halfSide);
    batch.set(i, a - corner, b - corner, c - corner);
  }
  const DistanceBounds bounds(Vector3d::Zero(), batch, 8);
  for (std::size_t i = 0; i < 8; ++i)
    if (!(bounds.distance[i] + bounds.error[i] <= std::abs(cell.values[i]) + bound)) return false;
  return true;
}

/// Whether f is positive, for side 0, in a point of the plane H = level in the cell's shadow.
bool CellCertifier::isPositiveInPlane(const InterpolatedCell& cell, const Vector3d& normal,
                                      double middle, double level, double error,
                                      PointQueryStack& stack) const {
  // The surface is not between a corner and the plane if the plane is nearer.
  for (std::size_t i = 0; i < 8; ++i) {
    const double height = middle + normal.dot(cornerOf(i, cell.halfSide)) - level;
    if (std::abs(height) + error < std::abs(cell.values[i]) * (1.0 - kStoredError) - m_tolerance)
      return cell.values[i] > 0;
  }
  return !m_sign.isInside(cell.centre + (level - middle) * normal, stack);
}

namespace {

/// Along `normal` the interpolated function rises by 1 per unit of length, and is between `low` and
/// `high` more than that.
struct LinearPart {
  Vector3d normal;
  double low = kInfinity, high = -kInfinity;  ///< L
};
/// Along the gradient at the centre. None if this is far too small for a distance.
std::optional<LinearPart> linearPartOf(const InterpolatedCell& cell) {
  const auto& v = cell.values;
  Vector3d gradient{(v[1] - v[0]) + (v[3] - v[2]) + (v[5] - v[4]) + (v[7] - v[6]),
                    (v[2] - v[0]) + (v[3] - v[1]) + (v[6] - v[4]) + (v[7] - v[5]),
                    (v[4] - v[0]) + (v[5] - v[1]) + (v[6] - v[2]) + (v[7] - v[3])};
  gradient /= 8.0 * cell.halfSide;
  if (!(gradient.squaredNorm() > 0.25)) return {};
  LinearPart part{gradient.normalized()};
  for (std::size_t i = 0; i < 8; ++i) {
    const double rest = v[i] - part.normal.dot(cornerOf(i, cell.halfSide));
    part.low = std::min(part.low, rest);
    part.high = std::max(part.high, rest);
  }
  return part;
}

}  // namespace

bool CellCertifier::isWithin(const InterpolatedCell& cell, double bound,
                             PointQueryStack& stack) const {
  PALPATE_ASSERT(bound > 0.0 && cell.halfSide > 0.0);
  PALPATE_ASSERT(cell.isSigned || *std::min_element(cell.values.begin(), cell.values.end()) >= 0.0);
  const double radius = cell.halfDiagonal() * (1.0 + kFieldError);
  if (radius <= bound) return true;
  const auto [least, most] = magnitudesOf(cell);
  const bool isFree = least > radius;  // of the surface
  const bool isOutside = cell.values[0] > 0 || !cell.isSigned;
  AffineClaim affine;
  affine.sides[0].isWanted = affine.sides[1].isWanted = true;
  if (!cell.isSigned) {
    if (!isNearTriangle(cell, bound)) return false;
    affine.sides[1].isWanted = false;
  }
  if (const double distance = most - radius; distance > radius) {
    if (radius * radius <= 2.0 * distance * bound) affine.sides[isOutside ? 0 : 1].isWanted = false;
    if (cell.isSigned && radius * radius <= 4.0 * distance * bound && isNearTriangle(cell, bound))
      affine.sides[isOutside ? 1 : 0].isWanted = false;
    if (!affine.sides[0].isWanted && !affine.sides[1].isWanted) return true;
  }

  const std::optional<LinearPart> linear = linearPartOf(cell);
  if (!linear) return false;
  const auto& [normal, low, high] = *linear;
  const FloatFrame& frame = m_geometry.tree.frame();
  const Vector3d centre = (cell.centre - frame.origin) * frame.scale;
  affine.centre = {centre[0], centre[1], centre[2]};
  affine.halfSide = cell.halfSide * frame.scale;
  affine.error = kFieldError * (m_reach + centre.cwiseAbs().sum() + most * frame.scale);
  affine.level = (bound - 0.5 * (high - low)) * frame.scale - 2.0 * affine.error;
  if (!(affine.level > 0)) return false;
  const double middle = 0.5 * (low + high) * frame.scale,
               rise = affine.halfSide * normal.cwiseAbs().sum();
  double reach = 0;
  for (int i = 0; i < 2; ++i) {
    AffineClaim::Side& side = affine.sides[i];
    const double sign = i == 0 ? 1 : -1;
    for (int k = 0; k < 3; ++k) side.normal[k] = sign * normal[k];
    side.atCentre = sign * middle;
    side.needsDistance = side.atCentre + rise + affine.error > affine.level;
    side.needsCrossing = cell.isSigned && !(isFree && isOutside == (i == 0));
    if (!side.isWanted) continue;
    reach = std::max(
        {reach, std::abs(affine.level - side.atCentre), side.atCentre + rise - affine.level});
    if (!side.needsCrossing) continue;
    const double toPlane = std::abs(affine.level - side.atCentre) + affine.error;
    if (m_sign.in(cell.centre, radius + toPlane / frame.scale) !=
        SurfaceSign::Reliability::Reliable)
      return false;
    const bool isPositive =
        isPositiveInPlane(cell, normal, 0.5 * (low + high), sign * affine.level / frame.scale,
                          affine.error / frame.scale, stack);
    if (isPositive != (i == 0)) return false;
  }
  affine.reach = reach + std::numbers::sqrt3 * affine.halfSide + affine.error;
  return affine.holds(m_geometry);
}

}  // namespace palpate
