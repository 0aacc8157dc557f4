#include "NarrowPhase/ElementBoxes.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>

namespace palpate {

Eigen::AlignedBox3d elementBox(const TriangleMesh& mesh, std::uint32_t element, bool swept) {
  Eigen::AlignedBox3d box;
  for (const std::uint32_t corner : mesh.topology.elements[element]) {
    box.extend(mesh.now[corner]);
    if (swept) box.extend(mesh.before[corner]);
  }
  return box;
}

bool overlap(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b, double thickness) {
  return ((a.min() - b.max()).array() <= thickness).all() &&
         ((b.min() - a.max()).array() <= thickness).all();
}

bool mayBeWithin(const Eigen::AlignedBox3d& a, const Eigen::AlignedBox3d& b, double thickness) {
  const double size = (a.max().cwiseMax(b.max()) - a.min().cwiseMin(b.min())).maxCoeff();
  return overlap(a, b,
                 thickness + std::min(kBoxGapError * (size + thickness), kFloatBoxGap * thickness));
}

namespace {

/// A cache of element boxes: the candidate pairs of two leaves name the same elements many times.
class BoxCache {
 public:
  BoxCache(const TriangleMesh& mesh, bool swept) : m_mesh(mesh), m_swept(swept) {
    m_ids.fill(0xffffffffu);
  }
  const Eigen::AlignedBox3d& box(std::uint32_t triangle) {
    const std::size_t place = triangle * 0x9e3779b1u >> (32 - kBits);
    if (m_ids[place] != triangle) {
      m_ids[place] = triangle;
      m_boxes[place] = elementBox(m_mesh, triangle, m_swept);
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

}  // namespace

void keepOverlapping(const MeshPair& meshes, bool swept, double thickness,
                     Buffer<ElementPair>& pairs) {
  PALPATE_ASSERT(thickness >= 0.0);
  BoxCache ofA(meshes.a, swept), ofB(meshes.b, swept);
  std::erase_if(pairs, [&](const ElementPair& pair) {
    return !mayBeWithin(ofA.box(pair.a), ofB.box(pair.b), thickness);
  });
}

}  // namespace palpate
