#include "NarrowPhase/Surroundings.h"

#include "Math/ClosestPoint.h"
#include "Math/ExactMotion.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate {

namespace {

using Kind = ImpactQuery::Kind;
using Sector = TouchSurroundings::Sector;

ImpactQuery::Step stepOf(const TriangleMesh& mesh, std::uint32_t vertex) {
  return {mesh.before[vertex], mesh.now[vertex]};
}

/// Appends the elements around a vertex or an edge, and their other corners.
template <class Vertices>
void appendElements(const TriangleMesh& mesh, std::span<const std::uint32_t> elements,
                    const Vertices& without, std::size_t feature, TouchSurroundings& around) {
  around.isAlone &= elements.size() <= 1;
  around.at[feature] = stepOf(mesh, without[0]);
  for (const std::uint32_t element : elements) {
    const Triangle& corners = mesh.topology.elements[element];
    for (const std::uint32_t v : corners)
      if (std::find(without.begin(), without.end(), v) == without.end())
        around.neighbours[feature].push_back(stepOf(mesh, v));
    if (mesh.topology.hasFaces())
      around.triangles[feature].push_back(
          {stepOf(mesh, corners[0]), stepOf(mesh, corners[1]), stepOf(mesh, corners[2])});
  }
}

void findNeighbours(const TriangleMesh& mesh, std::uint32_t vertex, std::size_t feature,
                    TouchSurroundings& around) {
  appendElements(mesh, mesh.topology.vertexTriangles[vertex], std::array{vertex}, feature, around);
}
void findOppositeCorners(const TriangleMesh& mesh, std::uint32_t edge, std::size_t feature,
                         TouchSurroundings& around) {
  appendElements(mesh, mesh.topology.edgeTriangles[edge], mesh.topology.edges[edge], feature,
                 around);
}

/// The triangles of an edge of around.own. They are a closed surface there if as many have the
/// edge in one direction as in the other.
void findEdgeSectors(const TriangleMesh& mesh, std::size_t edge, TouchSurroundings& around) {
  const MeshTopology& topology = mesh.topology;
  const auto& own = topology.elements[around.own];
  const std::uint32_t first = own[edge], second = own[(edge + 1) % 3];
  around.isEdge = true;
  around.at[1] = stepOf(mesh, first);
  std::ptrdiff_t balance = 0;
  const auto sectorOf = [&](std::uint32_t triangle) -> Sector {
    const Triangle& t = topology.elements[triangle];
    for (std::size_t i = 0; i < 3; ++i) {
      const ImpactQuery::Step end = stepOf(mesh, second), opposite = stepOf(mesh, t[(i + 2) % 3]);
      if (t[i] == first && t[(i + 1) % 3] == second) return {end, opposite, triangle, false};
      if (t[i] == second && t[(i + 1) % 3] == first) return {opposite, end, triangle, true};
    }
    PALPATE_ASSERT(false);
    return {};
  };
  const std::uint32_t id = topology.triangleEdges[around.own][edge];
  if (id != kNoEdge)
    for (const std::uint32_t triangle : topology.edgeTriangles[id]) {
      around.sectors.push_back(sectorOf(triangle));
      balance += around.sectors.back().endsWithEdge ? -1 : 1;
    }
  around.isClosed = !around.sectors.empty() && balance == 0;
  if (!around.isClosed) around.sectors.assign(1, sectorOf(around.own));
}

/// The triangles around a corner of around.own.
class Fan {
 public:
  Fan(const TriangleMesh& mesh, std::uint32_t vertex) : m_mesh(mesh), m_vertex(vertex) {}

  /// Whether each edge at the vertex begins as many triangles there as it ends.
  bool isClosed() const {
    const auto around = m_mesh.topology.vertexTriangles[m_vertex];
    return std::all_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
      for (const std::uint32_t end : bordersOf(triangle)) {
        std::ptrdiff_t balance = 0;
        for (const std::uint32_t other : around) {
          const auto [a, b] = bordersOf(other);
          balance += (a == end) - (b == end);
        }
        if (balance != 0) return false;
      }
      return true;
    });
  }
  Sector sectorOf(std::uint32_t triangle) const {
    const auto [a, b] = bordersOf(triangle);
    return {stepOf(m_mesh, a), stepOf(m_mesh, b), triangle};
  }
  /// The only triangle that begins (side 0) or ends where this one ends or begins.
  std::uint32_t next(std::uint32_t triangle, std::size_t side) const {
    const std::uint32_t border = bordersOf(triangle)[1 - side];
    std::uint32_t found = kNoElement;
    std::size_t count = 0;
    for (const std::uint32_t other : m_mesh.topology.vertexTriangles[m_vertex]) {
      const auto ends = bordersOf(other);
      count += (ends[0] == border) + (ends[1] == border);
      if (other != triangle && ends[side] == border) found = other;
    }
    return count == 2 ? found : kNoElement;
  }

 private:
  std::array<std::uint32_t, 2> bordersOf(std::uint32_t triangle) const {
    const Triangle& t = m_mesh.topology.elements[triangle];
    const std::size_t i = t[0] == m_vertex ? 0 : t[1] == m_vertex ? 1 : 2;
    return {t[(i + 1) % 3], t[(i + 2) % 3]};
  }

  const TriangleMesh& m_mesh;
  const std::uint32_t m_vertex;
};

