#include "DistanceField/CoincidentTriangles.h"

#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <span>
#include <tuple>

namespace palpate {

std::vector<Triangle> withoutCopies(const Body& body) {
  PALPATE_ASSERT(body.tree.isValid() && body.tree.octree().isBuilt());
  const Octree& octree = body.tree.octree();
  const std::span<const Triangle> triangles = body.mesh.topology.elements;
  const auto coordinates = [&](std::uint32_t element) {
    std::array<double, 9> all;
    for (std::size_t i = 0; i < 9; ++i)
      all[i] = body.mesh.now[triangles[element][i / 3]][static_cast<Eigen::Index>(i % 3)];
    return all;
  };
  std::vector<std::uint32_t> elements, copies;
  for (OctreeNode node = 0; node < kChildren * octree.pool().used(); ++node) {
    const auto [begin, end] = octree.isEmpty(node) ? std::pair(0u, 0u) : octree.ownRange(node);
    if (end - begin < kFewestCoincident) continue;
    elements.assign(octree.order().begin() + begin, octree.order().begin() + end);
    std::sort(elements.begin(), elements.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::tuple(coordinates(a), a) < std::tuple(coordinates(b), b);
    });
    for (std::size_t i = 1; i < elements.size(); ++i)
      if (coordinates(elements[i]) == coordinates(elements[i - 1])) copies.push_back(elements[i]);
  }
  std::vector<Triangle> kept;
  if (copies.empty()) return kept;
  std::sort(copies.begin(), copies.end());
  auto next = copies.begin();
  for (std::uint32_t i = 0; i < triangles.size(); ++i)
    if (next != copies.end() && *next == i)
      ++next;
    else
      kept.push_back(triangles[i]);
  return kept;
}

}  // namespace palpate
