#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/Frame.h"
#include "CollisionDetection/GeometryChecks.h"
#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairTable.h"
#include "CollisionDetection/Planning.h"
#include "CollisionDetection/SettingsCheck.h"
#include "CollisionDetection/StepSource.h"
#include "DistanceField/FieldContacts.h"
#include "Queries/QuerySource.h"
#include "Queries/SnapshotPool.h"
#include "NarrowPhase/Order.h"
#include "Bodies/InputChecks.h"
#include "Octree/Forest.h"
#include "Core/Assert.h"
#include "Core/FloatingPoint.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"
#include "Core/Text.h"

#include <algorithm>
#include <atomic>
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
  const PairKind kind = record.kind();
  if (kind != PairKind::Meshes)
    throw Error(ErrorCode::NotAvailable,
                nameOf(record.pair.a, record.pair.b) +
                    (kind == PairKind::Proxy   ? " uses Method::Proxy"
                     : kind == PairKind::Field ? " uses Method::DistanceField"
                                               : " includes a shape") +
                    " and has no candidate pairs",
                record.pair.a);
}

struct OctreeBasedCD::Implementation {
  class ChangeGuard;
  class QuerySource;
  class GuardSource;

  explicit Implementation(const Settings& newSettings);
  ~Implementation();

  Settings settings;
  const std::shared_ptr<MemoryBudget> budget;
  Threads threads, singleThread{1};
  GeometryTable geometries;
  PairTable pairs;
  Frame frame;
  FrameStatistics statistics;  ///< of the last frame or explicit update
  FrameStatistics updates;     ///< of the updates since the last frame
  bool hasUpdates = false;
  std::optional<LooseOctree> octree;
  std::vector<PairRecord*> selectedPairs;
  AuditRecord audit;
  std::shared_ptr<QuerySource> querySource;
  std::shared_ptr<GuardSource> guardSource;  ///< null before there is a StepGuard
  LatestSnapshot latestSnapshot;
  /// geometries.state() for which all octrees hold; 0: for none.
  std::atomic<std::uint64_t> octreesState = 0;
  std::mutex sorting;  ///< locked while candidatePairs(), a const call, sorts candidates
  PairOrderScratch sortingScratch;
  bool holdsSpare = false;           ///< there was a call since the last releaseMemory()
  std::atomic<bool> isBusy = false;  ///< a call that changes the object has not returned

  /// Adds the counts of geometries to the statistics, and makes them visible.
  void publish(FrameStatistics next) {
    next.geometries = next.triangles = next.segments = next.points = next.untestedVertices = 0;
    for (const auto& geometry : geometries.all()) {
      ++next.geometries;
      const MeshTopology& topology = geometry->body.mesh.topology;
      (topology.hasFaces()                    ? next.triangles
       : topology.type == GeometryType::Lines ? next.segments
                                              : next.points) += topology.triangles.size();
      next.untestedVertices += topology.untestedVertices;
    }
    next.memory = budget->now();
    next.peakMemory = budget->peak();
    statistics = next;
  }

  void releaseMemory();

  /// Calls a function that changes nothing if it throws. If it exceeds Settings::memoryLimit while
  /// memory is held that only earlier calls needed, that is given back, and it is called again.
  template <class F>
  auto withinLimit(F&& call) {
    for (;;) {
      const bool heldSpare = std::exchange(holdsSpare, true);
      try {
        return call();
      } catch (const Error& error) {
        if (error.code() != ErrorCode::MemoryLimit) throw;
        releaseMemory();
        if (!heldSpare) throw;
      }
    }
  }

