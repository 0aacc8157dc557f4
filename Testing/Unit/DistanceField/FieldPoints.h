#pragma once

#include <palpate/DistanceField.h>

#include "Common/FieldMeshes.h"

#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

/// Points at which a distance field is likely to be wrong.
namespace palpate::testing {

struct Extent {
  Eigen::AlignedBox3d box;
  double diagonal;
};

inline Extent extentOf(const Mesh& mesh) {
  Extent extent;
  for (const Eigen::Vector3d& p : mesh.positions) extent.box.extend(p);
  extent.diagonal = extent.box.diagonal().norm();
  return extent;
}

inline DistanceField fieldOf(const Mesh& mesh, double errorBound, double band, int threads = 2) {
  const double diagonal = extentOf(mesh).diagonal;
  return DistanceField::build(
      {mesh.positions, mesh.triangles},
      {.errorBound = errorBound * diagonal, .band = band * diagonal, .threads = threads});
}

/// The side of a root cell.
inline double unitOf(const Mesh& mesh, const DistanceField& field) {
  const Eigen::Vector3d sizes = extentOf(mesh).box.sizes();
  return std::ldexp(1.0, std::ilogb(sizes.maxCoeff() + 2 * field.band()) - 3);
}

/// A coordinate at or beside a border of cells of a random level.
inline double nearBorder(Random& random, double coordinate, double unit) {
  const double side = std::ldexp(unit, -static_cast<int>(random() % 7));
  const double at = std::round(coordinate / side) * side;
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  switch (random() % 3) {
    case 0:
      return at;
    case 1:
      return std::nextafter(at, kInfinite);
    default:
      return std::nextafter(at, -kInfinite);
  }
}

/// A point on the normal of a surface point where, by the field, another part of the surface is
/// about as near: near the medial axis. Or one 1.5 bands away.
inline Eigen::Vector3d nearMedialAxis(const DistanceField& field, const Eigen::Vector3d& onSurface,
                                      const Eigen::Vector3d& normal) {
  double low = 0, high = 1.5 * field.band();
  for (int i = 0; i < 20; ++i) {
    const double middle = 0.5 * (low + high);
    const bool isNearest =
        std::abs(field.value(onSurface + middle * normal)) >= middle - field.errorBound();
    (isNearest ? low : high) = middle;
  }
  return onSurface + low * normal;
}

/// Points on vertices, edges and triangles, near them, in and beyond the band, near the medial
/// axis, and on the borders and corners of cells.
inline std::vector<Eigen::Vector3d> adversarialPoints(Random& random, const Mesh& mesh,
                                                      const DistanceField& field,
                                                      std::size_t count) {
  const Extent extent = extentOf(mesh);
  const double unit = unitOf(mesh, field), wide = 1.5 * field.band();
  std::vector<Eigen::Vector3d> points(count);
  for (Eigen::Vector3d& p : points) {
    const auto& [a, b, c] = mesh.triangles[random() % mesh.triangles.size()];
    const std::uint64_t kind = random() % 9;
    double s = uniform(random, 0, 1), t = uniform(random, 0, 1 - s);
    if (kind == 0) s = t = 0;
    if (kind == 1) t = 0;
    p = mesh.positions[a] + s * (mesh.positions[b] - mesh.positions[a]) +
        t * (mesh.positions[c] - mesh.positions[a]);
    if (kind == 3) p += randomPoint(random, -1, 1) * field.errorBound();
    if (kind >= 4 && kind < 8) p += randomPoint(random, -1, 1) * wide;
    if (kind == 7)
      for (int k = 0; k < 3; ++k)
        p[k] = uniform(random, extent.box.min()[k] - wide, extent.box.max()[k] + wide);
    if (kind == 8) {
      const Eigen::Vector3d normal = (mesh.positions[b] - mesh.positions[a])
                                         .cross(mesh.positions[c] - mesh.positions[a])
                                         .stableNormalized();
      p = nearMedialAxis(field, p, random() % 2 ? normal : Eigen::Vector3d(-normal));
    }
    if (kind >= 5 && kind < 8)
      for (int k = 0; k < 3; ++k)
        if (random() % 2) p[k] = nearBorder(random, p[k], unit);
  }
  return points;
}

}  // namespace palpate::testing
