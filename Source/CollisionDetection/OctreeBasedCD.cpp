#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/GeometryChecks.h"
#include "CollisionDetection/OctreeBasedCDImplementation.h"
#include "DistanceField/FieldContacts.h"
#include "Bodies/InputChecks.h"
#include "Core/Stopping.h"
#include "Core/Text.h"
#include "Core/WholeFile.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <mutex>
#include <optional>
#include <span>
#include <utility>

namespace palpate {

namespace {

Eigen::AlignedBox3d boundsOf(const Geometry& geometry) {
  if (geometry.body.shape) return geometry.body.shape->now.bounds();
  if (geometry.body.isField())
    return PlacedField(*geometry.body.field, geometry.body.mesh.now).domain();
  const TriangleMesh& mesh = geometry.body.mesh;
  Eigen::AlignedBox3d box;
  for (std::uint32_t v = 0; v < mesh.now.size(); ++v) {
    const Eigen::Vector3d centre = mesh.now[v], margin = Eigen::Vector3d::Constant(mesh.radius(v));
    box.extend(Eigen::AlignedBox3d(centre - margin, centre + margin));
  }
  return box;
}

}  // namespace

void checkCandidates(const PairRecord& record) {
  const PairKind kind = record.support->kind;
  if (kind != PairKind::Meshes)
    throw Error(ErrorCode::NotAvailable,
                nameOf(record.pair.a, record.pair.b) +
                    (kind == PairKind::Proxy   ? " uses Method::Proxy"
                     : kind == PairKind::Field ? " uses Method::DistanceField"
                                               : " includes a shape") +
                    " and has no candidate pairs",
                record.pair.a);
}

const OctreeBasedCD::Implementation& OctreeBasedCD::read() const {
  if (!m_implementation) throwMovedFrom();
  if (m_implementation->isBusy.load(std::memory_order_relaxed)) throwBusy();
  return *m_implementation;
}

OctreeBasedCD::OctreeBasedCD(const Settings& settings)
    : m_implementation(std::make_unique<Implementation>(settings)) {}
OctreeBasedCD::OctreeBasedCD(OctreeBasedCD&&) noexcept = default;
OctreeBasedCD& OctreeBasedCD::operator=(OctreeBasedCD&&) noexcept = default;
OctreeBasedCD::~OctreeBasedCD() = default;

GeometryId OctreeBasedCD::addTriangleMesh(std::span<const Eigen::Vector3d> positions,
                                          std::span<const Triangle> triangles) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->add([&](const auto& build) { return build.triangles(positions, triangles); });
}

GeometryId OctreeBasedCD::addTetrahedralMesh(std::span<const Eigen::Vector3d> positions,
                                             std::span<const Tetrahedron> tetrahedra) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->add([&](const auto& build) { return build.tetrahedra(positions, tetrahedra); });
}

GeometryId ProblemGeometries::add(OctreeBasedCD& collisions,
                                  const CollisionProblem::Geometry& geometry) {
  const OctreeBasedCD::Implementation::ChangeGuard all(collisions.m_implementation);
  return all->add([&](const auto& build) { return build.problem(geometry); });
}

GeometryId OctreeBasedCD::addLineMesh(std::span<const Eigen::Vector3d> positions,
                                      std::span<const Segment> segments, double radius) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->add([&](const auto& build) {
    return build.lines(positions, segments, {&radius, 1});
  });
}

GeometryId OctreeBasedCD::addLineMesh(std::span<const Eigen::Vector3d> positions,
                                      std::span<const Segment> segments,
                                      std::span<const double> radii) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->add([&](const auto& build) {
    checkOnePerVertex(build.id(), positions, radii);
    return build.lines(positions, segments, radii);
  });
}

GeometryId OctreeBasedCD::addPointSet(std::span<const Eigen::Vector3d> positions, double radius) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->add([&](const auto& build) { return build.points(positions, {&radius, 1}); });
}

