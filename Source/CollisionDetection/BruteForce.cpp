#include "CollisionDetection/BruteForce.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <vector>

namespace palpate {

namespace {

Eigen::AlignedBox3d boxOf(const TriangleMesh& mesh, std::uint32_t triangle, bool swept) {
  Eigen::AlignedBox3d box;
  for (const std::uint32_t corner : mesh.topology.triangles[triangle]) {
    box.extend(mesh.now[corner]);
    if (swept) box.extend(mesh.before[corner]);
  }
  return box;
}

std::vector<Eigen::AlignedBox3d> boxesOf(const TriangleMesh& mesh, bool swept) {
  std::vector<Eigen::AlignedBox3d> boxes(mesh.topology.triangles.size());
  for (std::uint32_t t = 0; t < boxes.size(); ++t) boxes[t] = boxOf(mesh, t, swept);
  return boxes;
}

/// Candidates of two leaves meet the same triangles again and again.
class BoxesMetLast {
 public:
  BoxesMetLast(const TriangleMesh& mesh, bool swept) : m_mesh(mesh), m_swept(swept) {
    m_ids.fill(0xffffffffu);
  }
  const Eigen::AlignedBox3d& box(std::uint32_t triangle) {
    const std::size_t place = triangle * 0x9e3779b1u >> (32 - kBits);
    if (m_ids[place] != triangle) {
      m_ids[place] = triangle;
      m_boxes[place] = boxOf(m_mesh, triangle, m_swept);
    }
    return m_boxes[place];
  }

 private:
  static constexpr int kBits = 8;
  const TriangleMesh& m_mesh;
  bool m_swept;
  std::array<std::uint32_t, 1 << kBits> m_ids;
  std::array<Eigen::AlignedBox3d, 1 << kBits> m_boxes;
};

bool overlap(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b, double thickness) {
  return ((a.min() - b.max()).array() <= thickness).all() &&
         ((b.min() - a.max()).array() <= thickness).all();
}

}  // namespace

void keepOverlapping(const MeshPair& meshes, bool swept, double thickness,
                     Buffer<TrianglePair>& pairs) {
  BoxesMetLast ofA(meshes.a, swept), ofB(meshes.b, swept);
  std::erase_if(pairs, [&](const TrianglePair& pair) {
    return !overlap(ofA.box(pair.a), ofB.box(pair.b), thickness);
  });
}

void findCandidatesByBruteForce(const MeshPair& meshes, Buffer<TrianglePair>& out) {
  const double thickness = meshes.settings.method == Method::Intersection ? 0.0 : meshes.reach();
  const bool swept =
      meshes.settings.method == Method::Continuous || meshes.settings.method == Method::Auto;
  const std::vector<Eigen::AlignedBox3d> boxesA = boxesOf(meshes.a, swept),
                                         boxesB = boxesOf(meshes.b, swept);
  const std::vector<Triangle>& triangles = meshes.a.topology.triangles;
  const auto adjacent = [&](std::uint32_t s, std::uint32_t t) {
    return std::any_of(triangles[s].begin(), triangles[s].end(), [&](std::uint32_t v) {
      return std::find(triangles[t].begin(), triangles[t].end(), v) != triangles[t].end();
    });
  };
  out.clear();
  for (std::uint32_t s = 0; s < boxesA.size(); ++s)
    for (std::uint32_t t = meshes.self() ? s + 1 : 0; t < boxesB.size(); ++t)
      if (overlap(boxesA[s], boxesB[t], thickness) && !(meshes.self() && adjacent(s, t)) &&
          meshes.a.topology.isOn(s) && meshes.b.topology.isOn(t))
        out.push_back({s, t});
}

}  // namespace palpate