void findVertexSectors(const TriangleMesh& mesh, std::uint32_t vertex, TouchSurroundings& around) {
  around.at[1] = stepOf(mesh, vertex);
  const Fan fan(mesh, vertex);
  around.isClosed = fan.isClosed();
  if (around.isClosed) {
    for (const std::uint32_t triangle : mesh.topology.vertexTriangles[vertex])
      around.sectors.push_back(fan.sectorOf(triangle));
    return;
  }
  std::uint32_t first = around.own;
  for (std::uint32_t t = first; (t = fan.next(t, 1)) != kNoElement && t != around.own;) first = t;
  for (std::uint32_t t = first; t != kNoElement;) {
    around.sectors.push_back(fan.sectorOf(t));
    t = fan.next(t, 0);
    if (t == first) break;
  }
}

/// What surrounds a touched edge or corner that triangles without area join to others.
class FlatJoints {
 public:
  FlatJoints(const TriangleMesh& mesh, std::uint32_t own, std::size_t border,
             const PlaceOnSegment& place)
      : m_mesh(mesh),
        m_topology(mesh.topology),
        m_own(own),
        m_border(border),
        m_place(place),
        m_joined(
            mesh.topology, featureOf(mesh.topology, own, static_cast<TriangleFeature>(border)),
            [&](std::uint32_t triangle) { return isFlat(mesh.topology.elements[triangle]); },
            [&](std::uint32_t u, std::uint32_t v) {
              return place(stepOf(mesh, u), stepOf(mesh, v));
            }) {}

  /// Sets what surrounds the place. Returns false if nothing is joined there, at a border, and
  /// where corners meet only for a moment.
  bool find(TouchSurroundings& around) {
    const auto& features = m_joined.features;
    if (features.size() < 2 ||
        !std::all_of(features.begin(), features.end(),
                     [&](const MeshFeature& feature) { return isClosed(feature); }))
      return false;
    const MeshFeature* const corner = m_joined.vertex();
    return corner ? findAtCorner(corner->id, around) : findAtEdges(around);
  }

 private:
  using Face = JoinedFeatures::Face;
  static bool isCorner(const MeshFeature& feature) {
    return feature.kind == MeshFeature::Kind::Vertex;
  }
  /// Whether a triangle has no area during the whole step.
  bool isFlat(const Triangle& t) const {
    for (const Positions* p : {&m_mesh.before, &m_mesh.now})
      if (hasArea((*p)[t[0]], (*p)[t[1]], (*p)[t[2]])) return false;
    std::array<Linear, 3> at;
    toIntegers(std::array{stepOf(m_mesh, t[0]), stepOf(m_mesh, t[1]), stepOf(m_mesh, t[2])}, at);
    const Quadratic normal = cross(difference(at[1], at[0]), difference(at[2], at[0]));
    return std::all_of(normal.begin(), normal.end(), [](const auto& x) { return isZero(x); });
  }
  bool isClosed(const MeshFeature& feature) const {
    if (isCorner(feature)) return Fan(m_mesh, feature.id).isClosed();
    std::ptrdiff_t balance = 0;
    for (const std::uint32_t triangle : m_topology.edgeTriangles[feature.id])
      balance += edgeOf({triangle, feature})[0] == m_topology.edges[feature.id][0] ? 1 : -1;
    return balance == 0;
  }
  /// The touched edge's vertices and the other one, in the winding of the triangle.
  Triangle edgeOf(const Face& face) const {
    const Triangle& t = m_topology.elements[face.triangle];
    std::size_t i = 0;
    while (i < 2 && m_topology.triangleEdges[face.triangle][i] != face.touched.id) ++i;
    return {t[i], t[(i + 1) % 3], t[(i + 2) % 3]};
  }
  void addTriangle(const Face& face, TouchSurroundings& around) const {
    const auto [a, b, c] = m_topology.elements[face.triangle];
    around.triangles[1].push_back({stepOf(m_mesh, a), stepOf(m_mesh, b), stepOf(m_mesh, c)});
  }

