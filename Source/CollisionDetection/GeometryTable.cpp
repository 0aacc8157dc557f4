#include "CollisionDetection/GeometryTable.h"

#include "CollisionDetection/GeometryChecks.h"
#include "Bodies/InputChecks.h"
#include "Mesh/TetrahedraCut.h"
#include "Math/StableLength.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

namespace palpate {

namespace {

PlacedShape* shapeOf(Geometry& geometry) {
  return geometry.body.shape ? &*geometry.body.shape : nullptr;
}

/// L: infinity without area.
double heightOf(const Triangle& triangle, std::span<const Eigen::Vector3d> rest) {
  const auto& [i, j, k] = triangle;
  const Eigen::Vector3d &a = rest[i], &b = rest[j], &c = rest[k];
  const double area = (b - a).cross(c - a).norm();
  const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  return area > 0.0 ? area / longest : std::numeric_limits<double>::infinity();
}

/// Computed in the body's frame, so that it does not depend on the transform.
SmallestHeight smallestHeight(const MeshTopology& topology, std::span<const Eigen::Vector3d> rest) {
  SmallestHeight smallest;
  topology.forEachElement(
      [&](std::uint32_t t) { smallest.add(heightOf(topology.elements[t], rest)); });
  return smallest;
}

/// L: one edge in 16 is shorter; 0 without edges.
double shortEdge(const MeshTopology& topology, std::span<const Eigen::Vector3d> rest) {
  CountedVector<double> lengths;
  lengths.reserve(topology.edges.size());
  for (const auto& [i, j] : topology.edges) lengths.push_back(stableLength(rest[j] - rest[i]));
  if (lengths.empty()) return 0.0;
  const auto place = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 16);
  std::nth_element(lengths.begin(), place, lengths.end());
  return *place;
}

}  // namespace

void SmallestHeight::add(double height) {
  if (height < value) {
    value = height;
    count = 0;
  }
  count += height == value;
}

void SmallestHeight::remove(double height) {
  PALPATE_ASSERT(height >= value && (height > value || count > 0));
  count -= height == value;
}

GeometryId GeometryTable::nextId() const {
  if (m_nextId == 0xffffffffu)
    throw Error(ErrorCode::TooLarge, "no geometry id is left: 2^32 - 1 geometries were added");
  return GeometryId{m_nextId};
}

std::unique_ptr<Geometry> GeometryTable::make(CountedVector<Eigen::Vector3d> rest,
                                              MeshTopology topology) const {
  constexpr int kOfOneTable = 40;  // bits of revisions between two calls of restore()
  auto geometry =
      std::make_unique<Geometry>(nextId(), Revision::Counter(m_restores << kOfOneTable));
  auto body = std::make_shared<const CountedVector<Eigen::Vector3d>>(rest);
  TriangleMesh& mesh = geometry->body.mesh;
  mesh.rest = std::move(rest);
  mesh.topology = std::move(topology);
  geometry->step.start(mesh, std::move(body));
  geometry->smallestHeight = smallestHeight(mesh.topology, mesh.rest);
  geometry->shortEdge = shortEdge(mesh.topology, mesh.rest);
  BodyRevisions& revisions = geometry->body.revisions;
  for (Revision* revision :
       {&revisions.elements.topology, &revisions.elements.enabled, &revisions.filter})
    *revision = revisions.counter.next();
  return geometry;
}

GeometryId GeometryTable::add(std::unique_ptr<Geometry> geometry) {
  PALPATE_ASSERT(m_geometries.empty() || m_geometries.back()->body.id < geometry->body.id);
  m_geometries.push_back(std::move(geometry));
  ++m_nextId;
  ++m_state;
  return m_geometries.back()->body.id;
}