GeometryId OctreeBasedCD::addPointSet(std::span<const Eigen::Vector3d> positions,
                                      std::span<const double> radii) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->add([&](const auto& build) {
    checkOnePerVertex(build.id(), positions, radii);
    return build.points(positions, radii);
  });
}

GeometryId OctreeBasedCD::addAnalyticalGeometry(const AnalyticalGeometry& geometry) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->add([&](const auto& build) { return build.shape(geometry); });
}

GeometryId OctreeBasedCD::addDistanceField(std::shared_ptr<const DistanceField> field) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->add([&](const auto& build) { return build.field(field); });
}

void OctreeBasedCD::attachDistanceField(GeometryId mesh,
                                        std::shared_ptr<const DistanceField> field) {
  const Implementation::ChangeGuard all(m_implementation);
  all->geometries.at(mesh);
  all->pairs.checkFieldChange(mesh, field.get());
  all->geometries.attach(mesh, std::move(field));
}

void OctreeBasedCD::attachSurfaceProxy(GeometryId mesh,
                                       const std::optional<SurfaceProxySettings>& settings) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->geometries.attach(mesh, settings, all->threads); });
}

void OctreeBasedCD::removeGeometry(GeometryId geometry) {
  const Implementation::ChangeGuard all(m_implementation);
  all->geometries.at(geometry);
  // Nothing below throws.
  all->countCandidates();
  all->pairs.removeAllOf(geometry);
  all->geometries.remove(geometry);
  all->octrees.updateView();
}

void OctreeBasedCD::advance() {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->followSides(); });
  all->geometries.advance();
}

void OctreeBasedCD::setPositions(GeometryId geometry, std::span<const Eigen::Vector3d> now) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->geometries.setPositions(geometry, {}, now, all->threads); });
}

void OctreeBasedCD::setPositions(GeometryId geometry, std::span<const Eigen::Vector3d> before,
                                 std::span<const Eigen::Vector3d> now) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->geometries.setPositions(geometry, before, now, all->threads); });
}

void OctreeBasedCD::setSomePositions(GeometryId geometry, std::size_t first,
                                     std::span<const Eigen::Vector3d> now) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->geometries.setSomePositions(geometry, first, now, all->threads); });
}

void OctreeBasedCD::setTransform(GeometryId geometry, const Pose& now) {
  const Implementation::ChangeGuard all(m_implementation);
  all->pairs.checkRigid(all->geometries.at(geometry));
  all->geometries.setTransform(geometry, {}, now);
}

void OctreeBasedCD::setTransform(GeometryId geometry, const Pose& before, const Pose& now) {
  const Implementation::ChangeGuard all(m_implementation);
  all->pairs.checkRigid(all->geometries.at(geometry));
  all->geometries.setTransform(geometry, before, now);
}

void OctreeBasedCD::setTriangles(GeometryId geometry, std::span<const Eigen::Vector3d> positions,
                                 std::span<const Triangle> triangles) {
  const Implementation::ChangeGuard all(m_implementation);
  all->changeTopology<MeshTopology>(geometry, [&](const auto& prepare) {
    all->geometries.setTriangles(geometry, positions, triangles, prepare);
    return true;
  });
}

void OctreeBasedCD::setTetrahedra(GeometryId geometry, std::span<const Eigen::Vector3d> positions,
                                  std::span<const Tetrahedron> tetrahedra) {
  const Implementation::ChangeGuard all(m_implementation);
  all->changeTopology<MeshTopology>(geometry, [&](const auto& prepare) {
    all->geometries.setTetrahedra(geometry, positions, tetrahedra, prepare);
    return true;
  });
}

std::vector<std::uint32_t> OctreeBasedCD::replaceTriangles(
    GeometryId geometry, std::span<const std::uint32_t> removed, std::span<const Triangle> added,
    std::span<const Eigen::Vector3d> newPositions, std::span<const Eigen::Vector3d> rest) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->changeTopology<EdgeChange>(geometry, [&](const auto& prepare) {
    return all->geometries.cut(geometry, removed, added, {newPositions, rest}, prepare);
  });
}

