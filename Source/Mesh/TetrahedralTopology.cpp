#include "Mesh/TetrahedralTopology.h"

#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace palpate {

namespace {

constexpr std::uint32_t kNone = 0xffffffffu;

/// A face, identified by its vertices in ascending order.
struct Face {
  Triangle vertices;
  std::uint32_t side;  ///< 4 times the tetrahedron's index, plus the face's
};

/// Whether a face's winding, as faceOf() returns it, is that of its vertices in ascending order.
bool ascends(const Tetrahedron& tetrahedron, std::uint32_t side) {
  const auto [a, b, c] = faceOf(tetrahedron, side % 4);
  return (a < b) + (b < c) + (c < a) == 2;
}

/// For each side, the side of the tetrahedron beyond it; kNone: the outside.
CountedVector<std::uint32_t> opposites(const TetrahedralTopology& topology, std::size_t vertexCount,
                                       std::optional<OverusedFace>& fault) {
  const CountedVector<Tetrahedron>& tetrahedra = topology.tetrahedra;
  CountedVector<Face> all;
  all.reserve(4 * tetrahedra.size());
  topology.forEach([&](std::uint32_t t) {
    for (std::uint32_t side = 4 * t; side < 4 * t + 4; ++side) {
      all.push_back({faceOf(tetrahedra[t], side % 4), side});
      std::sort(all.back().vertices.begin(), all.back().vertices.end());
    }
  });
  // By the lowest vertex in linear time, then the few faces of each vertex.
  CountedVector<std::size_t> ends(vertexCount + 1, 0);
  for (const Face& face : all) ++ends[face.vertices[0] + 1];
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  CountedVector<Face> faces(all.size());
  for (const Face& face : all) faces[ends[face.vertices[0]]++] = face;
  for (std::size_t vertex = 0, begin = 0; vertex < vertexCount; begin = ends[vertex++])
    std::sort(faces.data() + begin, faces.data() + ends[vertex], [](const Face& l, const Face& r) {
      return l.vertices != r.vertices ? l.vertices < r.vertices : l.side < r.side;
    });
  CountedVector<std::uint32_t> beyond(4 * tetrahedra.size(), kNone);
  for (std::size_t i = 0; i + 1 < faces.size(); ++i) {
    if (faces[i].vertices != faces[i + 1].vertices) continue;
    if (i + 2 < faces.size() && faces[i + 2].vertices == faces[i].vertices) {
      fault = {faces[i].vertices,
               {faces[i].side / 4, faces[i + 1].side / 4, faces[i + 2].side / 4}};
      break;
    }
    beyond[faces[i].side] = faces[i + 1].side;
    beyond[faces[i + 1].side] = faces[i].side;
  }
  return beyond;
}

/// For each tetrahedron, whether its corners as given are wound as if its volume were positive.
CountedVector<bool> findOrientations(std::span<const Eigen::Vector3d> rest,
                                     TetrahedralTopology& topology,
                                     std::span<const std::uint32_t> beyond) {
  const CountedVector<Tetrahedron>& tetrahedra = topology.tetrahedra;
  CountedVector<bool> positive(tetrahedra.size(), true), known(tetrahedra.size(), true);
  CountedVector<std::uint32_t> queue;
  SignCounts counts;
  topology.forEach([&](std::uint32_t t) {
    const auto& [a, b, c, d] = tetrahedra[t];
    const int sign = orient3d(rest[a], rest[b], rest[c], rest[d], counts);
    positive[t] = sign >= 0;
    known[t] = sign != 0;
    if (sign != 0) queue.push_back(t);
  });
  topology.hasFlat = queue.size() < tetrahedra.size() - topology.removed.size();
  if (!topology.hasFlat) return positive;
  // Tetrahedra without volume follow from their neighbours: two sides of one face are wound in
  // opposite directions.
  const auto propagate = [&] {
    for (std::size_t next = 0; next < queue.size(); ++next)
      for (std::uint32_t side = 4 * queue[next]; side < 4 * queue[next] + 4; ++side) {
        const std::uint32_t other = beyond[side];
        if (other == kNone || known[other / 4]) continue;
        known[other / 4] = true;
        positive[other / 4] = positive[side / 4] == (ascends(tetrahedra[side / 4], side) !=
                                                     ascends(tetrahedra[other / 4], other));
        queue.push_back(other / 4);
      }
  };
  propagate();
  for (std::uint32_t t = 0; t < tetrahedra.size(); ++t) {
    if (known[t]) continue;
    known[t] = true;
    queue.assign(1, t);
    propagate();
  }
  return positive;
}

}  // namespace

