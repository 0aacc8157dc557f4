// Part of CollisionDetection/DiagnosticsInterface.h: candidates.
#include "Search/BruteForce.h"
#include "NarrowPhase/ElementBoxes.h"
#include "Core/Assert.h"

#include <algorithm>
#include <vector>

namespace palpate {

static std::vector<Eigen::AlignedBox3d> boxesOf(const TriangleMesh& mesh, bool swept) {
  std::vector<Eigen::AlignedBox3d> boxes(mesh.topology.elements.size());
  for (std::uint32_t t = 0; t < boxes.size(); ++t) boxes[t] = elementBox(mesh, t, swept);
  return boxes;
}

void findCandidatesByBruteForce(const MeshPair& meshes, Buffer<ElementPair>& out) {
  PALPATE_ASSERT(!meshes.has(GeometryType::Shape));
  const double thickness =
      meshes.settings.method == Method::Intersection ? 0.0 : meshes.maxFeatureDistance();
  const bool swept =
      meshes.settings.method == Method::Continuous || meshes.settings.method == Method::Auto;
  const std::vector<Eigen::AlignedBox3d> boxesA = boxesOf(meshes.a, swept),
                                         boxesB = boxesOf(meshes.b, swept);
  const CountedVector<Triangle>& triangles = meshes.a.topology.elements;
  const auto adjacent = [&](std::uint32_t s, std::uint32_t t) {
    return std::any_of(triangles[s].begin(), triangles[s].end(), [&](std::uint32_t v) {
      return std::find(triangles[t].begin(), triangles[t].end(), v) != triangles[t].end();
    });
  };
  out.clear();
  for (std::uint32_t s = 0; s < boxesA.size(); ++s)
    for (std::uint32_t t = meshes.self() ? s + 1 : 0; t < boxesB.size(); ++t)
      if (mayBeWithin(boxesA[s], boxesB[t], thickness) && !(meshes.self() && adjacent(s, t)) &&
          meshes.a.topology.isEnabled(s) && meshes.b.topology.isEnabled(t))
        out.push_back({s, t});
}

}  // namespace palpate