  /// Updates the octrees. The next frame's statistics include updates for queries.
  /// records: pairs that are planned. explicitly: the user called update(). The statistics are
  /// published at once, and count as rebuilt or refitted only the trees that this call changed.
  /// detecting: plans include the motion of all pairs. Otherwise they include only the motion on
  /// which candidates depend.
  void update(bool explicitly = false, bool detecting = false) {
    update(pairs.records(), explicitly, detecting,
           markSkippedOctrees(detecting && octreesState != geometries.state()));
  }
  void update(std::span<const std::unique_ptr<PairRecord>> records, bool explicitly, bool detecting,
              bool skips) {
    const MemoryScope memory(MemoryStage::Octrees);
    using Update = LooseOctree::Update;
    octreesState = 0;
    state->trees.clear();  // they are invalid until the update is complete
    if (!hasUpdates) updates = {};
    const bool isFirst = explicitly || !std::exchange(hasUpdates, true);
    for (const auto& geometry : geometries.all()) {
      if (isFirst) geometry->body.tree.lastUpdate = Update::Unchanged;
      geometry->body.tree.setSwept(false);
      geometry->body.tree.boxMilliseconds = geometry->body.tree.octreeMilliseconds = 0;
    }
    Stopwatch watch;
    for (const auto& record : records) {
      planStep(*record, detecting, !settings.keepCandidates);
      if (record->plan.swept())
        for (Geometry* geometry : {record->a, record->b}) geometry->body.tree.setSwept(true);
    }
    updates.milliseconds.boxes += watch.lap();
    geometries.updateOctrees(settings.octree, threads);
    const double wall = watch.lap();
    double boxes = 0, octrees = 0;
    updates.rebuiltOctrees = updates.refittedOctrees = updates.unchangedOctrees = 0;
    for (const auto& geometry : geometries.all()) {
      const GeometryOctree& tree = geometry->body.tree;
      ++(tree.lastUpdate == Update::Rebuilt    ? updates.rebuiltOctrees
         : tree.lastUpdate == Update::Refitted ? updates.refittedOctrees
                                               : updates.unchangedOctrees);
      boxes += tree.boxMilliseconds;
      octrees += tree.octreeMilliseconds;
    }
    // Geometries are updated in parallel. The wall-clock time is therefore divided in proportion to
    // the work on boxes and on octrees.
    const double share = boxes + octrees > 0 ? boxes / (boxes + octrees) : 0;
    updates.milliseconds.boxes += wall * share;
    updates.milliseconds.octree += wall * (1 - share);
    updateOctreeView();
    if (!skips) octreesState = geometries.state();
#ifdef PALPATE_VALIDATE
    PALPATE_ASSERT(octree->validate().empty());
#endif
    if (explicitly) publish(updates);
  }

  bool needsNoOctree(const PairRecord& record) const {
    return record.kind() == PairKind::Proxy || (!settings.keepCandidates && mayUseLeaves(record));
  }

  /// A detection does not need the octrees of point sets of which all pairs use proxies. Queries
  /// update them later. Returns whether there are any.
  bool markSkippedOctrees(bool maySkip) {
    for (const auto& geometry : geometries.all()) geometry->skipsOctree = false;
    if (!maySkip) return false;
    for (const auto& record : pairs.records())
      if (needsNoOctree(*record)) record->a->skipsOctree = true;
    for (const auto& record : pairs.records()) {
      if (!needsNoOctree(*record)) record->a->skipsOctree = false;
      if (record->kind() != PairKind::Proxy) record->b->skipsOctree = false;
    }
    return std::any_of(geometries.all().begin(), geometries.all().end(),
                       [](const auto& geometry) { return geometry->skipsOctree; });
  }

  void updateOctreeView() {
    if (!state) {
      state = std::make_shared<LooseOctree::State>();
      octree.emplace(state);
    }
    state->trees.clear();
    std::uint32_t firstNode = 0;
    for (const auto& geometry : geometries.all()) {
      const GeometryOctree& tree = geometry->body.tree;
      if (geometry->skipsOctree || !tree.isValid() || tree.octree().size() == 0) continue;
      state->trees.push_back({geometry->body.id, &tree.octree(), tree.frame().origin,
                              tree.frame().scale, tree.lastUpdate, tree.bytesBesidesOctree(),
                              firstNode});
      firstNode += static_cast<std::uint32_t>(tree.octree().pool().used() * 8);
    }
  }

  /// Pairs whose result is outdated. Pairs that do not collide are not among them: their result is
  /// empty.
  std::span<PairRecord* const> outdatedPairs(PairRecord::Derived PairRecord::*version) {
    selectedPairs.clear();
    for (const auto& record : pairs.records())
      if (record->collides() && !((*record).*version).isCurrent(record->state()))
        selectedPairs.push_back(record.get());
    for (PairRecord* record : selectedPairs) record->candidatesVersion.invalidate();
    return selectedPairs;
  }