std::vector<std::uint32_t> OctreeBasedCD::replaceTetrahedra(
    GeometryId geometry, std::span<const std::uint32_t> removed, std::span<const Tetrahedron> added,
    std::span<const Eigen::Vector3d> newPositions, std::span<const Eigen::Vector3d> rest) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->changeTopology<EdgeChange>(geometry, [&](const auto& prepare) {
    return all->geometries.cut(geometry, removed, added, {newPositions, rest}, prepare);
  });
}

std::span<const std::uint32_t> OctreeBasedCD::removedElements(GeometryId geometry) const {
  return read().geometries.at(geometry).body.mesh.topology.removed;
}

TetrahedralSurface OctreeBasedCD::surface(GeometryId geometry) const {
  const Geometry& solid = read().geometries.at(geometry);
  checkMeshType(solid.body, true, "surface() is for tetrahedral meshes");
  return {solid.body.solid->topology.surface, solid.body.solid->topology.surfaceOwner};
}

Pose OctreeBasedCD::transform(GeometryId geometry) const {
  return read().geometries.at(geometry).body.mesh.now.transform();
}

std::shared_ptr<StepSource> OctreeBasedCD::stepSource() {
  const Implementation::ChangeGuard all(m_implementation);
  if (!all->guardSource) all->guardSource = std::make_shared<Implementation::GuardSource>(*all);
  return all->guardSource;
}

void OctreeBasedCD::setName(GeometryId geometry, std::string name) {
  const Implementation::ChangeGuard all(m_implementation);
  all->geometries.setName(geometry, std::move(name));
}

const std::string& OctreeBasedCD::name(GeometryId geometry) const {
  return read().geometries.at(geometry).body.name;
}

void OctreeBasedCD::setCollisionFilter(GeometryId geometry, const CollisionFilter& filter) {
  const Implementation::ChangeGuard all(m_implementation);
  all->geometries.setFilter(geometry, filter);
}

void OctreeBasedCD::setDisabledElements(GeometryId geometry,
                                        std::span<const std::uint32_t> elements) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->geometries.setDisabled(geometry, elements); });
}

void OctreeBasedCD::setTags(GeometryId geometry, std::span<const std::uint32_t> perElement) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->geometries.setTags(geometry, perElement); });
}

std::span<const std::uint32_t> OctreeBasedCD::tags(GeometryId geometry) const {
  const Body& body = read().geometries.at(geometry).body;
  return body.solid ? body.solid->tags : body.mesh.tags;
}

void OctreeBasedCD::setContactPredicate(GeometryId a, GeometryId b, ContactPredicate predicate) {
  const Implementation::ChangeGuard all(m_implementation);
  all->pairs.setPredicate(all->geometries, a, b, std::move(predicate));
}

void OctreeBasedCD::addCollisionPair(GeometryId a, GeometryId b, const PairSettings& settings) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->pairs.add(all->geometries, a, b, settings, all->threads); });
}

void OctreeBasedCD::setPairSettings(GeometryId a, GeometryId b, const PairSettings& settings) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->pairs.set(all->geometries, a, b, settings, all->threads); });
}

void OctreeBasedCD::removeCollisionPair(GeometryId a, GeometryId b) {
  const Implementation::ChangeGuard all(m_implementation);
  all->countCandidates();
  all->pairs.remove(all->geometries, a, b);
}

std::span<const CollisionPair> OctreeBasedCD::pairs() const { return read().pairs.pairs(); }

const PairSettings& OctreeBasedCD::pairSettings(GeometryId a, GeometryId b) const {
  const Implementation& all = read();
  return all.pairs.inOrder(all.geometries, a, b).pair.settings;
}

PairStatistics OctreeBasedCD::pairStatistics(GeometryId a, GeometryId b) const {
  const Implementation& all = read();
  const StandardFloatingPoint standard;
  m_implementation->countCandidates();
  return all.pairs.at(all.geometries, a, b).found.statistics;
}

