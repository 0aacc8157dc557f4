#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/Audit.h"
#include "CollisionDetection/BruteForce.h"
#include "CollisionDetection/Containment.h"
#include "CollisionDetection/Embedding.h"
#include "CollisionDetection/FollowedExits.h"
#include "CollisionDetection/Frame.h"
#include "CollisionDetection/GeometryChecks.h"
#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/Order.h"
#include "CollisionDetection/PairTable.h"
#include "CollisionDetection/Problem.h"
#include "CollisionDetection/SettingsCheck.h"
#include "CollisionDetection/Stopwatch.h"
#include "Core/Assert.h"
#include "Core/FloatingPoint.h"
#include "Core/Text.h"
#include "Octree/Forest.h"

#include <algorithm>
#include <mutex>
#include <optional>
#include <span>

namespace palpate {

namespace {

void checkDifferent(GeometryId vertices, GeometryId body) {
  if (vertices == body)
    throw Error(ErrorCode::InvalidSettings, nameOf(body) + ": its own vertices lie on it", body);
}

}  // namespace

void checkCandidates(const PairRecord& record) {
  if (record.meshes().hasShape())
    throw Error(ErrorCode::NotAvailable, "a pair with a shape has no candidate pairs",
                record.pair.a);
}

struct OctreeBasedCD::Implementation {
  explicit Implementation(const Settings& newSettings)
      : settings(checked(newSettings)), threads(newSettings.threads) {
    showOctree();
  }

  Settings settings;
  Threads threads, one{1};
  GeometryTable geometries;
  PairTable pairs;
  Frame frame;
  Containment containment;
  FollowedExits exits;
  Embedding embedding;
  FrameStatistics statistics;
  std::optional<LooseOctree> octree;
  std::vector<PairRecord*> work;
  bool inFrame = false;
  std::vector<AuditFailure> auditFailures;
  std::uint64_t detections = 0;
  int auditFiles = 0;
  std::mutex sorting;  ///< of candidates, when a const query first asks for them
  PairOrderScratch sortingScratch;

  /// An update() before detectCollision() belongs to its frame.
  void startFrame() {
    if (inFrame) return;
    inFrame = true;
    statistics = {};
    for (const auto& geometry : geometries.all()) {
      ++statistics.geometries;
      const MeshTopology& topology = geometry->mesh.topology;
      (topology.hasFaces()                    ? statistics.triangles
       : topology.kind == GeometryKind::Lines ? statistics.segments
                                              : statistics.points) += topology.triangles.size();
      statistics.untestedVertices += topology.untestedVertices;
    }
  }

  void endFrame() {
    geometries.endFrame();
    inFrame = false;
  }

  /// Boxes and octrees for the positions now. What a frame's detection finds done by an explicit
  /// update() stays said.
  /// `detecting`: plans say how all pairs move; else only what candidates depend on.
  void update(bool explicitly = false, bool detecting = false) {
    using Update = LooseOctree::Update;
    const bool asked = !inFrame || explicitly;
    startFrame();
    for (const auto& geometry : geometries.all()) {
      if (asked) geometry->lastUpdate = Update::Unchanged;
      geometry->swept = false;
      geometry->boxMilliseconds = geometry->octreeMilliseconds = 0;
    }
    Stopwatch watch;
    for (const auto& record : pairs.records()) {
      const Method method = record->pair.settings.method;
      const bool moves = (detecting || method == Method::Auto) &&
                         (method == Method::Continuous || !record->meshes().hasShape());
      if (moves)
        for (Geometry* geometry : {record->a, record->b}) GeometryTable::updateMotion(*geometry);
      record->plan = planOf(record->pair.settings, *record->a, *record->b, moves);
      record->updateNear(record->pair.settings.restDistance);
      if (record->plan.swept()) record->a->swept = record->b->swept = true;
    }
    statistics.milliseconds.boxes += watch.lap();
    geometries.updateOctrees(settings.octree, threads);
    const double wall = watch.lap();
    double boxes = 0, octrees = 0;
    statistics.rebuiltOctrees = statistics.refittedOctrees = statistics.unchangedOctrees = 0;
    for (const auto& geometry : geometries.all()) {
      ++(geometry->lastUpdate == Update::Rebuilt    ? statistics.rebuiltOctrees
         : geometry->lastUpdate == Update::Refitted ? statistics.refittedOctrees
                                                    : statistics.unchangedOctrees);
      boxes += geometry->boxMilliseconds;
      octrees += geometry->octreeMilliseconds;
    }
    // Geometries are updated side by side: the wall clock is shared out as their work was.
    const double share = boxes + octrees > 0 ? boxes / (boxes + octrees) : 0;
    statistics.milliseconds.boxes += wall * share;
    statistics.milliseconds.octree += wall * (1 - share);
    showOctree();
#ifdef PALPATE_VALIDATE
    PALPATE_ASSERT(octree->validate().empty());
#endif
  }