  /// Returns `singleThread` if one thread has refitted the octrees and few candidates are expected:
  /// other threads would wait for the data longer than they could help.
  const Threads& threadsFor(std::span<PairRecord* const> records) const {
    constexpr std::size_t kFew = 16384;
    std::size_t found = 0;
    for (const PairRecord* record : records) found += record->candidateCount;
    return geometries.wasUpdatedByOneThread() && found < kFew ? singleThread : threads;
  }

  void collect() {
    const MemoryScope memory(MemoryStage::Pairs);
    update();
    FrameStatistics next = updates;
    const auto records = outdatedPairs(&PairRecord::candidatesVersion);
    if (settings.engine == Engine::Octree) {
      frame.collect(records, threadsFor(records), next);
    } else {
      for (PairRecord* record : records) {
        if (record->hasCandidates())
          findCandidatesByBruteForce(record->meshes(), record->candidates);
        else
          record->candidates.clear();
        record->candidatesSorted = true;
        record->candidatesVersion.commit(record->state());
      }
    }
    for (const auto& record : pairs.records()) {
      if (!record->collides()) record->commitNoCandidates();
      next.candidatePairs += record->candidates.size();
    }
    publish(next);
    hasUpdates = false;
  }

  bool updateProxies(std::span<PairRecord* const> records) {
    const MemoryScope memory(MemoryStage::Octrees);
    bool built = false;
    for (PairRecord* record : records)
      if (record->kind() == PairKind::Proxy) built |= record->updateProxy(pairs.records(), threads);
    return built;
  }

  /// For a StepGuard. Results and statistics of the table's pairs stay as they are.
  void detect(const GuardedPairs& guarded) {
    const MemoryScope memory(MemoryStage::Pairs);
    update(guarded, false, true, markSkippedOctrees(false));
    FrameStatistics unused;
    selectedPairs.clear();
    for (const auto& record : guarded)
      if (record->collides() && !record->dataVersion.isCurrent(record->state()))
        selectedPairs.push_back(record.get());
    Settings withoutCandidates = settings;
    withoutCandidates.keepCandidates = false;
    if (settings.engine == Engine::Octree)
      frame.detect(selectedPairs, withoutCandidates, threads, unused);
    else
      frame.detectByBruteForce(selectedPairs, withoutCandidates, unused);
    for (PairRecord* record : selectedPairs) record->commit();
  }

  void detect() {
    const MemoryScope memory(MemoryStage::Pairs);
    update(false, true);
    for (const auto& record : pairs.records())
      if (!settings.keepCandidates) planByFieldIfProven(*record, settings.engine);
    FrameStatistics next = updates;
    const auto records = outdatedPairs(&PairRecord::dataVersion);
    for (const auto& record : pairs.records()) record->statistics = {};
    for (PairRecord* record : records)
      record->trust.start(record->pair.settings, record->a->inStep(), record->b->inStep(),
                          record->plan);
    Stopwatch watch;
    const bool built = updateProxies(records);
    if (built) next.milliseconds.octree += watch.lap();
    if (settings.engine == Engine::Octree)
      frame.detect(records, settings, threads, next);
    else
      frame.detectByBruteForce(records, settings, next);
    for (PairRecord* record : records) record->commit();
    for (const auto& record : pairs.records()) {
      if (!record->collides() && !record->dataVersion.isCurrent(record->state()))
        record->commitEmpty(settings.keepCandidates);
      const CollisionData& data = record->data;
      record->statistics.contacts = data.validity().atImpact + data.validity().atEnd;
      next.contacts += record->statistics.contacts;
      next.intersectingTriangles += data.intersectingTriangles().size();
    }
    for (const auto& geometry : geometries.all())
      geometry->step.recordDetection(geometry->body.mesh);
    publish(next);
    hasUpdates = false;
    auditFrame(settings, geometries, pairs, audit);
  }

  std::shared_ptr<LooseOctree::State> state;
};

namespace {

[[noreturn]] void throwMovedFrom() {
  throw Error(ErrorCode::InvalidCall, "this OctreeBasedCD was moved from: it has no geometries");
}

[[noreturn]] void throwBusy() {
  throw Error(ErrorCode::InvalidCall,
              "a predicate or callback must not call the OctreeBasedCD that calls it");
}

}  // namespace

