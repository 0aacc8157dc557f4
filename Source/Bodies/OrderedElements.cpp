#include "Bodies/OrderedElements.h"

#include "Core/MemoryBudget.h"

#include <algorithm>
#include <utility>

namespace palpate {

void OrderedElements::start(std::size_t size) {
  m_triangles = {};
  const std::size_t padded = size + BoxArrays::kPadding;
  m_memory.reserve(withSpare(padded) * sizeof(Triangle));
  m_triangles = m_memory.start<Triangle>(padded).first(size);
}

void OrderedElements::fill(const MeshTopology& topology, const Octree& octree, std::size_t from,
                           std::size_t to) {
  for (std::size_t i = from; i < to; ++i) m_triangles[i] = topology.elements[octree.order()[i]];
}

std::span<std::uint64_t> OrderedElements::startKeys() {
  const std::size_t size = m_triangles.size();
  m_triangles = {};
  return m_memory.start<std::uint64_t>(size);
}

void OrderedElements::follow(const MeshTopology& topology, const Octree& octree,
                             std::span<const Octree::Move> moves,
                             std::span<const Octree::Joining> joining) {
  const std::size_t size = octree.size(),
                    most = std::max(size, m_triangles.size()) + BoxArrays::kPadding;
  const std::span<Triangle> triangles = m_memory.resized(m_triangles, most);
  if (triangles.empty()) {
    start(size);
    return fill(topology, octree, 0, size);
  }
  Octree::move(triangles.data(), moves);
  m_triangles = triangles.first(size);
  const auto groups = octree.groups();
  const Octree::Joining* last = nullptr;
  for (const Octree::Joining& one : joining)
    if (const auto* before = std::exchange(last, &one); !before || before->group != one.group)
      fill(topology, octree, groups[one.group], groups[one.group + 1]);
}

void OrderedElements::releaseMemory() {
  if (m_triangles.empty()) return m_memory.release();
  const std::size_t size = m_triangles.size();
  m_triangles =
      m_memory.shrink(std::span(m_triangles.data(), size + BoxArrays::kPadding)).first(size);
}

}  // namespace palpate
