// Part of <palpate/Meshes.h>: findMeshDefects() with positions, which runs a detection.
#include <palpate/Meshes.h>
#include <palpate/OctreeBasedCD.h>

#include "Mesh/Corners.h"
#include "Core/DisjointSets.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace palpate {

using Eigen::Vector3d;

namespace {

bool namesTwice(const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }

/// The vertices that triangles connect.
DisjointSets partsOf(const TriangleMeshView& mesh) {
  DisjointSets parts;
  parts.start(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    if (namesTwice(t)) continue;
    parts.join(t[0], t[1]);
    parts.join(t[0], t[2]);
  }
  return parts;
}

/// Whether the volume is negative by more than rounding. Each term has an error below 16 u of its
/// magnitudes, and the sum one of u for each term.
bool hasNegativeVolume(const TriangleMeshView& mesh) {
  if (mesh.triangles.empty()) return false;
  const Vector3d origin = mesh.positions[mesh.triangles[0][0]];
  double largest = 0.0;
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t)
      largest = std::max(largest, (mesh.positions[v] - origin).cwiseAbs().maxCoeff());
  if (!(largest > 0.0)) return false;
  const double unit = std::exp2(-std::ilogb(largest));  // so that no product is out of range
  double volume = 0.0, magnitude = 0.0;
  for (const auto& [p, q, r] : mesh.triangles) {
    const Vector3d a = unit * (mesh.positions[p] - origin), b = unit * (mesh.positions[q] - origin),
                   c = unit * (mesh.positions[r] - origin);
    volume += a.dot(b.cross(c));
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      magnitude += std::abs(a[k]) * (std::abs(b[i] * c[j]) + std::abs(b[j] * c[i]));
    }
  }
  const double error =
      (16.0 + static_cast<double>(mesh.triangles.size())) * 0x1p-52 * std::max(magnitude, 0x1p-900);
  return volume < -error;
}

}  // namespace

MeshDefects findMeshDefects(const TriangleMeshView& mesh) {
  Settings settings;
  settings.threads = 1;
  OctreeBasedCD collisions(settings);  // refuses what is no mesh
  const GeometryId id = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
  MeshDefects defects = findMeshDefects(mesh.triangles);
  if (defects.unwelded) return defects;
  defects.insideOut = defects.closed() && hasNegativeVolume(mesh);
  const DisjointSets parts = partsOf(mesh);
  const auto partOf = [&](std::uint32_t t) { return parts.find(mesh.triangles[t][0]); };
  const auto cornersAt = [&](std::uint32_t t) {
    return cornersOf(mesh.triangles[t], mesh.positions);
  };
  SignCounts counts;
  collisions.addCollisionPair(id, id, {Method::Intersection, 0.0});
  collisions.forEachCandidate(id, id, [&](std::span<const ElementPair> candidates) {
    for (const ElementPair& pair : candidates)
      if (partOf(pair.a) != partOf(pair.b) &&
          intersectTriangles(cornersAt(pair.a), cornersAt(pair.b), counts).intersect())
        defects.overlapping.push_back(pair);
  });
  std::sort(defects.overlapping.begin(), defects.overlapping.end());
  return defects;
}

}  // namespace palpate
