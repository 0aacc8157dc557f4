#include "Mesh/ExcludedDirections.h"

#include "Math/StableLength.h"

#include <Eigen/Geometry>

#include <algorithm>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// A triangle's corner beside an edge, seen from the edge.
struct Wing {
  Vector3d inwards;  ///< unit, across the edge; 0 without area
  double error;      ///< of its components
};

/// Whether two triangles at an edge lie on opposite sides of it, and the second does not bend away
/// from a direction so much that a body of this length sinks by more than `most`. A bend lets it
/// sink by at most a quarter of its length times the bend's sine. Of a wall below a floor, only the
/// floor says so: which side of the wall a direction across the floor is on is rounding.
bool bendsLittle(const Wing& a, const Wing& b, const Vector3d& along, const Vector3d& direction,
                 double length, double most) {
  if (!(a.inwards.dot(b.inwards) < 0.0)) return false;
  const Vector3d across = along.cross(a.inwards);
  const double sine = across.dot(direction) < 0.0 ? across.dot(b.inwards) : -across.dot(b.inwards);
  return 0.25 * length * (sine - a.error - b.error) <= most;
}

}  // namespace

bool hasRidge(const TriangleMesh& mesh, const Segment& feature, const Vector3d& direction,
              double length, double thickness) {
  const std::uint32_t p = feature[0], q = feature[1];
  const auto around = mesh.topology.vertexTriangles[p];
  if (p == q)
    return std::any_of(around.begin(), around.end(), [&](const std::uint32_t& triangle) {
      const Triangle& corners = mesh.topology.elements[triangle];
      return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t corner) {
        // Each edge once.
        const bool isKnown = std::any_of(around.data(), &triangle, [&](std::uint32_t earlier) {
          const Triangle& its = mesh.topology.elements[earlier];
          return std::find(its.begin(), its.end(), corner) != its.end();
        });
        return corner != p && !isKnown && hasRidge(mesh, {p, corner}, direction, length, thickness);
      });
    });
  const Vector3d along = (mesh.now[q] - mesh.now[p]).stableNormalized();
  const auto forEachWing = [&](auto&& f) {
    return std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
      const Triangle& corners = mesh.topology.elements[triangle];
      if (std::find(corners.begin(), corners.end(), q) == corners.end()) return false;
      return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t corner) {
        if (corner == p || corner == q) return false;
        const Vector3d way = mesh.now[corner] - mesh.now[p], across = way - way.dot(along) * along;
        const double size = stableLength(across);
        if (!(size > 0.0)) return false;
        return f(Wing{across / size, kNormalConeError * way.lpNorm<1>() / size});
      });
    });
  };
  return !forEachWing([&](const Wing& a) {
    return forEachWing([&](const Wing& b) {
      const double most = kRidgeShare * thickness;
      return bendsLittle(a, b, along, direction, length, most) &&
             bendsLittle(b, a, along, direction, length, most);
    });
  });
}

}  // namespace palpate
