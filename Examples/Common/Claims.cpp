#include "Claims.h"

#include <algorithm>
#include <initializer_list>
#include <iterator>

namespace palpate::accuracy {

namespace {

Held heldBy(std::initializer_list<std::uint32_t> vertices) {
  Held held{};
  std::copy(vertices.begin(), vertices.end(), held.begin());
  std::sort(held.begin(), held.begin() + static_cast<std::ptrdiff_t>(vertices.size()));
  std::fill(held.begin() + static_cast<std::ptrdiff_t>(vertices.size()), held.end(),
            held[vertices.size() - 1]);
  return held;
}

Held heldBy(const VertexTriangleContact& contact) {
  const auto& [p, q, r] = contact.vertices;
  const int feature = static_cast<int>(contact.feature);
  if (contact.feature == TriangleFeature::Face) return heldBy({p, q, r});
  if (feature < 3) return heldBy({contact.vertices[feature]});
  return heldBy({contact.vertices[feature - 3], contact.vertices[(feature - 2) % 3]});
}

Held heldBy(const std::array<std::uint32_t, 2>& edge, EdgeFeature feature) {
  if (feature == EdgeFeature::Interior) return heldBy({edge[0], edge[1]});
  return heldBy({edge[feature == EdgeFeature::End]});
}

std::vector<Held> featuresOf(std::uint32_t vertex) { return {heldBy({vertex})}; }
std::vector<Held> featuresOf(std::uint32_t p, std::uint32_t q) {
  return {heldBy({p}), heldBy({q}), heldBy({p, q})};
}
std::vector<Held> featuresOf(const Triangle& t) {
  return {heldBy({t[0]}),
          heldBy({t[1]}),
          heldBy({t[2]}),
          heldBy({t[0], t[1]}),
          heldBy({t[1], t[2]}),
          heldBy({t[2], t[0]}),
          heldBy({t[0], t[1], t[2]})};
}

}  // namespace

Substitutes::Substitutes(const Claims& said) {
  if (!said.distinct) return;
  for (const Claim& claim : said.claims) {
    if (!(claim.time < 1)) continue;
    m_impacts.push_back(&claim);
    const auto [entry, isNew] = m_byHeld.try_emplace(claim.held, &claim);
    if (!isNew && claim.time < entry->second->time) entry->second = &claim;
  }
}

const Claim* Substitutes::find(const FeaturePair& pair, const Incidence& a,
                               const Incidence& b) const {
  if (m_byHeld.empty()) return nullptr;
  using Kind = FeaturePair::Kind;
  const auto& [i, j, k, l] = pair.ids;
  std::vector<Held> ofA, ofB;
  if (pair.kind == Kind::VertexTriangle) ofA = featuresOf(i), ofB = featuresOf(b.corners(j));
  if (pair.kind == Kind::TriangleVertex) ofA = featuresOf(a.corners(i)), ofB = featuresOf(j);
  if (pair.kind == Kind::EdgeEdge) ofA = featuresOf(i, j), ofB = featuresOf(k, l);
  const Claim* first = nullptr;
  for (const Held& p : ofA)
    for (const Held& q : ofB) {
      const auto found = m_byHeld.find({p, q});
      if (found != m_byHeld.end() && (!first || found->second->time < first->time))
        first = found->second;
    }
  return first;
}

/// The vertices of a pair's features on both sides, sorted.
static std::array<std::vector<std::uint32_t>, 2> verticesOf(const FeaturePair& pair,
                                                            const Incidence& a,
                                                            const Incidence& b) {
  using Kind = FeaturePair::Kind;
  const auto& [i, j, k, l] = pair.ids;
  const auto cornersOf = [](const Incidence& mesh, std::uint32_t triangle) {
    const Triangle& corners = mesh.corners(triangle);
    return std::vector<std::uint32_t>(corners.begin(), corners.end());
  };
  std::array<std::vector<std::uint32_t>, 2> vertices;
  if (pair.kind == Kind::VertexTriangle) vertices = {std::vector{i}, cornersOf(b, j)};
  if (pair.kind == Kind::TriangleVertex) vertices = {cornersOf(a, i), std::vector{j}};
  if (pair.kind == Kind::EdgeEdge) vertices = {std::vector{i, j}, std::vector{k, l}};
  for (auto& side : vertices) std::sort(side.begin(), side.end());
  return vertices;
}

const Claim* Substitutes::findBeside(const FeaturePair& pair, const Incidence& a,
                                     const Incidence& b,
                                     const std::function<bool(const Claim&)>& stands) const {
  const auto sought = verticesOf(pair, a, b);
  const Claim* first = nullptr;
  for (const Claim* claim : m_impacts) {
    if ((first && claim->time >= first->time) || !stands(*claim)) continue;
    const auto its = verticesOf(claim->features, a, b);
    for (std::size_t side = 0; side < 2; ++side)
      if (!its[side].empty() && std::includes(sought[side].begin(), sought[side].end(),
                                              its[side].begin(), its[side].end()))
        first = claim;
  }
  return first;
}

Incidence::Incidence(const std::vector<Triangle>& triangles) : m_triangles(triangles) {
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
                             std::vector<ElementPair>& out) {
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

void sortUnique(std::vector<ElementPair>& pairs) {
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
}

void addClaims(const CollisionData& data, double from, double to, Claims& out) {
  using Kind = FeaturePair::Kind;
  // Where triangles intersect, contacts at the step's end are Intersection's.
  const bool intersects =
      data.validity().effectiveThickness == 0.0 && !data.intersectingTriangles().empty();
  const auto add = [&](const FeaturePair& features, const auto& contact, double side,
                       const std::array<Held, 2>& held) {
    const double part = contact.timeOfImpact;
    out.claims.push_back({features, side * contact.normal, contact.distance,
                          (1 - part) * from + part * to, intersects && part == 1, held});
  };
  for (const auto& c : data.vertexTriangle())
    add({Kind::VertexTriangle, {c.vertex, c.triangle}}, c, 1, {heldBy({c.vertex}), heldBy(c)});
  for (const auto& c : data.triangleVertex())
    add({Kind::TriangleVertex, {c.triangle, c.vertex}}, c, -1, {heldBy(c), heldBy({c.vertex})});
  for (const auto& c : data.edgeEdge())
    add({Kind::EdgeEdge, {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]}}, c, 1,
        {heldBy(c.edgeA, c.featureA), heldBy(c.edgeB, c.featureB)});
  out.trusted = out.trusted.value_or(true) && data.validity().trusted;
  const auto triangles = data.intersectingTriangles();
  out.triangles.insert(out.triangles.end(), triangles.begin(), triangles.end());
}

}  // namespace palpate::accuracy
