#include "Mesh/TetrahedraCut.h"

#include "Exact/Predicates.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <utility>

namespace palpate {

namespace {

int volumeSign(const Tetrahedron& t, std::span<const Eigen::Vector3d> rest) {
  SignCounts counts;
  return orient3d(rest[t[0]], rest[t[1]], rest[t[2]], rest[t[3]], counts);
}

Triangle sortedFace(const Tetrahedron& t, std::uint32_t face) {
  Triangle vertices = faceOf(t, face);
  std::sort(vertices.begin(), vertices.end());
  return vertices;
}

bool holds(const Tetrahedron& t, std::uint32_t vertex) {
  return std::find(t.begin(), t.end(), vertex) != t.end();
}

}  // namespace

bool TetrahedraCut::isPossible(const TetrahedralTopology& topology,
                               std::span<const Eigen::Vector3d> rest,
                               std::span<const Tetrahedron> added) {
  return !topology.hasFlat && std::all_of(added.begin(), added.end(), [&](const Tetrahedron& t) {
    return volumeSign(t, rest) != 0;
  });
}

TetrahedraCut::TetrahedraCut(TetrahedralTopology& topology, std::span<const Eigen::Vector3d> rest,
                             std::span<const std::uint32_t> removed,
                             std::span<const Tetrahedron> added)
    : m_topology(topology), m_removed(removed), m_added(added), m_vertexCount(rest.size()) {
  for (const Tetrahedron& t : added) m_isPositive.push_back(volumeSign(t, rest) > 0);
  if (topology.vertexTetrahedra.size() == 0) makeLists();
  findFaces();
  if (m_fault) return;
  findStars();
  reserve();
}

bool TetrahedraCut::isRemoved(std::uint32_t t) const {
  return std::binary_search(m_removed.begin(), m_removed.end(), t);
}

const Tetrahedron& TetrahedraCut::tetrahedron(std::uint32_t id) const {
  const std::size_t known = m_topology.tetrahedra.size();
  return id < known ? m_topology.tetrahedra[id] : m_added[id - known];
}

Triangle TetrahedraCut::orientedFace(std::uint32_t side) const {
  const std::size_t t = side / 4, known = m_topology.tetrahedra.size();
  Triangle face = faceOf(tetrahedron(side / 4), side % 4);
  if (!(t < known ? m_topology.isPositive[t] : m_isPositive[t - known] != 0))
    std::swap(face[1], face[2]);
  return face;
}

/// Makes what a topology has for cuts.
void TetrahedraCut::makeLists() {
  const CountedVector<Tetrahedron>& all = m_topology.tetrahedra;
  std::size_t vertices = 0;
  for (const Tetrahedron& t : all)
    vertices = std::max<std::size_t>(vertices, *std::max_element(t.begin(), t.end()) + 1);
  IndexLists lists = listsByKey(vertices, [&](auto&& incidence) {
    m_topology.forEach([&](std::uint32_t t) {
      for (const std::uint32_t vertex : all[t]) incidence(vertex, t);
    });
  });
  CountedVector<std::array<std::uint32_t, 4>> ids;
  ids.reserve(withSpare(all.size()));
  ids.resize(all.size(), {kNoElement, kNoElement, kNoElement, kNoElement});
  for (std::uint32_t id = 0; id < m_topology.surface.size(); ++id) {
    const std::uint32_t owner = m_topology.surfaceOwner[id];
    for (std::uint32_t face = 0; owner != kNoElement && face < 4; ++face)
      if (orientedFace(4 * owner + face) == m_topology.surface[id]) ids[owner][face] = id;
  }
  m_topology.faceIds = std::move(ids);
  m_topology.vertexTetrahedra = std::move(lists);
}

/// The tetrahedra around that vertex of a face that has the fewest.
std::span<const std::uint32_t> TetrahedraCut::shortestList(const Triangle& face) const {
  std::span<const std::uint32_t> shortest = m_topology.vertexTetrahedra[face[0]];
  for (const std::uint32_t vertex : face)
    if (const auto list = m_topology.vertexTetrahedra[vertex]; list.size() < shortest.size())
      shortest = list;
  return shortest;
}

/// Finds what becomes of the faces of tetrahedra that are removed or added.
void TetrahedraCut::findFaces() {
  struct Face {
    Triangle vertices;
    std::uint32_t side;
  };
  CountedVector<Face> faces;
  const auto add = [&](std::uint32_t t) {
    for (std::uint32_t face = 0; face < 4; ++face)
      faces.push_back({sortedFace(tetrahedron(t), face), 4 * t + face});
  };
  const auto known = static_cast<std::uint32_t>(m_topology.tetrahedra.size());
  for (const std::uint32_t t : m_removed) add(t);
  for (std::uint32_t t = 0; t < m_added.size(); ++t) add(known + t);
  std::sort(faces.begin(), faces.end(), [](const Face& l, const Face& r) {
    return l.vertices != r.vertices ? l.vertices < r.vertices : l.side < r.side;
  });
  Sides exposed, before, after;
  CountedVector<std::uint32_t> gone;
  for (auto first = faces.begin(); first != faces.end() && !m_fault;) {
    const auto end = std::find_if(
        first, faces.end(), [&](const Face& face) { return face.vertices != first->vertices; });
    const auto& [p, q, r] = first->vertices;
    before.clear(), after.clear();
    if (r < m_topology.vertexTetrahedra.size())
      for (const std::uint32_t t : shortestList(first->vertices)) {
        const Tetrahedron& corners = m_topology.tetrahedra[t];
        if (!holds(corners, p) || !holds(corners, q) || !holds(corners, r)) continue;
        std::uint32_t face = 0;  // the one without the other corner
        while (corners[face] == p || corners[face] == q || corners[face] == r) ++face;
        before.push_back(4 * t + face);
        if (!isRemoved(t)) after.push_back(4 * t + face);
      }
    for (; first != end; ++first)
      if (first->side / 4 >= known) after.push_back(first->side);
    if (after.size() > 2) m_fault = {{p, q, r}, {after[0] / 4, after[1] / 4, after[2] / 4}};
    if (before.size() == 1) gone.push_back(m_topology.faceIds[before[0] / 4][before[0] % 4]);
    if (after.size() == 1) exposed.push_back(after[0]);
  }
  if (!m_fault) findIds(exposed, gone);
}

/// A surface triangle that is gone and there again, with the same corners, keeps its id.
void TetrahedraCut::findIds(Sides& exposed, CountedVector<std::uint32_t>& gone) {
  const CountedVector<Triangle>& surface = m_topology.surface;
  std::sort(exposed.begin(), exposed.end());
  std::sort(gone.begin(), gone.end(),
            [&](std::uint32_t l, std::uint32_t r) { return surface[l] < surface[r]; });
  for (const std::uint32_t side : exposed) {
    const Triangle face = orientedFace(side);
    const auto same =
        std::lower_bound(gone.begin(), gone.end(), face,
                         [&](std::uint32_t id, const Triangle& f) { return surface[id] < f; });
    if (same != gone.end() && surface[*same] == face) {
      m_passed.push_back(*same);
      m_passedTo.push_back(side);
      gone.erase(same);
    } else {
      m_new.push_back(face);
      m_newOf.push_back(side);
    }
  }
  std::sort(gone.begin(), gone.end());
  m_gone = std::move(gone);
}

void TetrahedraCut::findStars() {
  struct Corner {
    std::uint32_t vertex, tetrahedron;
    auto operator<=>(const Corner&) const = default;
  };
  CountedVector<Corner> corners;  // of added ones; others only name their vertices
  for (const std::uint32_t t : m_removed)
    for (const std::uint32_t vertex : m_topology.tetrahedra[t])
      corners.push_back({vertex, kNoElement});
  for (std::size_t i = 0; i < m_added.size(); ++i)
    for (const std::uint32_t vertex : m_added[i])
      corners.push_back({vertex, static_cast<std::uint32_t>(m_topology.tetrahedra.size() + i)});
  for (std::size_t v = m_topology.vertexTetrahedra.size(); v < m_vertexCount; ++v)
    corners.push_back({static_cast<std::uint32_t>(v), kNoElement});
  std::sort(corners.begin(), corners.end());
  for (const auto& [vertex, t] : corners) {
    if (m_stars.empty() || m_stars.back().vertex != vertex) {
      CountedVector<std::uint32_t>& list = m_stars.emplace_back(Star{vertex, {}}).list;
      if (vertex < m_topology.vertexTetrahedra.size())
        for (const std::uint32_t other : m_topology.vertexTetrahedra[vertex])
          if (!isRemoved(other)) list.push_back(other);
    }
    if (t != kNoElement) m_stars.back().list.push_back(t);
  }
}

void TetrahedraCut::reserve() {
  const std::size_t size = m_topology.tetrahedra.size() + m_added.size(),
                    faces = m_topology.surface.size() + m_new.size();
  reserveAmortized(m_topology.tetrahedra, size);
  reserveAmortized(m_topology.isPositive, size);
  reserveAmortized(m_topology.faceIds, size);
  reserveAmortized(m_topology.removed, m_topology.removed.size() + m_removed.size());
  reserveAmortized(m_topology.surface, faces);
  reserveAmortized(m_topology.surfaceOwner, faces);
  std::size_t items = 0;
  for (const Star& star : m_stars) items += star.list.size();
  m_topology.vertexTetrahedra.reserveMore(m_vertexCount - m_topology.vertexTetrahedra.size(),
                                          items);
}

void TetrahedraCut::apply() noexcept {
  PALPATE_ASSERT(!m_fault);
  TetrahedralTopology& to = m_topology;
  for (const std::uint32_t id : m_gone) {
    const std::uint32_t owner = std::exchange(to.surfaceOwner[id], kNoElement);
    to.surface[id] = {};
    for (std::uint32_t& face : to.faceIds[owner])
      if (face == id) face = kNoElement;
  }
  for (const std::uint32_t t : m_removed)
    to.faceIds[t] = {kNoElement, kNoElement, kNoElement, kNoElement};
  insertSorted(to.removed, m_removed);
  to.tetrahedra.insert(to.tetrahedra.end(), m_added.begin(), m_added.end());
  for (const std::uint8_t isPositive : m_isPositive) to.isPositive.push_back(isPositive != 0);
  to.faceIds.resize(to.tetrahedra.size(), {kNoElement, kNoElement, kNoElement, kNoElement});
  for (std::size_t i = 0; i < m_passed.size(); ++i) {
    to.surfaceOwner[m_passed[i]] = m_passedTo[i] / 4;
    to.faceIds[m_passedTo[i] / 4][m_passedTo[i] % 4] = m_passed[i];
  }
  for (std::size_t i = 0; i < m_new.size(); ++i) {
    to.faceIds[m_newOf[i] / 4][m_newOf[i] % 4] = static_cast<std::uint32_t>(to.surface.size());
    to.surface.push_back(m_new[i]);
    to.surfaceOwner.push_back(m_newOf[i] / 4);
  }
  for (const Star& star : m_stars)
    if (star.vertex < to.vertexTetrahedra.size())
      to.vertexTetrahedra.replace(star.vertex, star.list);
    else
      to.vertexTetrahedra.append(star.list);
}

}  // namespace palpate
