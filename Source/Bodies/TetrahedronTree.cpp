#include "Bodies/TetrahedronTree.h"

#include "Core/Assert.h"

#include <algorithm>
#include <utility>

namespace palpate {

namespace {

constexpr std::size_t kTetrahedronGroupGrain = 128;

FloatBox boxOf(const Tetrahedron& tetrahedron, const FloatPoint* floats) {
  FloatBox box;
  for (const std::uint32_t vertex : tetrahedron) box.add(floats[vertex].box());
  return OutwardRounding::outward(box);
}

void set(BoxArrays& boxes, std::size_t i, const FloatBox& box) {
  for (int k = 0; k < 3; ++k) {
    boxes.lower[k][i] = box.lower[k];
    boxes.upper[k][i] = box.upper[k];
  }
}

}  // namespace

void TetrahedronTree::update(const TetrahedralTopology& topology, const FloatPoint* floats,
                             double bulk, const OctreeSettings& settings, const Threads& threads) {
  const CountedVector<Tetrahedron>& tetrahedra = topology.tetrahedra;
  const std::size_t size = tetrahedra.size() - topology.removed.size();
  PALPATE_ASSERT(!m_isBuilt || m_ordered.size() == size);
  const bool wasBuilt = std::exchange(m_isBuilt, false);
  const auto bringInOrder = [&] {
    for (std::size_t i = 0; i < size; ++i) m_ordered[i] = tetrahedra[m_octree.order()[i]];
  };
  if (!wasBuilt) {
    m_octree.reset(size, topology.removed);
    m_ordered.resize(size);
    bringInOrder();
  }
  if (size == 0) return;
  if (wasBuilt && settings.update == OctreeUpdate::Auto) {
    fit(floats, threads);
    m_octree.measureLooseness();
    m_isBuilt = m_octree.isTight();
    if (m_isBuilt) return;
  }
  FloatBox bounds;
  for (std::size_t i = 0; i < size; ++i) {
    const FloatBox box = boxOf(m_ordered[i], floats);
    set(m_octree.boxes(), i, box);
    bounds.add(box);
  }
  m_keys.resize(size);
  m_octree.build(bounds, bulk, settings, m_keys, threads);
  bringInOrder();
  fit(floats, threads);
  m_octree.measureLooseness();
  m_isBuilt = true;
}

void TetrahedronTree::fit(const FloatPoint* floats, const Threads& threads) {
  PALPATE_ASSERT(m_ordered.size() == m_octree.size() && m_octree.size() > 0);
  const std::span<const std::uint32_t> groups = m_octree.groups();
  threads.forChunks(groups.size() - 1, kTetrahedronGroupGrain,
                    [&](std::size_t, std::size_t from, std::size_t to) {
                      for (std::size_t g = from; g < to; ++g) {
                        FloatBox all;
                        for (std::uint32_t i = groups[g]; i < groups[g + 1]; ++i) {
                          const FloatBox box = boxOf(m_ordered[i], floats);
                          set(m_octree.boxes(), i, box);
                          all.add(box);
                        }
                        m_octree.groupBoxes()[g] = all;
                      }
                    });
  m_octree.fit(threads);
}

}  // namespace palpate