/// Exists while a call that changes the object runs. Other calls are refused meanwhile, so that
/// callbacks cannot change data in use. It also sets the floating-point mode that the library
/// needs.
class OctreeBasedCD::Implementation::ChangeGuard {
 public:
  explicit ChangeGuard(const std::unique_ptr<Implementation>& all) : ChangeGuard(all.get()) {}
  explicit ChangeGuard(Implementation* all)
      : m_all(all), m_memory(m_all ? m_all->budget : nullptr, MemoryStage::Geometries) {
    if (!m_all) throwMovedFrom();
    if (m_all->isBusy.exchange(true, std::memory_order_relaxed)) throwBusy();
  }
  ~ChangeGuard() { m_all->isBusy.store(false, std::memory_order_relaxed); }
  ChangeGuard(const ChangeGuard&) = delete;
  ChangeGuard& operator=(const ChangeGuard&) = delete;
  Implementation* operator->() const { return m_all; }
  Implementation& operator*() const { return *m_all; }

 private:
  StandardFloatingPoint m_standard;
  Implementation* m_all;
  MemoryScope m_memory;
};

/// The geometries of an OctreeBasedCD, for queries that may outlive it.
class OctreeBasedCD::Implementation::QuerySource : public SpatialQueries::Source {
 public:
  explicit QuerySource(Implementation& all)
      : Source(std::make_shared<Pool>(all.budget)), m_all(&all) {}

  void close() { m_all = nullptr; }  ///< called when the OctreeBasedCD is destroyed
  /// Updates the octrees unless they are up to date with the positions now.
  void updateOctrees() {
    const auto lock = lockOctrees();
    const MemoryScope memory(budget(), MemoryStage::Octrees);
    if (m_all->octreesState != m_all->geometries.state()) m_all->update();
  }
  std::unique_lock<std::mutex> lockOctrees() { return std::unique_lock(m_octreesMutex); }

  std::uint64_t state() const override {
    if (!m_all) return 0;
    if (m_all->isBusy.load(std::memory_order_relaxed)) throwBusy();
    const std::uint64_t now = m_all->geometries.state();
    return m_all->octreesState == now ? now : 0;
  }
  const Body& at(GeometryId id) const override { return searchable(m_all->geometries.at(id).body); }
  std::size_t geometryCount() const override { return m_all->geometries.all().size(); }
  const Body& geometry(std::size_t index) const override {
    return m_all->geometries.all()[index]->body;
  }
  std::uint64_t step() const override { return m_all->geometries.stepNumber(); }
  Engine engine() const override { return m_all->settings.engine; }
  const OctreeSettings& octreeSettings() const override { return m_all->settings.octree; }
  const Threads& threads() const override { return m_all->threads; }

 private:
  Implementation* m_all;
  std::mutex m_octreesMutex;  ///< locked while octrees are updated
};

OctreeBasedCD::Implementation::Implementation(const Settings& newSettings)
    : settings(checked(newSettings)),
      budget(MemoryBudget::make(settings.memoryLimit)),
      threads(newSettings.threads, newSettings.executor),
      querySource(std::make_shared<QuerySource>(*this)),
      latestSnapshot(budget) {
  updateOctreeView();
}

/// The step of an OctreeBasedCD, for guards that may outlive it.
class OctreeBasedCD::Implementation::GuardSource : public StepSource {
 public:
  explicit GuardSource(Implementation& all) : m_all(&all) {}
  void close() { m_all = nullptr; }  ///< called when the OctreeBasedCD is destroyed

  void change(const std::function<void()>& call) override {
    read();
    const ChangeGuard all(m_all);
    all->withinLimit(call);
  }
  GeometryTable& geometries() const override { return read().geometries; }
  const PairTable& pairs() const override { return read().pairs; }
  const Threads& threads() const override { return read().threads; }
  void detect(const GuardedPairs& guarded) override { read().detect(guarded); }

 private:
  Implementation& read() const {
    if (!m_all)
      throw Error(ErrorCode::InvalidCall, "the OctreeBasedCD of this StepGuard was destroyed");
    return *m_all;
  }
  Implementation* m_all;
};

OctreeBasedCD::Implementation::~Implementation() {
  querySource->close();
  if (guardSource) guardSource->close();
}

