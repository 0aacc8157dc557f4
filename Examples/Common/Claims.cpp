#include "Claims.h"

#include <algorithm>
#include <iterator>

namespace palpate::accuracy {

Incidence::Incidence(const std::vector<Triangle>& triangles) {
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (const std::uint32_t vertex : triangles[t]) {
      if (m_byVertex.size() <= vertex) m_byVertex.resize(vertex + 1);
      m_byVertex[vertex].push_back(t);
    }
}

std::vector<std::uint32_t> Incidence::holding(std::uint32_t p, std::uint32_t q) const {
  std::vector<std::uint32_t> both;
  std::set_intersection(m_byVertex[p].begin(), m_byVertex[p].end(), m_byVertex[q].begin(),
                        m_byVertex[q].end(), std::back_inserter(both));
  return both;
}

void Incidence::addTriangles(const FeaturePair& pair, const Incidence& a, const Incidence& b,
                             std::vector<TrianglePair>& out) {
  using Kind = FeaturePair::Kind;
  const auto& [i, j, k, l] = pair.ids;
  std::vector<std::uint32_t> ofA{i}, ofB{j};
  if (pair.kind == Kind::VertexTriangle) ofA = a.holding(i);
  if (pair.kind == Kind::TriangleVertex) ofB = b.holding(j);
  if (pair.kind == Kind::EdgeEdge) {
    ofA = a.holding(i, j);
    ofB = b.holding(k, l);
  }
  for (const std::uint32_t s : ofA)
    for (const std::uint32_t t : ofB) out.push_back({s, t});
}

void sortUnique(std::vector<TrianglePair>& pairs) {
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
}

void addClaims(const CollisionData& data, double from, double to, Claims& out) {
  using Kind = FeaturePair::Kind;
  // Where triangles intersect, contacts of the step's end are Intersection's.
  const bool intersects = data.validity().thickness == 0.0 && !data.intersectingTriangles().empty();
  const auto add = [&](const FeaturePair& features, const auto& contact, double side) {
    const double part = contact.timeOfImpact;
    out.claims.push_back({features, side * contact.normal, contact.distance,
                          (1 - part) * from + part * to, intersects && part == 1});
  };
  for (const auto& c : data.vertexTriangle())
    add({Kind::VertexTriangle, {c.vertex, c.triangle}}, c, 1);
  for (const auto& c : data.triangleVertex())
    add({Kind::TriangleVertex, {c.triangle, c.vertex}}, c, -1);
  for (const auto& c : data.edgeEdge())
    add({Kind::EdgeEdge, {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]}}, c, 1);
  out.trusted = out.trusted.value_or(true) && data.validity().trusted;
  const auto triangles = data.intersectingTriangles();
  out.triangles.insert(out.triangles.end(), triangles.begin(), triangles.end());
}

}  // namespace palpate::accuracy
