#include "Geometry/TriangleMesh.h"

#include <algorithm>
#include <tuple>

namespace palpate {

MeshTopology::MeshTopology(std::size_t newVertexCount, std::span<const Triangle> newTriangles)
    : vertexCount(newVertexCount),
      triangles(newTriangles.begin(), newTriangles.end()),
      triangleEdges(newTriangles.size()) {
  struct Side {
    Segment edge;
    std::uint32_t triangle, side;
  };
  std::vector<Side> sides;
  sides.reserve(3 * triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t p = triangles[t][i], q = triangles[t][(i + 1) % 3];
      triangleEdges[t][i] = kNoEdge;
      if (p != q) sides.push_back({{std::min(p, q), std::max(p, q)}, t, i});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& l, const Side& r) {
    return std::tie(l.edge, l.triangle, l.side) < std::tie(r.edge, r.triangle, r.side);
  });
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const auto& [edge, triangle, side] = sides[i];
    if (i == 0 || edge != sides[i - 1].edge) edges.push_back(edge);
    triangleEdges[triangle][side] = static_cast<std::uint32_t>(edges.size() - 1);
  }
  findOwners();
}

void MeshTopology::disable(std::span<const std::uint32_t> newDisabled) {
  isDisabled.assign(newDisabled.empty() ? 0 : triangles.size(), false);
  for (const std::uint32_t triangle : newDisabled) isDisabled[triangle] = true;
  disabled.clear();
  for (std::uint32_t t = 0; t < isDisabled.size(); ++t)
    if (isDisabled[t]) disabled.push_back(t);
  findOwners();
}

void MeshTopology::findOwners() {
  // What a triangle holds twice counts once.
  const auto listsOf = [&](std::size_t count, const auto& heldBy) {
    return listsByKey(count, [&](auto&& incidence) {
      for (std::uint32_t t = 0; t < triangles.size(); ++t) {
        if (!isOn(t)) continue;
        const auto& [a, b, c] = heldBy[t];
        if (a != kNoEdge) incidence(a, t);
        if (b != kNoEdge && b != a) incidence(b, t);
        if (c != kNoEdge && c != a && c != b) incidence(c, t);
      }
    });
  };
  vertexTriangles = listsOf(vertexCount, triangles);
  edgeTriangles = listsOf(edges.size(), triangleEdges);

  owned.assign(triangles.size(), 0);
  const auto own = [&](std::uint32_t item, std::uint32_t owner, const auto& held, unsigned first) {
    const auto place = std::find(held.begin(), held.end(), item) - held.begin();
    owned[owner] |= static_cast<std::uint8_t>(first << place);
  };
  untestedVertices = 0;
  for (std::uint32_t v = 0; v < vertexCount; ++v) {
    const auto incident = vertexTriangles[v];
    if (incident.empty())
      ++untestedVertices;
    else
      own(v, incident.front(), triangles[incident.front()], 1);
  }
  hasClosedStar.assign(vertexCount, 1);
  const auto goesUp = [&](std::uint32_t e, std::uint32_t triangle) {
    const auto side = std::find(triangleEdges[triangle].begin(), triangleEdges[triangle].end(), e);
    return triangles[triangle][side - triangleEdges[triangle].begin()] == edges[e][0];
  };
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    const auto incident = edgeTriangles[e];
    if (!incident.empty()) own(e, incident.front(), triangleEdges[incident.front()], 8);
    if (incident.size() != 2 || goesUp(e, incident[0]) == goesUp(e, incident[1]))
      hasClosedStar[edges[e][0]] = hasClosedStar[edges[e][1]] = 0;
  }
}

std::uint32_t MeshTopology::edgeOf(const Segment& edge) const {
  const auto place = std::lower_bound(edges.begin(), edges.end(), edge);
  if (place == edges.end() || *place != edge) return kNoEdge;
  return static_cast<std::uint32_t>(place - edges.begin());
}

}  // namespace palpate