  bool findAtCorner(std::uint32_t corner, TouchSurroundings& around) const {
    const auto isThere = [&](const MeshFeature& feature) {
      return !isCorner(feature) || (m_mesh.before[feature.id] == m_mesh.before[corner] &&
                                    m_mesh.now[feature.id] == m_mesh.now[corner]);
    };
    if (!std::all_of(m_joined.features.begin(), m_joined.features.end(), isThere)) return false;
    around.at[1] = stepOf(m_mesh, corner);
    for (const Face& face : m_joined.faces) {
      addTriangle(face, around);
      if (isCorner(face.touched)) {
        around.sectors.push_back(Fan(m_mesh, face.touched.id).sectorOf(face.triangle));
        continue;
      }
      const auto [p, q, opposite] = edgeOf(face);
      const ImpactQuery::Step middle = stepOf(m_mesh, opposite);
      around.sectors.push_back({stepOf(m_mesh, q), middle, face.triangle});
      around.sectors.push_back({middle, stepOf(m_mesh, p), face.triangle});
    }
    for (const Sector& sector : around.sectors)
      around.neighbours[1].insert(around.neighbours[1].end(), {sector.a, sector.b});
    around.isClosed = true;
    return true;
  }

  bool findAtEdges(TouchSurroundings& around) const {
    const Triangle& own = m_topology.elements[m_own];
    const ImpactQuery::Step end = stepOf(m_mesh, own[(m_border - 2) % 3]);
    around.isEdge = around.isClosed = true;
    around.at[1] = stepOf(m_mesh, own[m_border - 3]);
    for (const Face& face : m_joined.faces) {
      addTriangle(face, around);
      const auto [p, q, opposite] = edgeOf(face);
      const ImpactQuery::Step aside = stepOf(m_mesh, opposite);
      around.neighbours[1].push_back(aside);
      if (m_place(stepOf(m_mesh, q), end))  // between both: the edge has the other direction
        around.sectors.push_back({aside, end, face.triangle, true});
      else
        around.sectors.push_back({end, aside, face.triangle, false});
    }
    return true;
  }

  const TriangleMesh& m_mesh;
  const MeshTopology& m_topology;
  const std::uint32_t m_own;
  const std::size_t m_border;
  const PlaceOnSegment& m_place;
  const JoinedFeatures m_joined;
};

}  // namespace

template <Kind kind>
void findSurroundings(const Features<kind>& features, std::uint32_t firstId, std::uint32_t secondId,
                      std::array<int, 2> touch, const PlaceOnSegment& place,
                      TouchSurroundings& around) {
  const TriangleMesh &first = features.first, &second = features.second;
  if constexpr (kind == Kind::VertexTriangle) {
    around.own = secondId;
    findNeighbours(first, firstId, 0, around);
    const auto border = static_cast<std::size_t>(touch[1]);
    if (FlatJoints(second, secondId, border, place).find(around)) return;
    if (border < 3) {
      const std::uint32_t corner = second.topology.elements[secondId][border];
      findNeighbours(second, corner, 1, around);
      findVertexSectors(second, corner, around);
    } else {
      const std::uint32_t edge = second.topology.triangleEdges[secondId][border - 3];
      if (edge != kNoEdge) findOppositeCorners(second, edge, 1, around);
      findEdgeSectors(second, border - 3, around);
    }
  } else {
    const std::array ids{firstId, secondId};
    for (std::size_t i = 0; i < 2; ++i) {
      const TriangleMesh& mesh = i == 0 ? first : second;
      if (touch[i] == 2)
        findOppositeCorners(mesh, ids[i], i, around);
      else
        findNeighbours(mesh, mesh.topology.edges[ids[i]][static_cast<std::size_t>(touch[i])], i,
                       around);
    }
  }
}
template void findSurroundings(const Features<Kind::VertexTriangle>&, std::uint32_t, std::uint32_t,
                               std::array<int, 2>, const PlaceOnSegment&, TouchSurroundings&);
template void findSurroundings(const Features<Kind::EdgeEdge>&, std::uint32_t, std::uint32_t,
                               std::array<int, 2>, const PlaceOnSegment&, TouchSurroundings&);

}  // namespace palpate