TetrahedralTopology topologyOf(std::span<const Eigen::Vector3d> rest,
                               std::span<const Tetrahedron> tetrahedra,
                               std::optional<OverusedFace>& fault,
                               std::span<const std::uint32_t> removed) {
  PALPATE_ASSERT(std::all_of(tetrahedra.begin(), tetrahedra.end(), [&](const Tetrahedron& t) {
    return *std::max_element(t.begin(), t.end()) < rest.size();
  }));
  TetrahedralTopology topology{
      {tetrahedra.begin(), tetrahedra.end()}, {}, {}, {}, {removed.begin(), removed.end()}};
  const CountedVector<std::uint32_t> beyond = opposites(topology, rest.size(), fault);
  if (fault) return topology;
  topology.isPositive = findOrientations(rest, topology, beyond);
  topology.forEach([&](std::uint32_t t) {
    for (std::uint32_t side = 4 * t; side < 4 * t + 4; ++side) {
      if (beyond[side] != kNone) continue;
      Triangle& face = topology.surface.emplace_back(faceOf(tetrahedra[t], side % 4));
      if (!topology.isPositive[t]) std::swap(face[1], face[2]);
      topology.surfaceOwner.push_back(t);
    }
  });
  return topology;
}

CountedVector<std::uint32_t> keepSurfaceIds(std::span<const Triangle> ids,
                                            TetrahedralTopology& topology) {
  struct Known {
    Triangle corners;
    std::uint32_t id;
  };
  const auto precedes = [](const Known& l, const Known& r) { return l.corners < r.corners; };
  CountedVector<Known> known;
  for (std::uint32_t id = 0; id < ids.size(); ++id)
    if (ids[id][0] != ids[id][1]) known.push_back({ids[id], id});
  std::sort(known.begin(), known.end(), precedes);
  CountedVector<Triangle> surface(ids.size(), Triangle{});
  CountedVector<std::uint32_t> owners(ids.size(), kNone);
  for (std::size_t i = 0; i < topology.surface.size(); ++i) {
    const Triangle& corners = topology.surface[i];
    const auto place = std::lower_bound(known.begin(), known.end(), Known{corners, 0}, precedes);
    if (place != known.end() && place->corners == corners) {
      surface[place->id] = corners;
      owners[place->id] = topology.surfaceOwner[i];
    } else {
      surface.push_back(corners);
      owners.push_back(topology.surfaceOwner[i]);
    }
  }
  CountedVector<std::uint32_t> without;
  for (std::uint32_t id = 0; id < ids.size(); ++id)
    if (owners[id] == kNone) without.push_back(id);
  topology.surface = std::move(surface);
  topology.surfaceOwner = std::move(owners);
  return without;
}

CountedVector<std::uint32_t> tagsOfSurface(const TetrahedralTopology& topology,
                                           std::span<const std::uint32_t> tags) {
  CountedVector<std::uint32_t> ofSurface;
  if (tags.empty()) return ofSurface;
  ofSurface.reserve(topology.surfaceOwner.size());
  for (const std::uint32_t owner : topology.surfaceOwner)
    ofSurface.push_back(owner == kNoElement ? 0 : tags[owner]);
  return ofSurface;
}

}  // namespace palpate
