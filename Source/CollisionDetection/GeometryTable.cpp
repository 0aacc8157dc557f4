#include "CollisionDetection/GeometryTable.h"

#include "CollisionDetection/GeometryChecks.h"
#include "CollisionDetection/RestoredGeometry.h"
#include "Bodies/InputChecks.h"
#include "Core/Assert.h"

#include <algorithm>
#include <utility>

namespace palpate {

/// Of one table: bits of revisions between two calls of restore().
constexpr int kRevisionsOfRestore = 40;

static PlacedShape* shapeOf(Geometry& geometry) {
  return geometry.body.shape ? &*geometry.body.shape : nullptr;
}

GeometryBuilder GeometryTable::builder() const {
  if (m_nextId == 0xffffffffu)
    throw Error(ErrorCode::TooLarge, "no geometry id is left: 2^32 - 1 geometries were added");
  return {GeometryId{m_nextId}, Revision::Counter(m_restores << kRevisionsOfRestore)};
}

GeometryBuilder GeometryTable::restorer(GeometryId id) const {
  return {id, Revision::Counter((m_restores + 1) << kRevisionsOfRestore)};
}

GeometryId GeometryTable::add(std::unique_ptr<Geometry> geometry) {
  PALPATE_ASSERT(m_geometries.empty() || m_geometries.back()->body.id < geometry->body.id);
  m_geometries.push_back(std::move(geometry));
  ++m_nextId;
  ++m_state;
  return m_geometries.back()->body.id;
}

void GeometryTable::attach(GeometryId id, std::shared_ptr<const DistanceField> field) {
  Geometry& geometry = at(id);
  if (field) checkAttachable(geometry, *field);
  geometry.body.field = std::move(field);
  geometry.body.revisions.field = geometry.body.revisions.counter.next();
  ++m_state;
}

void GeometryTable::attach(GeometryId id, const std::optional<SurfaceProxySettings>& settings,
                           const Threads& threads) {
  Geometry& geometry = at(id);
  std::shared_ptr<const SurfaceProxy> proxy;
  if (settings) {
    checkProxy(geometry, *settings);
    const auto& [reach, errorBound, cone] = *settings;
    proxy = std::make_shared<const SurfaceProxy>(geometry.body.mesh,
                                                 ProxySettings{reach, errorBound, cone}, threads);
  }
  geometry.proxy = std::move(proxy);
  geometry.proxySettings = settings.value_or(SurfaceProxySettings());
  geometry.body.revisions.field = geometry.body.revisions.counter.next();
  ++m_state;
}

void GeometryTable::setTransform(GeometryId id, const std::optional<Pose>& before,
                                 const Pose& now) {
  Geometry& geometry = at(id);
  // The positions in the body's frame, and the octree, stay as they are.
  geometry.step.setTransform(geometry, geometry.body.mesh, shapeOf(geometry), before, now);
  ++m_state;
}

void GeometryTable::restoreNow(Geometry& geometry, const Positions& now) noexcept {
  PALPATE_ASSERT(now.size() == geometry.body.mesh.now.size());
  geometry.step.restoreNow(geometry.body.mesh, shapeOf(geometry), now);
  ++m_state;
}

void GeometryTable::advance() noexcept {
  ++m_stepNumber;
  ++m_state;
  for (const auto& geometry : m_geometries) {
    geometry->step.advance(geometry->body.mesh, shapeOf(*geometry));
    geometry->motion.advance();
  }
}

Geometry* GeometryTable::find(GeometryId id) const {
  const auto found = std::lower_bound(m_geometries.begin(), m_geometries.end(), id,
                                      [](const auto& g, GeometryId i) { return g->body.id < i; });
  return found == m_geometries.end() || (*found)->body.id != id ? nullptr : found->get();
}

Geometry& GeometryTable::at(GeometryId id) const {
  if (Geometry* const found = find(id)) return *found;
  const bool removed = static_cast<std::uint32_t>(id) < m_nextId;
  throw Error(ErrorCode::UnknownGeometry,
              nameOf(id) + (removed ? " was removed" : " was never added"), id);
}

std::unique_ptr<Geometry> GeometryTable::remove(GeometryId id) {
  const auto place =
      std::find_if(m_geometries.begin(), m_geometries.end(),
                   [&, geometry = &at(id)](const auto& g) { return g.get() == geometry; });
  std::unique_ptr<Geometry> removed = std::move(*place);
  m_geometries.erase(place);
  ++m_state;
  return removed;
}

void GeometryTable::setPositions(GeometryId id,
                                 std::optional<std::span<const Eigen::Vector3d>> before,
                                 std::span<const Eigen::Vector3d> now, const Threads& threads) {
  Geometry& geometry = at(id);
  checkShapeMayChange(geometry, "setPositions()");
  if (before) checkPositionCount(geometry, before->size());
  checkPositionCount(geometry, now.size());
  std::optional<MotionRange> moved;
  geometry.step.setPositions(geometry, geometry.body.mesh, before, now, threads,
                             geometry.motion.shouldMeasure() ? &moved : nullptr);
  ++m_state;
  if (moved) geometry.motion.set(geometry, *moved);
}

void GeometryTable::setSomePositions(GeometryId id, std::size_t first,
                                     std::span<const Eigen::Vector3d> now, const Threads& threads) {
  Geometry& geometry = at(id);
  checkShapeMayChange(geometry, "setPositions()");
  checkPositionCount(geometry, first, now.size());
  if (now.empty()) return;
  geometry.step.setSomePositions(geometry, geometry.body.mesh, first, now, threads);
  ++m_state;
}

void GeometryTable::setTriangles(GeometryId id, std::span<const Eigen::Vector3d> positions,
                                 std::span<const Triangle> triangles, const Preparation& prepare) {
  Geometry& geometry = at(id);
  checkShapeMayChange(geometry, "setTriangles()");
  checkMeshType(geometry.body, false, "setTriangles() is for triangle meshes");
  checkCounts(geometry, positions.size(), triangles, GeometryType::Triangles);
  setElements(geometry, {checkedRest(geometry, positions), {positions.size(), triangles}}, prepare);
}

void GeometryTable::setTetrahedra(GeometryId id, std::span<const Eigen::Vector3d> positions,
                                  std::span<const Tetrahedron> tetrahedra,
                                  const Preparation& prepare) {
  Geometry& geometry = at(id);
  checkShapeMayChange(geometry, "setTetrahedra()");
  checkMeshType(geometry.body, true, "setTetrahedra() is for tetrahedral meshes");
  setElements(geometry, RestShape::ofTetrahedra(geometry, positions, tetrahedra), prepare);
}

void GeometryTable::setElements(Geometry& geometry, RestShape shape, const Preparation& prepare) {
  if (prepare) prepare(shape.topology, shape.rest);
  geometry.setElements(shape);
  ++m_state;
}

void GeometryTable::setName(GeometryId id, std::string name) {
  Body& body = at(id).body;
  checkName(body, name);
  body.name = std::move(name);
}

void GeometryTable::setFilter(GeometryId id, const CollisionFilter& filter) {
  Geometry& geometry = at(id);
  checkFilter(geometry, filter);
  geometry.filter = filter;
  geometry.body.mesh.outerSideOnly = filter.sidedness == Sidedness::Outer;
  geometry.body.revisions.filter = geometry.body.revisions.counter.next();
}

void GeometryTable::setDisabled(GeometryId id, std::span<const std::uint32_t> elements) {
  Geometry& geometry = at(id);
  checkShapeMayChange(geometry, "setDisabledElements()");
  checkElements(geometry, elements);
  geometry.body.mesh.topology.disable(elements);
  geometry.body.revisions.elements.enabled = geometry.body.revisions.counter.next();
  geometry.freeMotion.clear();
}

void GeometryTable::setTags(GeometryId id, std::span<const std::uint32_t> tags) {
  Geometry& geometry = at(id);
  Body& body = geometry.body;
  checkTags(body, tags.size());
  CountedVector<std::uint32_t> given(tags.begin(), tags.end());
  if (body.solid) {
    CountedVector<std::uint32_t> ofSurface = tagsOfSurface(body.solid->topology, given);
    // Nothing below throws.
    body.solid->tags = std::move(given);
    given = std::move(ofSurface);
  }
  body.mesh.tags = std::move(given);
  body.revisions.filter = body.revisions.counter.next();
}

void GeometryTable::restore(std::span<RestoredGeometry> all, std::uint32_t nextId,
                            std::uint64_t stepNumber) noexcept {
  PALPATE_ASSERT(m_geometries.capacity() >= all.size());
  for (RestoredGeometry& each : all) {
    each.apply();
    if (!each.made)
      for (auto& own : m_geometries)
        if (own.get() == each.geometry) each.made = std::move(own);
  }
  m_geometries.clear();
  for (RestoredGeometry& each : all) m_geometries.push_back(std::move(each.made));
  m_nextId = nextId;
  m_stepNumber = stepNumber;
  ++m_restores;
  ++m_state;
}

}  // namespace palpate
