// Part of <palpate/Meshes.h>: findMeshDefects() of triangles.
#include <palpate/Meshes.h>

#include <algorithm>

namespace palpate {

MeshDefects findMeshDefects(std::span<const Triangle> triangles) {
  struct HalfEdge {
    Segment edge;
    bool reversed;
  };
  std::vector<HalfEdge> halfEdges;
  halfEdges.reserve(3 * triangles.size());
  for (const auto& [a, b, c] : triangles) {
    if (a == b || b == c || c == a) continue;
    for (const auto& [from, to] : {Segment{a, b}, Segment{b, c}, Segment{c, a}})
      halfEdges.push_back({{std::min(from, to), std::max(from, to)}, from > to});
  }
  std::sort(halfEdges.begin(), halfEdges.end(),
            [](const HalfEdge& l, const HalfEdge& r) { return l.edge < r.edge; });
  MeshDefects defects;
  std::vector<std::uint32_t> vertices;
  vertices.reserve(halfEdges.size());
  for (const HalfEdge& h : halfEdges) vertices.push_back(h.edge[h.reversed]);  // where it begins
  std::sort(vertices.begin(), vertices.end());
  defects.unwelded =
      vertices.size() > 3 && std::adjacent_find(vertices.begin(), vertices.end()) == vertices.end();
  for (auto first = halfEdges.begin(), last = first; first != halfEdges.end(); first = last) {
    last = std::find_if(first, halfEdges.end(),
                        [&](const HalfEdge& h) { return h.edge != first->edge; });
    if (last - first == 1)
      defects.open.push_back(first->edge);
    else if (last - first > 2)
      defects.shared.push_back(first->edge);
    else if (first->reversed == first[1].reversed)
      defects.flipped.push_back(first->edge);
  }
  return defects;
}

}  // namespace palpate
