#include "Queries/InsideRegions.h"

#include "Core/Stopping.h"

#include <algorithm>
#include <numeric>

namespace palpate {

namespace {

constexpr std::uint8_t kOpen = 0, kInside = 1, kOutside = 2, kOnSurface = 3;

class Regions {
 public:
  Regions(const BodyPair& pair, bool ofA,
          std::span<const BodyPair::IntersectingTriangles> intersecting,
          InsideRegionsScratch& scratch)
      : m_pair(pair), m_ofA(ofA), m_scratch(scratch) {
    const MeshTopology& topology = pair.geometry(ofA).mesh.topology;
    const std::size_t vertices = pair.vertices(ofA).positions.size();
    scratch.meets.assign(topology.elements.size(), 0);
    scratch.sides.assign(vertices, kOpen);
    scratch.regionOf.resize(vertices);
    std::iota(scratch.regionOf.begin(), scratch.regionOf.end(), 0u);
    TimeCheck check(256);
    for (const BodyPair::IntersectingTriangles& both : intersecting) {
      check();
      const std::uint32_t element = ofA ? both.elementA : both.elementB;
      const unsigned corners = ofA ? both.found.cornersOfAOnB : both.found.cornersOfBOnA;
      scratch.meets[element] = 1;
      for (std::size_t i = 0; i < 3; ++i)
        if (corners >> i & 1) scratch.sides[topology.elements[element][i]] = kOnSurface;
    }
    topology.forEachElement([&](std::uint32_t t) {
      check();
      if (scratch.meets[t]) return;
      const Triangle& corners = topology.elements[t];
      join(corners[0], corners[1]);
      join(corners[0], corners[2]);
    });
  }
  bool isInside(std::uint32_t vertex) {
    if (m_scratch.sides[vertex] == kOnSurface) return false;
    std::uint8_t& side = m_scratch.sides[root(vertex)];
    if (side == kOpen) side = m_pair.isInside(m_ofA, vertex) ? kInside : kOutside;
    return side == kInside;
  }

 private:
  std::uint32_t root(std::uint32_t v) {
    auto& regionOf = m_scratch.regionOf;
    while (regionOf[v] != v) v = regionOf[v] = regionOf[regionOf[v]];
    return v;
  }
  void join(std::uint32_t v, std::uint32_t w) {
    const std::uint32_t first = root(v), second = root(w);
    m_scratch.regionOf[std::max(first, second)] = std::min(first, second);
  }

  const BodyPair& m_pair;
  const bool m_ofA;
  InsideRegionsScratch& m_scratch;
};

}  // namespace

void findInsideVertices(const BodyPair& pair, bool ofA,
                        std::span<const BodyPair::IntersectingTriangles> intersecting,
                        std::size_t most, InsideRegionsScratch& scratch,
                        CountedVector<std::uint32_t>& inside) {
  const BodyVertices& own = pair.vertices(ofA);
  const Eigen::AlignedBox3d& other = pair.vertices(!ofA).box;
  inside.clear();
  TimeCheck check(1024);
  for (std::uint32_t v = 0; v < own.positions.size(); ++v) {
    check();
    if (own.triangleOf[v] != kNoElement && other.contains(own.positions[v])) inside.push_back(v);
  }
  Regions regions(pair, ofA, intersecting, scratch);
  const std::size_t stride = inside.size() / most + 1;
  std::size_t count = 0;
  for (std::size_t i = 0; i < inside.size(); i += stride)
    if (regions.isInside(inside[i])) inside[count++] = inside[i];
  inside.resize(count);
}

}  // namespace palpate