bool OctreeBasedCD::has(GeometryId geometry) const {
  return read().geometries.find(geometry) != nullptr;
}

std::size_t OctreeBasedCD::vertexCount(GeometryId geometry) const {
  return positions(geometry).size();
}

std::span<const Eigen::Vector3d> OctreeBasedCD::positions(GeometryId geometry) const {
  const Geometry& found = read().geometries.at(geometry);
  if (found.body.shape) return {};
  return found.body.mesh.now.body();
}

Eigen::AlignedBox3d OctreeBasedCD::bounds(GeometryId geometry) const {
  const Geometry& found = read().geometries.at(geometry);
  const StandardFloatingPoint standard;
  return boundsOf(found);
}

void OctreeBasedCD::update() {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->update(SceneOctrees::UpdateFor::User); });
}

void OctreeBasedCD::detectCollision() {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->detect(nullptr); });
}

bool OctreeBasedCD::detectCollision(std::chrono::microseconds budget) {
  if (!m_implementation) throwMovedFrom();
  // The first exception of a process takes 0.1 ms more than later ones.
  [[maybe_unused]] static const bool hasThrown = !endsInTime(throwOutOfTime);
  auto& [isCancelled, clock] = m_implementation->timed;
  const Deadline::Time start = Deadline::now(clock);
  const Implementation::ChangeGuard all(m_implementation);
  isCancelled = false;
  const Deadline deadline(Deadline::after(start, budget), isCancelled, clock);
  return all->withinLimit([&] { return all->detect(&deadline); });
}

void OctreeBasedCD::cancelDetection() const {
  if (!m_implementation) throwMovedFrom();
  m_implementation->timed.isCancelled.store(true, std::memory_order_relaxed);
}

void OctreeBasedCD::forEachCandidateBatch(const CollisionPair* only, BatchFunction function,
                                          void* context) {
  const Implementation::ChangeGuard all(m_implementation);
  const MemoryScope memory(MemoryStage::Pairs);
  const PairRecord* const record =
      only ? &all->pairs.at(all->geometries, only->a, only->b) : nullptr;
  if (record) checkCandidates(*record);
  all->withinLimit([&] { all->update(SceneOctrees::UpdateFor::Queries); });
  all->detection.forEachCandidateBatch(record, function, context);
}

std::vector<ElementPair> OctreeBasedCD::candidatePairs(GeometryId a, GeometryId b) {
  std::vector<ElementPair> pairs;
  forEachCandidate(a, b, [&](std::span<const ElementPair> batch) {
    pairs.insert(pairs.end(), batch.begin(), batch.end());
  });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

SpatialQueries OctreeBasedCD::queries() const {
  read();
  const StandardFloatingPoint standard;
  m_implementation->querySource->updateOctrees();
  return SpatialQueries::Source::queries(m_implementation->querySource);
}

void OctreeBasedCD::publish(double time) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] {
    all->querySource->updateOctrees();
    const MemoryScope memory(MemoryStage::Snapshots);
    all->latestSnapshot.publish(*all->querySource, time);
  });
}

std::shared_ptr<const Snapshot> OctreeBasedCD::latestSnapshot() const {
  if (!m_implementation) throwMovedFrom();
  return m_implementation->latestSnapshot.get();
}

const CollisionData& OctreeBasedCD::collisionData(GeometryId a, GeometryId b) const {
  const Implementation& all = read();
  const PairRecord& record = all.pairs.inOrder(all.geometries, a, b);
  if (!record.last.isThere)
    throw Error(ErrorCode::NotAvailable,
                nameOf(*record.a, *record.b) + " has no results yet: call detectCollision() first",
                a);
  return record.last.data;
}

void OctreeBasedCD::setUserData(GeometryId a, GeometryId b, const ContactKey& key,
                                std::uint64_t data) {
  const Implementation::ChangeGuard all(m_implementation);
  PairRecord& record = all->pairs.inOrder(all->geometries, a, b);
  const auto& tracker = record.memory.tracker.tracker;
  const bool isTracked = tracker && tracker->isTracked();
  if (!isTracked || !tracker->setUserData(CollisionData::Contents::of(record.last.data), key, data))
    throw Error(ErrorCode::NotAvailable,
                nameOf(*record.a, *record.b) +
                    (isTracked ? ": the last detection has no contact with this key"
                               : ": no detection has tracked contacts: "
                                 "PairSettings::trackContacts is not set"),
                a);
}