  /// Before points are asked about.
  void updateFor(Geometry& body) {
    update();
    if (body.solid) updateTetrahedra(body, settings.octree, threads);
  }

  void showOctree() {
    if (!state) {
      state = std::make_shared<LooseOctree::State>();
      octree.emplace(state);
    }
    state->trees.clear();
    std::uint32_t firstNode = 0;
    for (const auto& geometry : geometries.all()) {
      if (geometry->octree.size() == 0) continue;
      const std::size_t bytes =
          (geometry->floats.capacity() + geometry->floatsBefore.capacity()) * sizeof(FloatPoint) +
          geometry->triangleMemory.bytes();
      state->trees.push_back({geometry->id, &geometry->octree, geometry->frame.origin,
                              geometry->frame.scale, geometry->lastUpdate, bytes, firstNode});
      firstNode += static_cast<std::uint32_t>(geometry->octree.pool().used() * 8);
    }
  }

  /// Pairs whose answer is not of the revisions now. Of those that do not collide it is nothing.
  template <class AnsweredFor>
  std::span<PairRecord* const> pairsToDo(AnsweredFor PairRecord::*answered) {
    work.clear();
    for (const auto& record : pairs.records()) {
      if ((*record).*answered == record->revisions()) continue;
      if (record->collides()) {
        work.push_back(record.get());
        continue;
      }
      record->clear();
      (*record).*answered = record->revisions();
      if (settings.keepCandidates) record->candidatesFor = record->revisions();
    }
    return work;
  }

  /// Where one thread has refitted the octrees and few pairs are to be expected, another would wait
  /// for the data longer than it could help.
  const Threads& threadsFor(std::span<PairRecord* const> records) const {
    constexpr std::size_t kFew = 16384;
    std::size_t found = 0;
    for (const PairRecord* record : records) found += record->found;
    return geometries.updatedAlone() && found < kFew ? one : threads;
  }

  void collect() {
    update();
    const auto records = pairsToDo(&PairRecord::candidatesFor);
    if (settings.engine == Engine::Octree) {
      frame.collect(records, threadsFor(records), statistics);
    } else {
      for (PairRecord* record : records) {
        findCandidatesByBruteForce(record->meshes(), record->candidates);
        record->candidatesFor = record->revisions();
        record->candidatesSorted = true;
      }
    }
    statistics.candidatePairs = 0;
    for (const auto& record : pairs.records())
      statistics.candidatePairs += record->candidates.size();
    endFrame();
  }

  void detect() {
    update(false, true);
    const auto records = pairsToDo(&PairRecord::dataFor);
    const std::uint64_t thisFrame = geometries.framesEnded() + 1;
    for (PairRecord* record : records)
      record->trust.start(record->pair.settings, *record->a, *record->b, thisFrame, record->plan);
    if (settings.engine == Engine::Octree)
      frame.detect(records, settings, threads, statistics);
    else
      frame.detectByBruteForce(records, settings, statistics);
    for (const auto& record : pairs.records()) {
      record->trust.keep(thisFrame);
      const CollisionData& data = record->data;
      statistics.contacts += data.validity().atImpact + data.validity().atEnd;
      statistics.intersectingTriangles += data.intersectingTriangles().size();
    }
    endFrame();
    auditFrame();
  }