void OctreeBasedCD::Implementation::releaseMemory() {
  frame = Frame();
  sortingScratch = {};
  for (const auto& geometry : geometries.all()) {
    geometry->body.tree.releaseMemory();
    geometry->step.releaseMemory();
  }
  for (const auto& record : pairs.records()) record->releaseMemory();
  querySource->releaseScratch();
  latestSnapshot.releaseMemory();
  holdsSpare = false;
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
  return all->withinLimit([&] { return all->geometries.add(positions, triangles); });
}

GeometryId OctreeBasedCD::addTetrahedralMesh(std::span<const Eigen::Vector3d> positions,
                                             std::span<const Tetrahedron> tetrahedra) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->withinLimit([&] { return all->geometries.add(positions, tetrahedra); });
}

GeometryId OctreeBasedCD::addLineMesh(std::span<const Eigen::Vector3d> positions,
                                      std::span<const Segment> segments, double radius) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->withinLimit([&] {
    return all->geometries.addLines(positions, segments, {&radius, 1});
  });
}

GeometryId OctreeBasedCD::addLineMesh(std::span<const Eigen::Vector3d> positions,
                                      std::span<const Segment> segments,
                                      std::span<const double> radii) {
  const Implementation::ChangeGuard all(m_implementation);
  checkOnePerVertex(all->geometries.nextId(), positions, radii);
  return all->withinLimit([&] { return all->geometries.addLines(positions, segments, radii); });
}

GeometryId OctreeBasedCD::addPointSet(std::span<const Eigen::Vector3d> positions, double radius) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->withinLimit([&] { return all->geometries.addPoints(positions, {&radius, 1}); });
}

GeometryId OctreeBasedCD::addPointSet(std::span<const Eigen::Vector3d> positions,
                                      std::span<const double> radii) {
  const Implementation::ChangeGuard all(m_implementation);
  checkOnePerVertex(all->geometries.nextId(), positions, radii);
  return all->withinLimit([&] { return all->geometries.addPoints(positions, radii); });
}

GeometryId OctreeBasedCD::addAnalyticalGeometry(const AnalyticalGeometry& geometry) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->withinLimit([&] { return all->geometries.add(geometry); });
}

GeometryId OctreeBasedCD::addDistanceField(std::shared_ptr<const DistanceField> field) {
  const Implementation::ChangeGuard all(m_implementation);
  return all->geometries.add(std::move(field));
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
  all->pairs.removeAllOf(geometry);
  all->geometries.remove(geometry);
  all->updateOctreeView();
}

void OctreeBasedCD::advance() {
  const Implementation::ChangeGuard all(m_implementation);
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

void OctreeBasedCD::setTransform(GeometryId geometry, const Eigen::Matrix3d& rotation,
                                 const Eigen::Vector3d& translation) {
  const Implementation::ChangeGuard all(m_implementation);
  all->pairs.checkRigid(all->geometries.at(geometry));
  all->geometries.setTransform(geometry, {}, {rotation, translation});
}

void OctreeBasedCD::setTransform(GeometryId geometry, const Eigen::Matrix3d& rotationBefore,
                                 const Eigen::Vector3d& translationBefore,
                                 const Eigen::Matrix3d& rotation,
                                 const Eigen::Vector3d& translation) {
  const Implementation::ChangeGuard all(m_implementation);
  all->pairs.checkRigid(all->geometries.at(geometry));
  all->geometries.setTransform(geometry, RigidTransform{rotationBefore, translationBefore},
                               {rotation, translation});
}

void OctreeBasedCD::setTriangles(GeometryId geometry, std::span<const Eigen::Vector3d> positions,
                                 std::span<const Triangle> triangles) {
  const Implementation::ChangeGuard all(m_implementation);
  IndexLists near;
  all->withinLimit([&] {
    all->geometries.setTriangles(
        geometry, positions, triangles, [&](const MeshTopology& topology, auto rest) {
          near = all->pairs.nearAtRest(geometry, topology, rest, all->threads);
        });
  });
  all->pairs.setNearAtRest(geometry, std::move(near));
}

void OctreeBasedCD::setTetrahedra(GeometryId geometry, std::span<const Eigen::Vector3d> positions,
                                  std::span<const Tetrahedron> tetrahedra) {
  const Implementation::ChangeGuard all(m_implementation);
  IndexLists near;
  all->withinLimit([&] {
    all->geometries.setTetrahedra(
        geometry, positions, tetrahedra, [&](const MeshTopology& topology, auto rest) {
          near = all->pairs.nearAtRest(geometry, topology, rest, all->threads);
        });
  });
  all->pairs.setNearAtRest(geometry, std::move(near));
}

TetrahedralSurface OctreeBasedCD::surface(GeometryId geometry) const {
  const Geometry& solid = read().geometries.at(geometry);
  checkMeshType(solid.body, true, "surface() is for tetrahedral meshes");
  return {solid.body.solid->topology.surface, solid.body.solid->topology.surfaceOwner};
}

Pose OctreeBasedCD::transform(GeometryId geometry) const {
  const RigidTransform& now = read().geometries.at(geometry).body.mesh.now.transform();
  return {now.rotation, now.translation};
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
  all->pairs.remove(all->geometries, a, b);
}

std::span<const CollisionPair> OctreeBasedCD::pairs() const { return read().pairs.pairs(); }

const PairSettings& OctreeBasedCD::pairSettings(GeometryId a, GeometryId b) const {
  const Implementation& all = read();
  return all.pairs.inOrder(all.geometries, a, b).pair.settings;
}

PairStatistics OctreeBasedCD::pairStatistics(GeometryId a, GeometryId b) const {
  const Implementation& all = read();
  return all.pairs.at(all.geometries, a, b).statistics;
}

bool OctreeBasedCD::contains(GeometryId geometry) const {
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
  all->withinLimit([&] { all->update(true); });
}

void OctreeBasedCD::collectCandidates() {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->collect(); });
}

