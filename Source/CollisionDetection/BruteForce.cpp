#include "CollisionDetection/BruteForce.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <vector>

namespace palpate {

namespace {

std::vector<Eigen::AlignedBox3d> boxesOf(const TriangleMesh& mesh, bool swept) {
  std::vector<Eigen::AlignedBox3d> boxes;
  boxes.reserve(mesh.topology.triangles.size());
  for (const Triangle& triangle : mesh.topology.triangles) {
    Eigen::AlignedBox3d box;
    for (const std::uint32_t corner : triangle) {
      box.extend(mesh.now[corner]);
      if (swept) box.extend(mesh.before[corner]);
    }
    boxes.push_back(box);
  }
  return boxes;
}

}  // namespace

void findCandidatesByBruteForce(const MeshPair& meshes, Buffer<TrianglePair>& out) {
  const double thickness = meshes.settings.method == Method::Intersection ? 0.0 : meshes.reach();
  const bool swept =
      meshes.settings.method == Method::Continuous || meshes.settings.method == Method::Auto;
  const std::vector<Eigen::AlignedBox3d> boxesA = boxesOf(meshes.a, swept),
                                         boxesB = boxesOf(meshes.b, swept);
  const std::vector<Triangle>& triangles = meshes.a.topology.triangles;
  const auto overlap = [&](const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b) {
    return ((a.min() - b.max()).array() <= thickness).all() &&
           ((b.min() - a.max()).array() <= thickness).all();
  };
  const auto adjacent = [&](std::uint32_t s, std::uint32_t t) {
    return std::any_of(triangles[s].begin(), triangles[s].end(), [&](std::uint32_t v) {
      return std::find(triangles[t].begin(), triangles[t].end(), v) != triangles[t].end();
    });
  };
  out.clear();
  for (std::uint32_t s = 0; s < boxesA.size(); ++s)
    for (std::uint32_t t = meshes.self() ? s + 1 : 0; t < boxesB.size(); ++t)
      if (overlap(boxesA[s], boxesB[t]) && !(meshes.self() && adjacent(s, t)) &&
          meshes.a.topology.isOn(s) && meshes.b.topology.isOn(t))
        out.push_back({s, t});
}

}  // namespace palpate
