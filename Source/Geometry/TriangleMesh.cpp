#include "Geometry/TriangleMesh.h"

#include <algorithm>
#include <tuple>

namespace palpate {

namespace {

/// Lists per key from (key, item) incidences that come in ascending order of items; repeats
/// dropped.
template <class ForEach>
IndexLists listsByKey(std::size_t keyCount, ForEach&& forEachIncidence) {
  IndexLists lists;
  lists.offsets.assign(keyCount + 1, 0);
  forEachIncidence([&](std::uint32_t key, std::uint32_t) { ++lists.offsets[key + 1]; });
  for (std::size_t i = 0; i < keyCount; ++i) lists.offsets[i + 1] += lists.offsets[i];
  lists.items.resize(lists.offsets.back());
  std::vector<std::uint32_t> next(lists.offsets.begin(), lists.offsets.end() - 1);
  forEachIncidence([&](std::uint32_t key, std::uint32_t item) { lists.items[next[key]++] = item; });
  return lists;
}

}  // namespace

MeshTopology::MeshTopology(std::size_t newVertexCount, std::span<const Triangle> newTriangles)
    : vertexCount(newVertexCount),
      triangles(newTriangles.begin(), newTriangles.end()),
      triangleEdges(newTriangles.size()),
      owned(newTriangles.size(), 0) {
  const auto triangleCount = static_cast<std::uint32_t>(triangles.size());

  // A corner repeated within a triangle counts once.
  vertexTriangles = listsByKey(vertexCount, [&](auto&& incidence) {
    for (std::uint32_t t = 0; t < triangleCount; ++t) {
      const auto& [a, b, c] = triangles[t];
      incidence(a, t);
      if (b != a) incidence(b, t);
      if (c != a && c != b) incidence(c, t);
    }
  });

  struct Side {
    Segment edge;
    std::uint32_t triangle, side;
  };
  std::vector<Side> sides;
  sides.reserve(3 * triangles.size());
  for (std::uint32_t t = 0; t < triangleCount; ++t) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t p = triangles[t][i], q = triangles[t][(i + 1) % 3];
      triangleEdges[t][i] = kNoEdge;
      if (p != q) sides.push_back({{std::min(p, q), std::max(p, q)}, t, i});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& l, const Side& r) {
    return std::tie(l.edge, l.triangle, l.side) < std::tie(r.edge, r.triangle, r.side);
  });
  edgeTriangles.offsets.clear();
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const auto& [edge, triangle, side] = sides[i];
    if (i == 0 || edge != sides[i - 1].edge) {
      owned[triangle] |= static_cast<std::uint8_t>(8u << side);
      edges.push_back(edge);
      edgeTriangles.offsets.push_back(static_cast<std::uint32_t>(edgeTriangles.items.size()));
      edgeTriangles.items.push_back(triangle);
    } else if (triangle != sides[i - 1].triangle) {
      edgeTriangles.items.push_back(triangle);
    }
    triangleEdges[triangle][side] = static_cast<std::uint32_t>(edges.size() - 1);
  }
  edgeTriangles.offsets.push_back(static_cast<std::uint32_t>(edgeTriangles.items.size()));

  for (std::uint32_t v = 0; v < vertexCount; ++v) {
    const auto incident = vertexTriangles[v];
    if (incident.empty()) {
      ++untestedVertices;
      continue;
    }
    const Triangle& owner = triangles[incident.front()];
    const auto corner =
        static_cast<unsigned>(std::find(owner.begin(), owner.end(), v) - owner.begin());
    owned[incident.front()] |= static_cast<std::uint8_t>(1u << corner);
  }
}

std::uint32_t MeshTopology::edgeOf(const Segment& edge) const {
  const auto place = std::lower_bound(edges.begin(), edges.end(), edge);
  if (place == edges.end() || *place != edge) return kNoEdge;
  return static_cast<std::uint32_t>(place - edges.begin());
}

}  // namespace palpate