void OctreeBasedCD::detectCollision() {
  const Implementation::ChangeGuard all(m_implementation);
  all->withinLimit([&] { all->detect(); });
}

void OctreeBasedCD::forEachCandidateBatch(const CollisionPair* only, BatchFunction function,
                                          void* context) {
  const Implementation::ChangeGuard all(m_implementation);
  const MemoryScope memory(MemoryStage::Pairs);
  std::vector<PairRecord*>& selectedPairs = all->selectedPairs;
  selectedPairs.clear();
  if (only) {
    selectedPairs.push_back(&all->pairs.at(all->geometries, only->a, only->b));
    checkCandidates(*selectedPairs.front());
  } else {
    for (const auto& record : all->pairs.records()) selectedPairs.push_back(record.get());
  }
  all->withinLimit([&] { all->update(); });
  std::erase_if(selectedPairs, [](const PairRecord* record) { return !record->collides(); });
  if (all->settings.engine == Engine::Octree)
    return all->frame.forEach(selectedPairs, all->threadsFor(selectedPairs), function, context);
  Buffer<ElementPair> candidates;
  for (const PairRecord* record : selectedPairs) {
    if (!record->hasCandidates()) continue;
    findCandidatesByBruteForce(record->meshes(), candidates);
    if (!candidates.empty()) function(context, record->pair, candidates);
  }
}

SpatialQueries OctreeBasedCD::queries() const {
  read();
  const StandardFloatingPoint standard;
  m_implementation->querySource->updateOctrees();
  return SpatialQueries(m_implementation->querySource);
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
  if (!record.hasData)
    throw Error(ErrorCode::NotAvailable,
                nameOf(*record.a, *record.b) + " has no results yet: call detectCollision() first",
                a);
  return record.data;
}

std::span<const ElementPair> OctreeBasedCD::candidatePairs(GeometryId a, GeometryId b) const {
  read();
  Implementation& all = *m_implementation;
  PairRecord& record = all.pairs.at(all.geometries, a, b);
  checkCandidates(record);
  if (!record.candidatesVersion.isValid())
    throw Error(ErrorCode::NotAvailable,
                nameOf(*record.a, *record.b) +
                    " has no candidates: call collectCandidates(), or set "
                    "Settings::keepCandidates before detectCollision()",
                a);
  const std::lock_guard lock(all.sorting);
  const MemoryScope memory(all.budget, MemoryStage::Pairs);
  if (!record.candidatesSorted)
    orderPairs(record.candidates, record.a->body.mesh.topology.triangles.size(),
               all.sortingScratch);
  record.candidatesSorted = true;
  return record.candidates;
}

const LooseOctree& OctreeBasedCD::octree() const { return *read().octree; }

const FrameStatistics& OctreeBasedCD::statistics() const { return read().statistics; }

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