  void auditFrame() {
    auditFailures.clear();
    ++detections;
    if (settings.audit.features == 0) return;
    for (const auto& record : pairs.records()) {
      if (!record->collides()) continue;
      const std::size_t first = auditFailures.size();
      audit(record->meshes(), record->pair, record->data, settings.audit, detections,
            auditFailures);
      const auto own = std::span(auditFailures).subspan(first);
      if (own.empty() || settings.audit.folder.empty()) continue;
      if (auditFiles < settings.audit.mostFiles) {
        keepProblem(problemOf(settings, geometries, pairs), settings.audit, own);
        auditFiles += !own.front().file.empty();
      } else {
        for (AuditFailure& failure : own)
          failure.fileError =
              "audit.mostFiles were written into \"" + settings.audit.folder.string() + "\" before";
      }
    }
  }

  std::shared_ptr<LooseOctree::State> state;
};

OctreeBasedCD::OctreeBasedCD(const Settings& settings)
    : m_implementation(std::make_unique<Implementation>(settings)) {}
OctreeBasedCD::OctreeBasedCD(OctreeBasedCD&&) noexcept = default;
OctreeBasedCD& OctreeBasedCD::operator=(OctreeBasedCD&&) noexcept = default;
OctreeBasedCD::~OctreeBasedCD() = default;

GeometryId OctreeBasedCD::addTriangleMesh(std::span<const Eigen::Vector3d> positions,
                                          std::span<const Triangle> triangles) {
  return m_implementation->geometries.add(positions, triangles);
}

GeometryId OctreeBasedCD::addTetrahedralMesh(std::span<const Eigen::Vector3d> positions,
                                             std::span<const Tetrahedron> tetrahedra) {
  const StandardFloatingPoint standard;
  return m_implementation->geometries.add(positions, tetrahedra);
}

GeometryId OctreeBasedCD::addLineMesh(std::span<const Eigen::Vector3d> positions,
                                      std::span<const Segment> segments, double radius) {
  return m_implementation->geometries.addLines(positions, segments, {&radius, 1});
}

GeometryId OctreeBasedCD::addLineMesh(std::span<const Eigen::Vector3d> positions,
                                      std::span<const Segment> segments,
                                      std::span<const double> radii) {
  checkOnePerVertex(positions, radii);
  return m_implementation->geometries.addLines(positions, segments, radii);
}

GeometryId OctreeBasedCD::addPointSet(std::span<const Eigen::Vector3d> positions, double radius) {
  return m_implementation->geometries.addPoints(positions, {&radius, 1});
}

GeometryId OctreeBasedCD::addPointSet(std::span<const Eigen::Vector3d> positions,
                                      std::span<const double> radii) {
  checkOnePerVertex(positions, radii);
  return m_implementation->geometries.addPoints(positions, radii);
}

GeometryId OctreeBasedCD::addAnalyticalGeometry(const AnalyticalGeometry& geometry) {
  const StandardFloatingPoint standard;
  return m_implementation->geometries.add(geometry);
}

void OctreeBasedCD::setTransform(GeometryId geometry, const Eigen::Matrix3d& rotation,
                                 const Eigen::Vector3d& translation) {
  const StandardFloatingPoint standard;
  m_implementation->geometries.at(geometry);
  m_implementation->pairs.checkRigid(geometry);
  m_implementation->geometries.setTransform(geometry, {rotation, translation});
}

void OctreeBasedCD::removeGeometry(GeometryId geometry) {
  m_implementation->geometries.at(geometry);
  m_implementation->pairs.removeAllOf(geometry);
  m_implementation->geometries.remove(geometry);
  m_implementation->exits.forget(geometry);
  m_implementation->showOctree();
}

void OctreeBasedCD::setPositions(GeometryId geometry, std::span<const Eigen::Vector3d> now) {
  m_implementation->geometries.setPositions(geometry, {}, now, m_implementation->threads);
}

void OctreeBasedCD::setPositions(GeometryId geometry, std::span<const Eigen::Vector3d> before,
                                 std::span<const Eigen::Vector3d> now) {
  m_implementation->geometries.setPositions(geometry, before, now, m_implementation->threads);
}

void OctreeBasedCD::setTriangles(GeometryId geometry, std::span<const Eigen::Vector3d> positions,
                                 std::span<const Triangle> triangles) {
  m_implementation->geometries.setTriangles(geometry, positions, triangles);
}

void OctreeBasedCD::setTetrahedra(GeometryId geometry, std::span<const Eigen::Vector3d> positions,
                                  std::span<const Tetrahedron> tetrahedra) {
  const StandardFloatingPoint standard;
  m_implementation->geometries.setTetrahedra(geometry, positions, tetrahedra);
}

TetrahedralSurface OctreeBasedCD::surface(GeometryId geometry) const {
  const Geometry& solid = m_implementation->geometries.at(geometry);
  checkTopologyKind(solid, true, "surface() is of tetrahedral meshes");
  return {solid.solid->surface, solid.solid->surfaceOwner};
}

void OctreeBasedCD::setCollisionFilter(GeometryId geometry, const CollisionFilter& filter) {
  m_implementation->geometries.setFilter(geometry, filter);
}

void OctreeBasedCD::setDisabledElements(GeometryId geometry,
                                        std::span<const std::uint32_t> elements) {
  m_implementation->geometries.setDisabled(geometry, elements);
}

void OctreeBasedCD::setContactPredicate(GeometryId a, GeometryId b, ContactPredicate predicate) {
  m_implementation->pairs.setPredicate(m_implementation->geometries, a, b, std::move(predicate));
}

void OctreeBasedCD::addCollisionPair(GeometryId a, GeometryId b, const PairSettings& settings) {
  const StandardFloatingPoint standard;
  m_implementation->pairs.add(m_implementation->geometries, a, b, settings);
}

void OctreeBasedCD::setPairSettings(GeometryId a, GeometryId b, const PairSettings& settings) {
  const StandardFloatingPoint standard;
  m_implementation->pairs.set(m_implementation->geometries, a, b, settings);
}

void OctreeBasedCD::removeCollisionPair(GeometryId a, GeometryId b) {
  m_implementation->pairs.remove(m_implementation->geometries, a, b);
}

std::span<const CollisionPair> OctreeBasedCD::pairs() const {
  return m_implementation->pairs.pairs();
}

void OctreeBasedCD::update() {
  const StandardFloatingPoint standard;
  m_implementation->update(true);
}

void OctreeBasedCD::collectCandidates() {
  const StandardFloatingPoint standard;
  m_implementation->collect();
}

void OctreeBasedCD::detectCollision() {
  const StandardFloatingPoint standard;
  m_implementation->detect();
}

void OctreeBasedCD::forEachCandidateBatch(const CollisionPair* only, BatchFunction function,
                                          void* context) {
  const StandardFloatingPoint standard;
  Implementation& all = *m_implementation;
  all.work.clear();
  if (only) {
    all.work.push_back(&all.pairs.at(all.geometries, only->a, only->b));
    checkCandidates(*all.work.front());
  } else {
    for (const auto& record : all.pairs.records()) all.work.push_back(record.get());
  }
  all.update();
  std::erase_if(all.work, [](const PairRecord* record) { return !record->collides(); });
  if (all.settings.engine == Engine::Octree)
    return all.frame.forEach(all.work, all.threadsFor(all.work), function, context);
  Buffer<TrianglePair> candidates;
  for (const PairRecord* record : all.work) {
    findCandidatesByBruteForce(record->meshes(), candidates);
    if (!candidates.empty()) function(context, record->pair, candidates);
  }
}

std::span<const InsideVertex> OctreeBasedCD::findInsideVertices(GeometryId vertices,
                                                                GeometryId body,
                                                                const InsideSettings& settings) {
  const StandardFloatingPoint standard;
  Implementation& all = *m_implementation;
  const Geometry& asked = all.geometries.at(vertices);
  Geometry& around = all.geometries.at(body);
  checkDifferent(vertices, body);
  checkInside(around, settings);
  all.updateFor(around);
  return all.containment.find(asked, around, settings, all.settings.engine, all.threads);
}

std::span<const FollowedVertex> OctreeBasedCD::followInsideVertices(GeometryId vertices,
                                                                    GeometryId body) {
  const StandardFloatingPoint standard;
  Implementation& all = *m_implementation;
  const auto inside = findInsideVertices(vertices, body);
  return all.exits.follow(all.geometries.at(vertices), all.geometries.at(body), inside,
                          all.settings.engine, all.threads);
}

std::span<const EmbeddedVertex> OctreeBasedCD::findEmbeddedVertices(GeometryId vertices,
                                                                    GeometryId body) {
  const StandardFloatingPoint standard;
  Implementation& all = *m_implementation;
  const Geometry& asked = all.geometries.at(vertices);
  Geometry& solid = all.geometries.at(body);
  checkDifferent(vertices, body);
  checkTopologyKind(solid, true, "findEmbeddedVertices() is for tetrahedral meshes");
  all.updateFor(solid);
  return all.embedding.find(asked, solid, all.settings.engine, all.threads);
}

std::optional<TetrahedronPoint> OctreeBasedCD::findTetrahedron(GeometryId body,
                                                               const Eigen::Vector3d& point) {
  const StandardFloatingPoint standard;
  Implementation& all = *m_implementation;
  Geometry& solid = all.geometries.at(body);
  checkTopologyKind(solid, true, "findTetrahedron() is for tetrahedral meshes");
  if (!point.allFinite())
    throw Error(ErrorCode::NonFinitePosition,
                nameOf(body) + ": a point to be found is " + textOf(point), body);
  all.updateFor(solid);
  return all.embedding.find(point, solid, all.settings.engine);
}

const CollisionData& OctreeBasedCD::collisionData(GeometryId a, GeometryId b) const {
  return m_implementation->pairs.inOrder(m_implementation->geometries, a, b).data;
}

std::span<const TrianglePair> OctreeBasedCD::candidatePairs(GeometryId a, GeometryId b) const {
  PairRecord& record = m_implementation->pairs.at(m_implementation->geometries, a, b);
  checkCandidates(record);
  if (record.candidatesFor == PairRecord::AnsweredFor{})
    throw Error(ErrorCode::NotAvailable,
                "candidates were not kept: call collectCandidates(), or set "
                "Settings::keepCandidates before detectCollision()",
                a);
  const std::lock_guard lock(m_implementation->sorting);
  if (!record.candidatesSorted)
    orderPairs(record.candidates, record.a->mesh.topology.triangles.size(),
               m_implementation->sortingScratch);
  record.candidatesSorted = true;
  return record.candidates;
}

const LooseOctree& OctreeBasedCD::octree() const { return *m_implementation->octree; }

const FrameStatistics& OctreeBasedCD::statistics() const { return m_implementation->statistics; }

const Settings& OctreeBasedCD::settings() const { return m_implementation->settings; }

std::span<const AuditFailure> OctreeBasedCD::auditFailures() const {
  return m_implementation->auditFailures;
}

CollisionProblem OctreeBasedCD::problem() const {
  const Implementation& all = *m_implementation;
  return problemOf(all.settings, all.geometries, all.pairs);
}

CollisionData detectCollision(const TriangleMeshView& a, const TriangleMeshView& b,
                              const PairSettings& settings) {
  if (settings.method == Method::Continuous)
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
