#include "CollisionDetection/GeometryCut.h"

#include "CollisionDetection/GeometryChecks.h"
#include "Bodies/InputChecks.h"
#include "Mesh/TetrahedraCut.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <utility>

namespace palpate {

static std::vector<std::uint32_t> idsFrom(std::size_t first, std::size_t count) {
  std::vector<std::uint32_t> ids(count);
  std::iota(ids.begin(), ids.end(), static_cast<std::uint32_t>(first));
  return ids;
}

GeometryCut::GeometryCut(Geometry& geometry, bool ofTetrahedra, const NewVertices& given)
    : m_geometry(geometry), m_verticesBefore(rest().size()), m_positions(given.positions.size()) {
  checkShapeMayChange(geometry, ofTetrahedra ? "replaceTetrahedra()" : "replaceTriangles()");
  checkMeshType(geometry.body, ofTetrahedra,
                ofTetrahedra ? "replaceTetrahedra() is for tetrahedral meshes"
                             : "replaceTriangles() is for triangle meshes");
  const auto check = [&](std::span<const Eigen::Vector3d> from, const char* which,
                         Eigen::Vector3d* out) {
    checkPositions(geometry, from, out, which, Threads(1), nullptr, nullptr, m_verticesBefore);
  };
  check(given.positions, "", m_positions.data());
  if (!given.rest.empty() && given.rest.size() != m_positions.size())
    throw Error(ErrorCode::WrongPositionCount,
                nameOf(geometry) + ": " + std::to_string(given.rest.size()) +
                    " positions at rest given for " + std::to_string(m_positions.size()) +
                    " new vertices",
                geometry.body.id);
  CountedVector<Eigen::Vector3d> newRest(m_positions.size());
  check(given.rest.empty() ? given.positions : given.rest, " at rest", newRest.data());
  reserveAmortized(rest(), m_verticesBefore + newRest.size());
  rest().insert(rest().end(), newRest.begin(), newRest.end());
}

std::vector<std::uint32_t> GeometryCut::replace(Ids removed, std::span<const Triangle> added,
                                                const Preparation& prepare) {
  const MeshTopology& topology = m_geometry.body.mesh.topology;
  const std::size_t count = topology.elements.size();
  const auto sorted = checkedRemoval(m_geometry, "triangle", count, topology.removed, removed);
  checkCounts(m_geometry, rest().size(), added, GeometryType::Triangles, count);
  auto ids = idsFrom(count, added.size());
  apply(sorted, added, prepare);
  return ids;
}

std::vector<std::uint32_t> GeometryCut::replace(Ids removed, std::span<const Tetrahedron> added,
                                                const Preparation& prepare) {
  Solid& solid = *m_geometry.body.solid;
  TriangleMesh& mesh = m_geometry.body.mesh;
  const std::size_t count = solid.topology.tetrahedra.size(), faces = mesh.topology.elements.size();
  const auto sorted =
      checkedRemoval(m_geometry, "tetrahedron", count, solid.topology.removed, removed);
  checkTetrahedra(m_geometry, rest().size(), added, count);
  auto ids = idsFrom(count, added.size());
  // A tetrahedron in a cut costs about as much as several triangles.
  if (!isLargeCut(4 * (sorted.size() + added.size()), count - solid.topology.removed.size()) &&
      TetrahedraCut::isPossible(solid.topology, rest(), added)) {
    TetrahedraCut ofSolid(solid.topology, rest(), sorted, added);
    if (ofSolid.fault()) refuse(m_geometry, *ofSolid.fault());
    if (!solid.tags.empty()) reserveAmortized(solid.tags, count + added.size());
    apply(ofSolid.goneFaces(), ofSolid.newFaces(), prepare);
    // Nothing below throws.
    ofSolid.apply();
    if (!solid.tags.empty()) {
      solid.tags.resize(count + added.size(), 0);
      const auto setTag = [&](std::uint32_t face) {
        mesh.tags[face] = solid.tags[solid.topology.surfaceOwner[face]];
      };
      for (const std::uint32_t face : ofSolid.passedFaces()) setTag(face);
      for (std::size_t face = faces; face < mesh.tags.size(); ++face)
        setTag(static_cast<std::uint32_t>(face));
    }
  } else {
    const Ids before = solid.topology.removed;
    CountedVector<std::uint32_t> allRemoved(before.size() + sorted.size());
    std::merge(before.begin(), before.end(), sorted.begin(), sorted.end(), allRemoved.begin());
    CountedVector<Tetrahedron> all;
    all.reserve(count + added.size());
    all.assign(solid.topology.tetrahedra.begin(), solid.topology.tetrahedra.end());
    all.insert(all.end(), added.begin(), added.end());
    TetrahedralTopology topology = checkedTopology(m_geometry, rest(), all, allRemoved);
    CountedVector<std::uint32_t> gone;
    for (const std::uint32_t face : keepSurfaceIds(mesh.topology.elements, topology))
      if (!mesh.topology.isRemoved(face)) gone.push_back(face);
    CountedVector<std::uint32_t> tags = solid.tags;
    if (!tags.empty()) tags.resize(count + added.size(), 0);
    CountedVector<std::uint32_t> ofSurface = tagsOfSurface(topology, tags);
    apply(gone, std::span(topology.surface).subspan(faces), prepare);
    // Nothing below throws.
    solid.topology = std::move(topology);
    solid.tags = std::move(tags);
    mesh.tags = std::move(ofSurface);
  }
  return ids;
}

void GeometryCut::apply(Ids removed, std::span<const Triangle> added, const Preparation& prepare) {
  Geometry& geometry = m_geometry;
  Body& body = geometry.body;
  TriangleMesh& mesh = body.mesh;
  const std::size_t count = mesh.topology.elements.size();
  SmallestHeight smallest = geometry.smallestHeight;
  const bool isLarge = isLargeCut(removed.size() + added.size(), mesh.topology.count());
  if (!isLarge) {
    for (const std::uint32_t t : removed)
      smallest.remove(heightOf(mesh.topology.elements[t], mesh.rest));
    for (const Triangle& t : added) smallest.add(heightOf(t, mesh.rest));
  }
  if (!mesh.tags.empty()) reserveAmortized(mesh.tags, count + added.size());
  // Where nothing else uses the positions, vertices are appended to them.
  const bool continues = geometry.pieces.isAt(geometry.step.detected());
  if (continues) geometry.pieces.forget();
  geometry.step.reserveCut(mesh, m_positions.size(), removed.size());
  body.tree.reserveCut(removed.size());
  CountedVector<std::pair<std::uint32_t, Triangle>> gone;
  gone.reserve(removed.size());
  for (const std::uint32_t t : removed) gone.push_back({t, mesh.topology.elements[t]});
  std::function<void(const EdgeChange&)> prepareEdges;
  if (prepare) prepareEdges = [&](const EdgeChange& change) { prepare(change, mesh.rest); };
  mesh.topology.cut(removed, added, mesh.rest.size(), prepareEdges);
  // Nothing below throws.
  m_isApplied = true;
  const ElementsState before = body.revisions.elements;
  if (!mesh.tags.empty()) mesh.tags.resize(mesh.topology.elements.size(), 0);
  geometry.smallestHeight =
      !isLarge && smallest.isKnown() ? smallest : smallestHeight(mesh.topology, mesh.rest);
  body.revisions.changeElements();
  std::array<std::pair<Revision, Revision>, 3> positions;
  const auto ends = [&] {
    return std::array{mesh.now.bodyRevision(), mesh.before.bodyRevision(),
                      geometry.step.detected().bodyRevision()};
  };
  const auto last = ends();
  geometry.step.cut(mesh, m_positions, before, count, body.revisions.elements, gone);
  const auto appended = ends();
  for (std::size_t i = 0; i < positions.size(); ++i) positions[i] = {last[i], appended[i]};
  body.tree.cut(removed, positions);
  if (continues) geometry.pieces.continueAt(geometry.step.detected());
  geometry.freeMotion.clear();
}

}  // namespace palpate