GeometryId GeometryTable::add(std::span<const Eigen::Vector3d> positions,
                              std::span<const Triangle> triangles, GeometryType type,
                              std::span<const double> radii) {
  const GeometryId id = nextId();
  checkCounts(id, positions.size(), triangles, type);
  checkRadii(id, radii);
  MeshTopology topology(positions.size(), triangles);
  topology.type = type;
  auto geometry = make(checkedRest(id, positions), std::move(topology));
  TriangleMesh& mesh = geometry->body.mesh;
  if (!radii.empty()) mesh.largestRadius = *std::max_element(radii.begin(), radii.end());
  if (radii.size() > 1) mesh.radii.assign(radii.begin(), radii.end());
  return add(std::move(geometry));
}

GeometryId GeometryTable::addLines(std::span<const Eigen::Vector3d> positions,
                                   std::span<const Segment> segments,
                                   std::span<const double> radii) {
  CountedVector<Triangle> triangles;
  triangles.reserve(segments.size());
  for (const auto& [p, q] : segments) triangles.push_back({p, q, q});
  return add(positions, triangles, GeometryType::Lines, radii);
}

GeometryId GeometryTable::addPoints(std::span<const Eigen::Vector3d> positions,
                                    std::span<const double> radii) {
  CountedVector<Triangle> triangles(positions.size());
  for (std::uint32_t i = 0; i < triangles.size(); ++i) triangles[i] = {i, i, i};
  return add(positions, triangles, GeometryType::Points, radii);
}

GeometryId GeometryTable::add(std::span<const Eigen::Vector3d> positions,
                              std::span<const Tetrahedron> tetrahedra) {
  const GeometryId id = nextId();
  CountedVector<Eigen::Vector3d> rest = checkedRest(id, positions);
  TetrahedralTopology solid = checkedTopology(id, rest, tetrahedra);
  MeshTopology topology(positions.size(), solid.surface);
  auto geometry = make(std::move(rest), std::move(topology));
  geometry->body.solid = std::make_unique<Solid>();
  geometry->body.solid->topology = std::move(solid);
  return add(std::move(geometry));
}

GeometryId GeometryTable::add(const CollisionProblem::Geometry& given) {
  const GeometryId id = nextId();
  const std::vector<Eigen::Vector3d>& positions = given.rest.empty() ? given.now : given.rest;
  if (given.type == GeometryType::Field) return add(given.field);
  if (given.analytical) return add(*given.analytical);
  if (given.radii.size() > 1) checkOnePerVertex(id, positions, given.radii);
  if (given.type == GeometryType::Points) return addPoints(positions, given.radii);
  if (given.type == GeometryType::Lines) {
    std::vector<Segment> segments;
    for (const auto& [p, q, _] : given.triangles) segments.push_back({p, q});
    return addLines(positions, segments, given.radii);
  }
  if (given.removed.empty() && given.removedTetrahedra.empty())
    return given.tetrahedra.empty() ? add(positions, std::span<const Triangle>(given.triangles))
                                    : add(positions, given.tetrahedra);
  CountedVector<Eigen::Vector3d> rest = checkedRest(id, positions);
  checkCounts(id, positions.size(), given.triangles, GeometryType::Triangles);
  const auto removed = checkedRemoval(id, "triangle", given.triangles.size(), {}, given.removed);
  MeshTopology topology(positions.size(), given.triangles, removed);
  std::unique_ptr<Solid> solid;
  if (!given.tetrahedra.empty()) {
    solid = std::make_unique<Solid>();
    solid->topology = checkedTopology(
        id, rest, given.tetrahedra,
        checkedRemoval(id, "tetrahedron", given.tetrahedra.size(), {}, given.removedTetrahedra));
    if (keepSurfaceIds(topology.elements, solid->topology) != topology.removed ||
        solid->topology.surface != topology.elements)
      throw Error(ErrorCode::InvalidSettings,
                  nameOf(id) + ": the triangles are not the surface of the tetrahedra", id);
  }
  auto geometry = make(std::move(rest), std::move(topology));
  geometry->body.solid = std::move(solid);
  return add(std::move(geometry));
}

