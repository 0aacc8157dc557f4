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

/// Whether an edge of a mesh, with this number, is a ridge or a border. See hasRidge().
bool isRidge(const TriangleMesh& mesh, std::uint32_t edge, const Vector3d& direction, double length,
             double most) {
  const auto& [p, q] = mesh.topology.edges[edge];
  const Vector3d start = mesh.now[p], along = (mesh.now[q] - start).stableNormalized();
  const auto around = mesh.topology.edgeTriangles[edge];
  const auto wingOf = [&](std::uint32_t triangle) {
    const Triangle& corners = mesh.topology.elements[triangle];
    const auto corner = std::find_if(corners.begin(), corners.end(), [&](std::uint32_t v) {
      return v != mesh.topology.edges[edge][0] && v != mesh.topology.edges[edge][1];
    });
    if (corner == corners.end()) return Wing{Vector3d::Zero(), 0.0};
    const Vector3d way = mesh.now[*corner] - start, across = way - way.dot(along) * along;
    const double size = stableLength(across);
    if (!(size > 0.0)) return Wing{Vector3d::Zero(), 0.0};
    return Wing{across / size, kNormalConeError * way.lpNorm<1>() / size};
  };
  for (std::size_t i = 1; i < around.size(); ++i) {
    const Wing a = wingOf(around[i]);
    for (std::size_t j = 0; j < i; ++j) {
      const Wing b = wingOf(around[j]);
      if (bendsLittle(a, b, along, direction, length, most) &&
          bendsLittle(b, a, along, direction, length, most))
        return false;
    }
  }
  return true;
}

}  // namespace

bool hasRidge(const TriangleMesh& mesh, const Segment& feature, const Vector3d& direction,
              double length, double thickness) {
  const std::uint32_t p = feature[0], q = feature[1];
  const MeshTopology& topology = mesh.topology;
  const auto around = topology.vertexTriangles[p];
  // Each edge once: with the first of its triangles.
  return std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
    const auto& ids = topology.triangleEdges[triangle];
    return std::any_of(ids.begin(), ids.end(), [&](std::uint32_t edge) {
      if (edge == kNoEdge || topology.edgeTriangles[edge].front() != triangle) return false;
      const auto& [r, s] = topology.edges[edge];
      const bool isAsked = p == q ? r == p || s == p : (r == p && s == q) || (r == q && s == p);
      return isAsked && isRidge(mesh, edge, direction, length, kRidgeShare * thickness);
    });
  });
}

}  // namespace palpate
