#include "Mesh/TetrahedralTopology.h"

#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <algorithm>
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
CountedVector<std::uint32_t> opposites(std::span<const Tetrahedron> tetrahedra,
                                       std::optional<OverusedFace>& fault) {
  CountedVector<Face> faces;
  faces.reserve(4 * tetrahedra.size());
  for (std::uint32_t side = 0; side < 4 * tetrahedra.size(); ++side) {
    faces.push_back({faceOf(tetrahedra[side / 4], side % 4), side});
    std::sort(faces.back().vertices.begin(), faces.back().vertices.end());
  }
  std::sort(faces.begin(), faces.end(), [](const Face& l, const Face& r) {
    return l.vertices != r.vertices ? l.vertices < r.vertices : l.side < r.side;
  });
  CountedVector<std::uint32_t> beyond(faces.size(), kNone);
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
                                     std::span<const Tetrahedron> tetrahedra,
                                     std::span<const std::uint32_t> beyond) {
  CountedVector<bool> positive(tetrahedra.size()), known(tetrahedra.size());
  CountedVector<std::uint32_t> queue;
  SignCounts counts;
  for (std::uint32_t t = 0; t < tetrahedra.size(); ++t) {
    const auto& [a, b, c, d] = tetrahedra[t];
    const int sign = orient3d(rest[a], rest[b], rest[c], rest[d], counts);
    positive[t] = sign >= 0;
    known[t] = sign != 0;
    if (sign != 0) queue.push_back(t);
  }
  if (queue.size() == tetrahedra.size()) return positive;
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
                               std::optional<OverusedFace>& fault) {
  PALPATE_ASSERT(std::all_of(tetrahedra.begin(), tetrahedra.end(), [&](const Tetrahedron& t) {
    return *std::max_element(t.begin(), t.end()) < rest.size();
  }));
  const CountedVector<std::uint32_t> beyond = opposites(tetrahedra, fault);
  TetrahedralTopology topology{{tetrahedra.begin(), tetrahedra.end()}, {}, {}, {}};
  if (fault) return topology;
  topology.isPositive = findOrientations(rest, tetrahedra, beyond);
  for (std::uint32_t side = 0; side < beyond.size(); ++side) {
    if (beyond[side] != kNone) continue;
    Triangle& face = topology.surface.emplace_back(faceOf(tetrahedra[side / 4], side % 4));
    if (!topology.isPositive[side / 4]) std::swap(face[1], face[2]);
    topology.surfaceOwner.push_back(side / 4);
  }
  PALPATE_ASSERT(std::is_sorted(topology.surfaceOwner.begin(), topology.surfaceOwner.end()));
  return topology;
}

}  // namespace palpate