GeometryId GeometryTable::add(const AnalyticalGeometry& analytical) {
  const GeometryId id = nextId();
  std::optional<std::size_t> element;
  if (const std::string fault = faultOf(analytical, element); !fault.empty())
    throw Error(ErrorCode::InvalidShape, nameOf(id) + ": " + fault, id, element);
  const PlacedShape shape(analytical);
  MeshTopology topology;
  topology.type = GeometryType::Shape;
  auto geometry =
      make({shape.now.corners().begin(), shape.now.corners().end()}, std::move(topology));
  geometry->body.mesh.rest.clear();
  geometry->body.shape = shape;
  geometry->step.startShape(shape.now);
  return add(std::move(geometry));
}

GeometryId GeometryTable::add(std::shared_ptr<const DistanceField> field) {
  const GeometryId id = nextId();
  if (!field) throw Error(ErrorCode::InvalidSettings, nameOf(id) + ": the field is null", id);
  static_cast<void>(field->isClosed());  // throws if it was moved from
  MeshTopology topology;
  topology.type = GeometryType::Field;
  auto geometry = make({}, std::move(topology));
  geometry->body.field = std::move(field);
  return add(std::move(geometry));
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

void GeometryTable::remove(GeometryId id) {
  const Geometry* geometry = &at(id);
  std::erase_if(m_geometries, [=](const auto& g) { return g.get() == geometry; });
  ++m_state;
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
  setTopology(geometry, checkedRest(geometry, positions), {positions.size(), triangles}, {},
              prepare);
  ++m_state;
}

void GeometryTable::setTetrahedra(GeometryId id, std::span<const Eigen::Vector3d> positions,
                                  std::span<const Tetrahedron> tetrahedra,
                                  const Preparation& prepare) {
  Geometry& geometry = at(id);
  checkShapeMayChange(geometry, "setTetrahedra()");
  checkMeshType(geometry.body, true, "setTetrahedra() is for tetrahedral meshes");
  CountedVector<Eigen::Vector3d> rest = checkedRest(geometry, positions);
  auto solid = std::make_unique<Solid>();
  solid->topology = checkedTopology(geometry, rest, tetrahedra);
  MeshTopology topology(positions.size(), solid->topology.surface);
  setTopology(geometry, std::move(rest), std::move(topology), std::move(solid), prepare);
  ++m_state;
}

void GeometryTable::setTopology(Geometry& geometry, CountedVector<Eigen::Vector3d> rest,
                                MeshTopology topology, std::unique_ptr<Solid> solid,
                                const Preparation& prepare) {
  auto body = std::make_shared<const CountedVector<Eigen::Vector3d>>(rest);
  if (prepare) prepare(topology, rest);
  const double shortest = shortEdge(topology, rest);
  // Nothing below throws.
  geometry.body.mesh.rest = std::move(rest);
  geometry.body.mesh.topology = std::move(topology);
  geometry.body.solid = std::move(solid);
  geometry.body.mesh.tags.clear();
  geometry.step.start(geometry.body.mesh, std::move(body));
  geometry.smallestHeight = smallestHeight(geometry.body.mesh.topology, geometry.body.mesh.rest);
  geometry.shortEdge = shortest;
  geometry.body.tree.forgetElements();
  geometry.body.revisions.elements.topology = geometry.body.revisions.counter.next();
  geometry.body.revisions.elements.enabled = geometry.body.revisions.counter.next();
  geometry.body.revisions.filter = geometry.body.revisions.counter.next();
  geometry.freeMotion.clear();
}

/// A change of topology that keeps what belongs to other elements.
struct GeometryTable::Cut {
  /// Checks the new vertices, and appends them to those at rest. If the cut is not applied, they
  /// are removed again.
  Cut(Geometry& newGeometry, const NewVertices& given)
      : geometry(newGeometry), verticesBefore(rest().size()), positions(given.positions.size()) {
    const auto check = [&](std::span<const Eigen::Vector3d> from, const char* which,
                           Eigen::Vector3d* out) {
      checkPositions(geometry, from, out, which, Threads(1), nullptr, nullptr, verticesBefore);
    };
    check(given.positions, "", positions.data());
    if (!given.rest.empty() && given.rest.size() != positions.size())
      throw Error(ErrorCode::WrongPositionCount,
                  nameOf(geometry) + ": " + std::to_string(given.rest.size()) +
                      " positions at rest given for " + std::to_string(positions.size()) +
                      " new vertices",
                  geometry.body.id);
    CountedVector<Eigen::Vector3d> newRest(positions.size());
    check(given.rest.empty() ? given.positions : given.rest, " at rest", newRest.data());
    reserveAmortized(rest(), verticesBefore + newRest.size());
    rest().insert(rest().end(), newRest.begin(), newRest.end());
  }
  Cut(const Cut&) = delete;
  Cut& operator=(const Cut&) = delete;
  ~Cut() {
    if (!isApplied) rest().resize(verticesBefore);
  }
  CountedVector<Eigen::Vector3d>& rest() const { return geometry.body.mesh.rest; }

  Geometry& geometry;
  const std::size_t verticesBefore;
  CountedVector<Eigen::Vector3d> positions;  ///< of the new vertices
  std::span<const std::uint32_t> removed{};  ///< triangles, ascending
  std::span<const Triangle> added{};
  bool isApplied = false;
};

namespace {

/// Those of a list, and after them the added elements.
template <class Element>
CountedVector<Element> joined(const CountedVector<Element>& before,
                              std::span<const Element> added) {
  CountedVector<Element> all;
  all.reserve(before.size() + added.size());
  all.assign(before.begin(), before.end());
  all.insert(all.end(), added.begin(), added.end());
  return all;
}
std::vector<std::uint32_t> idsFrom(std::size_t first, std::size_t count) {
  std::vector<std::uint32_t> ids(count);
  std::iota(ids.begin(), ids.end(), static_cast<std::uint32_t>(first));
  return ids;
}

}  // namespace

std::vector<std::uint32_t> GeometryTable::replaceTriangles(GeometryId id, Ids removed,
                                                           std::span<const Triangle> added,
                                                           const NewVertices& vertices,
                                                           const CutPreparation& prepare) {
  Geometry& geometry = at(id);
  checkShapeMayChange(geometry, "replaceTriangles()");
  checkMeshType(geometry.body, false, "replaceTriangles() is for triangle meshes");
  const TriangleMesh& mesh = geometry.body.mesh;
  const std::size_t count = mesh.topology.elements.size();
  Cut cut(geometry, vertices);
  const auto sorted = checkedRemoval(geometry, "triangle", count, mesh.topology.removed, removed);
  checkCounts(geometry, mesh.rest.size(), added, GeometryType::Triangles, count);
  auto ids = idsFrom(count, added.size());
  cut.removed = sorted;
  cut.added = added;
  apply(cut, prepare);
  ++m_state;
  return ids;
}

std::vector<std::uint32_t> GeometryTable::replaceTetrahedra(GeometryId id, Ids removed,
                                                            std::span<const Tetrahedron> added,
                                                            const NewVertices& vertices,
                                                            const CutPreparation& prepare) {
  Geometry& geometry = at(id);
  checkShapeMayChange(geometry, "replaceTetrahedra()");
  checkMeshType(geometry.body, true, "replaceTetrahedra() is for tetrahedral meshes");
  Solid& solid = *geometry.body.solid;
  TriangleMesh& mesh = geometry.body.mesh;
  const std::size_t count = solid.topology.tetrahedra.size(), faces = mesh.topology.elements.size();
  Cut cut(geometry, vertices);
  const auto sorted =
      checkedRemoval(geometry, "tetrahedron", count, solid.topology.removed, removed);
  checkTetrahedra(geometry, cut.rest().size(), added, count);
  auto ids = idsFrom(count, added.size());
  // A tetrahedron in a cut costs about as much as several triangles.
  if (!isLargeCut(4 * (sorted.size() + added.size()), count - solid.topology.removed.size()) &&
      TetrahedraCut::isPossible(solid.topology, cut.rest(), added)) {
    TetrahedraCut ofSolid(solid.topology, cut.rest(), sorted, added);
    if (ofSolid.fault()) refuse(geometry, *ofSolid.fault());
    if (!solid.tags.empty()) reserveAmortized(solid.tags, count + added.size());
    cut.removed = ofSolid.goneFaces();
    cut.added = ofSolid.newFaces();
    apply(cut, prepare);
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
    TetrahedralTopology topology =
        checkedTopology(geometry, cut.rest(), joined(solid.topology.tetrahedra, added), allRemoved);
    CountedVector<std::uint32_t> gone;
    for (const std::uint32_t face : keepSurfaceIds(mesh.topology.elements, topology))
      if (!mesh.topology.isRemoved(face)) gone.push_back(face);
    CountedVector<std::uint32_t> tags = solid.tags;
    if (!tags.empty()) tags.resize(count + added.size(), 0);
    CountedVector<std::uint32_t> ofSurface = tagsOfSurface(topology, tags);
    cut.removed = gone;
    cut.added = std::span(topology.surface).subspan(faces);
    apply(cut, prepare);
    // Nothing below throws.
    solid.topology = std::move(topology);
    solid.tags = std::move(tags);
    mesh.tags = std::move(ofSurface);
  }
  ++m_state;
  return ids;
}

void GeometryTable::apply(Cut& cut, const CutPreparation& prepare) {
  Geometry& geometry = cut.geometry;
  Body& body = geometry.body;
  TriangleMesh& mesh = body.mesh;
  const std::size_t count = mesh.topology.elements.size();
  SmallestHeight smallest = geometry.smallestHeight;
  const bool isLarge = isLargeCut(cut.removed.size() + cut.added.size(), mesh.topology.count());
  if (!isLarge) {
    for (const std::uint32_t t : cut.removed)
      smallest.remove(heightOf(mesh.topology.elements[t], mesh.rest));
    for (const Triangle& t : cut.added) smallest.add(heightOf(t, mesh.rest));
  }
  if (!mesh.tags.empty()) reserveAmortized(mesh.tags, count + cut.added.size());
  // Where nothing else uses the positions, vertices are appended to them.
  const bool continues = geometry.pieces.isAt(geometry.step.detected());
  if (continues) geometry.pieces.forget();
  geometry.step.reserveCut(mesh, cut.positions.size(), cut.removed.size());
  body.tree.reserveCut(cut.removed.size());
  CountedVector<std::pair<std::uint32_t, Triangle>> gone;
  gone.reserve(cut.removed.size());
  for (const std::uint32_t t : cut.removed) gone.push_back({t, mesh.topology.elements[t]});
  std::function<void(const EdgeChange&)> prepareEdges;
  if (prepare) prepareEdges = [&](const EdgeChange& change) { prepare(change, mesh.rest); };
  mesh.topology.cut(cut.removed, cut.added, mesh.rest.size(), prepareEdges);
  // Nothing below throws.
  cut.isApplied = true;
  const ElementsState before = body.revisions.elements;
  if (!mesh.tags.empty()) mesh.tags.resize(mesh.topology.elements.size(), 0);
  geometry.smallestHeight =
      !isLarge && smallest.isKnown() ? smallest : smallestHeight(mesh.topology, mesh.rest);
  BodyRevisions& revisions = body.revisions;
  for (Revision* revision :
       {&revisions.elements.topology, &revisions.elements.enabled, &revisions.filter})
    *revision = revisions.counter.next();
  std::array<std::pair<Revision, Revision>, 3> positions;
  const auto ends = [&] {
    return std::array{mesh.now.bodyRevision(), mesh.before.bodyRevision(),
                      geometry.step.detected().bodyRevision()};
  };
  const auto last = ends();
  geometry.step.cut(mesh, cut.positions, before, count, revisions.elements, gone);
  const auto appended = ends();
  for (std::size_t i = 0; i < positions.size(); ++i) positions[i] = {last[i], appended[i]};
  body.tree.cut(cut.removed, positions);
  if (continues) geometry.pieces.continueAt(geometry.step.detected());
  geometry.freeMotion.clear();
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

}  // namespace palpate