void OctreeBasedCD::setRememberedSides(GeometryId a, GeometryId b,
                                       std::span<const Crossing> sides) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] {
    PairRecord& record = all->pairs.inOrder(all->geometries, a, b);
    record.setSides(all->geometries.stepNumber(), sides);
  });
}

std::span<const double> OctreeBasedCD::freeMotion(GeometryId id) const {
  read();
  Implementation& all = *m_implementation;
  Geometry& geometry = all.geometries.at(id);
  if (geometry.freeMotion.size() == geometry.freeMotionCount()) return geometry.freeMotion;
  for (const auto& record : all.pairs.records())
    if (record->pair.settings.freeMotionReach > 0.0 && record->collides() &&
        (record->a == &geometry || record->b == &geometry))
      throw Error(ErrorCode::NotAvailable,
                  nameOf(geometry) + " has no free motion yet: call detectCollision() first", id);
  const std::lock_guard lock(all.filling);
  const MemoryScope memory(all.budget, MemoryStage::Results);
  geometry.unlimited.assign(geometry.freeMotionCount(), std::numeric_limits<double>::infinity());
  return geometry.unlimited;
}

const LooseOctree& OctreeBasedCD::octree() const {
  read();
  const StandardFloatingPoint standard;
  m_implementation->querySource->updateOctrees(true);
  return m_implementation->octrees.view();
}

const FrameStatistics& OctreeBasedCD::statistics() const {
  read();
  const StandardFloatingPoint standard;
  m_implementation->countCandidates();
  return m_implementation->statistics;
}

MemoryUse OctreeBasedCD::memoryUse() const {
  if (!m_implementation) throwMovedFrom();
  return m_implementation->budget->now();
}

void OctreeBasedCD::releaseMemory() {
  const Implementation::ChangeGuard all(m_implementation);
  all->releaseMemory();
  all->budget->startPeak();
}

const Settings& OctreeBasedCD::settings() const { return read().settings; }

void OctreeBasedCD::writeTrace(const std::filesystem::path& path) const {
  const Implementation& all = read();
  if (!all.trace)
    throw Error(ErrorCode::NotAvailable, "no frames are traced: Settings::traceFrames is 0");
  writeWholeFile(path, all.trace->json(), "the trace");
}

std::vector<std::byte> OctreeBasedCD::save() const { return read().save(); }

void OctreeBasedCD::restore(std::span<const std::byte> state) {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->restore(state); });
}

std::span<const AuditFailure> OctreeBasedCD::auditFailures() const { return read().audit.failures; }

CollisionProblem OctreeBasedCD::problem() const {
  const Implementation& all = read();
  const auto lock = all.querySource->lockOctrees();  // because an update also chooses methods
  const StandardFloatingPoint standard;
  return problemOf(all.settings, all.geometries, all.pairs);
}

CollisionData detectCollision(const TriangleMeshView& a, const TriangleMeshView& b,
                              const PairSettings& settings) {
  const SupportedPairs* const support =
      supportOf(settings.method, GeometryType::Triangles, GeometryType::Triangles, false);
  if (support && support->has(kNeedsStep))
    throw Error(ErrorCode::UnsupportedMethod,
                "Method::Continuous needs a step: use OctreeBasedCD and two sets of positions");
  OctreeBasedCD detection({.threads = 1});
  const GeometryId first = detection.addTriangleMesh(a.positions, a.triangles);
  const GeometryId second = detection.addTriangleMesh(b.positions, b.triangles);
  detection.addCollisionPair(first, second, settings);
  detection.detectCollision();
  return detection.collisionData(first, second);
}

}  // namespace palpate
