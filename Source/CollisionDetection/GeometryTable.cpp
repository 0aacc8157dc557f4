#include "CollisionDetection/GeometryTable.h"

#include "CollisionDetection/GeometryChecks.h"
#include "CollisionDetection/Stopwatch.h"
#include "Core/Assert.h"
#include "Geometry/TriangleBoxes.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace palpate {

namespace {

/// Below this many triangles a geometry is updated by one thread, beside others.
constexpr std::size_t kSmall = 16384;
/// Refitting fewer triangles in all, cores take longer to hand over data than to compute it.
constexpr std::size_t kSmallRefit = 24576;
constexpr std::size_t kGrain = 1024;
constexpr std::size_t kTrianglesPerGroup = 1024;  ///< for bounds, before there are nodes
constexpr std::size_t kGroupGrain = 128;
/// A refitted tree is rebuilt when its leaves have become this much larger in relation to their
/// triangles.
constexpr double kMostLoosening = 1.5;

/// Copied into memory that neither the step nor the last frame has. moved: as of checkPositions().
Positions::Body checkedBody(Geometry& geometry, std::span<const Eigen::Vector3d> positions,
                            const char* which, const Threads& threads,
                            const Eigen::Vector3d* before = nullptr, MotionRange* moved = nullptr) {
  const auto free = std::find_if(geometry.bodies.begin(), geometry.bodies.end(),
                                 [](const auto& body) { return body.use_count() <= 1; });
  PALPATE_ASSERT(free != geometry.bodies.end());
  if (!*free) *free = std::make_shared<std::vector<Eigen::Vector3d>>();
  (*free)->resize(positions.size());
  checkPositions(geometry.id, positions, (*free)->data(), which, threads, before, moved);
  if (geometry.isPlaced()) checkPlaceable(geometry.id, positions, ErrorCode::NonFinitePosition);
  return *free;
}

/// A step begins where the last frame ended, unless positions before were given since.
const Positions& nextStart(const Geometry& geometry) {
  if (!geometry.setThisFrame) return geometry.mesh.now;
  return geometry.beforeGiven ? geometry.lastFrame : geometry.mesh.before;
}

void startStep(Geometry& geometry) {
  geometry.mesh.before = nextStart(geometry);
  geometry.setThisFrame = true;
  geometry.beforeGiven = false;
}

void computeFloats(std::span<const Eigen::Vector3d> positions, const FloatFrame& frame,
                   Buffer<FloatPoint>& floats, const Threads& threads) {
  floats.resize(positions.size());
  threads.forChunks(positions.size(), kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
    toFloats(positions.subspan(from, to - from), frame, floats.data() + from);
  });
}

/// Boxes in the order of orderedTriangles, and those of the groups; in a new order these come
/// first.
void computeBoxes(Geometry& geometry, std::span<const std::uint32_t> groups, FloatBox* groupBoxes,
                  std::size_t grain, const Threads& threads, bool reordered = false) {
  const std::vector<Triangle>& triangles = geometry.mesh.topology.triangles;
  threads.forChunks(groups.size() - 1, grain, [&](std::size_t, std::size_t from, std::size_t to) {
    for (std::size_t i = groups[from]; reordered && i < groups[to]; ++i)
      geometry.orderedTriangles[i] = triangles[geometry.octree.order()[i]];
    triangleBoxes(geometry.floats.data(),
                  geometry.treeSwept ? geometry.floatsBefore.data() : nullptr,
                  geometry.orderedTriangles.data(), groups.subspan(from, to - from + 1),
                  geometry.octree.boxes(), groupBoxes + from);
  });
}

/// Boxes in the order of orderedTriangles, and the bounds of all.
FloatBox boundsOf(Geometry& geometry, const Threads& threads) {
  const std::size_t size = geometry.orderedTriangles.size(),
                    count = (size + kTrianglesPerGroup - 1) / kTrianglesPerGroup;
  geometry.boundsGroups.resize(count + 1);
  for (std::size_t i = 0; i <= count; ++i)
    geometry.boundsGroups[i] = static_cast<std::uint32_t>(std::min(i * kTrianglesPerGroup, size));
  geometry.boundsBoxes.resize(count);
  computeBoxes(geometry, geometry.boundsGroups, geometry.boundsBoxes.data(), 2, threads);
  FloatBox bounds;
  for (const FloatBox& box : geometry.boundsBoxes) bounds.add(box);
  return bounds;
}

void rebuild(Geometry& geometry, const OctreeSettings& settings, const Threads& threads) {
  Stopwatch watch;
  Octree& octree = geometry.octree;
  const std::vector<Triangle>& triangles = geometry.mesh.topology.triangles;
  if (!geometry.treeKnown) {
    octree.reset(triangles.size());
    geometry.orderedTriangles.reserve(triangles.size() + BoxArrays::kPadding);
    geometry.orderedTriangles.assign(triangles.begin(), triangles.end());
    geometry.treeKnown = true;
  }
  const FloatBox bounds = boundsOf(geometry, threads);
  geometry.boxMilliseconds += watch.lap();
  // Triangles in the old order are of no use any more: their memory is the keys'.
  auto* keys = reinterpret_cast<std::uint64_t*>(geometry.orderedTriangles.data());
  octree.build(bounds, geometry.spread * geometry.frame.scale, settings, keys, threads);
  geometry.octreeMilliseconds += watch.lap();
}

void fitBoxes(Geometry& geometry, const OctreeSettings& settings, const Threads& threads,
              bool rebuilt) {
  Stopwatch watch;
  computeBoxes(geometry, geometry.octree.groups(), geometry.octree.groupBoxes(), kGroupGrain,
               threads, rebuilt);
  geometry.boxMilliseconds += watch.lap();
  geometry.octree.fit(threads);
  if (settings.update == OctreeUpdate::Auto) geometry.octree.measureLooseness();
  geometry.octreeMilliseconds += watch.lap();
}

void updateOctree(Geometry& geometry, const OctreeSettings& settings, const Threads& threads) {
  using Update = LooseOctree::Update;
  geometry.treeRevision = geometry.revisionForTree();
  geometry.treeSwept = geometry.treeSweeps();
  Stopwatch watch;
  computeFloats(geometry.mesh.now.body(), geometry.frame, geometry.floats, threads);
  if (geometry.mesh.topology.triangles.empty()) {
    geometry.octree.reset(0);
    geometry.treeKnown = false;
    return;
  }
  if (geometry.treeSwept)
    computeFloats(geometry.mesh.before.body(), geometry.frame, geometry.floatsBefore, threads);
  geometry.boxMilliseconds += watch.lap();
  if (geometry.treeKnown && settings.update == OctreeUpdate::Auto) {
    fitBoxes(geometry, settings, threads, false);
    geometry.lastUpdate = Update::Refitted;
    if (geometry.octree.looseness() <= kMostLoosening * geometry.octree.leastLooseness()) return;
  }
  rebuild(geometry, settings, threads);
  fitBoxes(geometry, settings, threads, true);
  geometry.lastUpdate = Update::Rebuilt;
}

double smallestHeight(const TriangleMesh& mesh) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const auto& [i, j, k] : mesh.topology.triangles) {
    const Eigen::Vector3d &a = mesh.now[i], &b = mesh.now[j], &c = mesh.now[k];
    const double area = (b - a).cross(c - a).norm();
    const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
    if (area > 0.0) smallest = std::min(smallest, area / longest);
  }
  return smallest;
}

}  // namespace

std::string nameOf(GeometryId id) {
  return "geometry " + std::to_string(static_cast<std::uint32_t>(id));
}

std::string nameOf(GeometryKind kind) {
  constexpr const char* kNames[] = {"a triangle mesh", "a line mesh", "a point set", "a shape"};
  return kNames[static_cast<std::size_t>(kind)];
}

GeometryId GeometryTable::nextId() const {
  if (m_nextId == 0xffffffffu)
    throw Error(ErrorCode::TooLarge, "no geometry ids are left: 2^32 - 1 were given out");
  return GeometryId{m_nextId};
}

Geometry& GeometryTable::add(std::vector<Eigen::Vector3d> rest, MeshTopology topology) {
  auto geometry = std::make_unique<Geometry>();
  geometry->id = nextId();
  TriangleMesh& mesh = geometry->mesh;
  mesh.rest = std::move(rest);
  mesh.before = mesh.now = mesh.rest;
  mesh.topology = std::move(topology);
  geometry->smallestHeight = smallestHeight(mesh);
  m_geometries.push_back(std::move(geometry));
  ++m_nextId;
  return *m_geometries.back();
}

GeometryId GeometryTable::add(std::span<const Eigen::Vector3d> positions,
                              std::span<const Triangle> triangles, GeometryKind kind,
                              std::span<const double> radii) {
  const GeometryId id = nextId();
  checkCounts(id, positions, triangles, kind);
  checkRadii(id, radii);
  MeshTopology topology(positions.size(), triangles);
  topology.kind = kind;
  TriangleMesh& mesh = add(checkedRest(id, positions), std::move(topology)).mesh;
  if (!radii.empty()) mesh.largestRadius = *std::max_element(radii.begin(), radii.end());
  if (radii.size() > 1) mesh.radii.assign(radii.begin(), radii.end());
  return id;
}

GeometryId GeometryTable::addLines(std::span<const Eigen::Vector3d> positions,
                                   std::span<const Segment> segments,
                                   std::span<const double> radii) {
  std::vector<Triangle> triangles;
  triangles.reserve(segments.size());
  for (const auto& [p, q] : segments) triangles.push_back({p, q, q});
  return add(positions, triangles, GeometryKind::Lines, radii);
}

GeometryId GeometryTable::addPoints(std::span<const Eigen::Vector3d> positions,
                                    std::span<const double> radii) {
  std::vector<Triangle> triangles(positions.size());
  for (std::uint32_t i = 0; i < triangles.size(); ++i) triangles[i] = {i, i, i};
  return add(positions, triangles, GeometryKind::Points, radii);
}

GeometryId GeometryTable::add(std::span<const Eigen::Vector3d> positions,
                              std::span<const Tetrahedron> tetrahedra) {
  const GeometryId id = nextId();
  std::vector<Eigen::Vector3d> rest = checkedRest(id, positions);
  TetrahedralTopology solid = checkedTopology(id, rest, tetrahedra);
  MeshTopology topology(positions.size(), solid.surface);
  add(std::move(rest), std::move(topology)).solid = std::move(solid);
  return id;
}

GeometryId GeometryTable::add(const AnalyticalGeometry& analytical) {
  std::optional<std::size_t> element;
  if (const std::string fault = faultOf(analytical, element); !fault.empty())
    throw Error(ErrorCode::InvalidShape, nameOf(GeometryId{m_nextId}) + ": " + fault,
                GeometryId{m_nextId}, element);
  // All that may fail comes first: a shape is there whole or not at all.
  std::optional<Shape> shape(std::in_place, analytical, RigidTransform{}), before = shape;
  AnalyticalGeometry measures = analytical;
  const auto corners = shape->corners();
  const Positions positions(std::vector<Eigen::Vector3d>(corners.begin(), corners.end()));
  const GeometryId id = add({}, {}, GeometryKind::Shape);
  TriangleMesh& mesh = m_geometries.back()->mesh;
  mesh.analytical = std::move(measures);
  mesh.shape = std::move(shape);
  mesh.shapeBefore = std::move(before);
  mesh.before = mesh.now = positions;
  return id;
}

void GeometryTable::setTransform(GeometryId id, const RigidTransform& transform) {
  Geometry& geometry = at(id);
  TriangleMesh& mesh = geometry.mesh;
  if (const std::string fault = faultOf(transform); !fault.empty())
    throw Error(ErrorCode::InvalidTransform, nameOf(id) + ": " + fault, id);
  if (!(transform.translation.cwiseAbs().maxCoeff() <= kLargestPlaced))
    throw Error(ErrorCode::InvalidTransform, nameOf(id) + ": the translation is beyond 2^1000", id);
  if (!geometry.isPlaced()) checkPlaceable(id, mesh.now.body(), ErrorCode::InvalidTransform);
  // The body stays as it is: only where it is read from changes.
  if (!geometry.setThisFrame) startStep(geometry);
  geometry.revision += !geometry.isPlaced() || !(mesh.now.transform() == transform);
  ++geometry.stepRevision;
  mesh.now.place(transform);
  if (!geometry.hasLastFrame && !geometry.beforeGiven) mesh.before = mesh.now;
  if (!mesh.shape) return;
  mesh.shape->place(*mesh.analytical, transform);
  mesh.shapeBefore->place(*mesh.analytical, mesh.before.transform());
}

Geometry& GeometryTable::at(GeometryId id) {
  const auto found = std::lower_bound(m_geometries.begin(), m_geometries.end(), id,
                                      [](const auto& g, GeometryId i) { return g->id < i; });
  if (found == m_geometries.end() || (*found)->id != id) {
    const bool removed = static_cast<std::uint32_t>(id) < m_nextId;
    throw Error(ErrorCode::UnknownGeometry,
                nameOf(id) + (removed ? " was removed" : " was never added"), id);
  }
  return **found;
}

void GeometryTable::remove(GeometryId id) {
  const Geometry* geometry = &at(id);
  std::erase_if(m_geometries, [=](const auto& g) { return g.get() == geometry; });
}

void GeometryTable::setPositions(GeometryId id,
                                 std::optional<std::span<const Eigen::Vector3d>> before,
                                 std::span<const Eigen::Vector3d> now, const Threads& threads) {
  Geometry& geometry = at(id);
  TriangleMesh& mesh = geometry.mesh;
  if (before) checkPositionCount(geometry, before->size());
  checkPositionCount(geometry, now.size());
  const auto start = before ? checkedBody(geometry, *before, " before", threads) : nullptr;
  // Where it was asked for last time, and all vertices have their positions from here.
  const Positions& last = nextStart(geometry);
  const bool asked = geometry.motionRevision == geometry.stepRevision && geometry.hasLastFrame &&
                     !geometry.isPlaced() && !last.isPlaced();
  const Eigen::Vector3d* const from = !asked ? nullptr : (start ? *start : last.body()).data();
  MotionRange motion;
  const auto end = checkedBody(geometry, now, before ? " now" : "", threads, from, &motion);
  const bool moved = before || (!now.empty() && std::memcmp(now.data(), mesh.now.body().data(),
                                                            now.size_bytes()) != 0);
  startStep(geometry);
  if (before) {
    geometry.lastFrame = mesh.before;
    geometry.beforeGiven = true;
    mesh.before.setBody(start);
  }
  mesh.now.setBody(end);
  if (!before && !geometry.hasLastFrame) mesh.before = mesh.now;
  geometry.revision += moved;
  geometry.bodyRevision += moved;
  ++geometry.stepRevision;
  ++geometry.bodyStepRevision;
  if (!asked) return;
  geometry.motion = motion;
  geometry.movedRevision = geometry.stepRevision;
}

void GeometryTable::setTriangles(GeometryId id, std::span<const Eigen::Vector3d> positions,
                                 std::span<const Triangle> triangles) {
  Geometry& geometry = at(id);
  checkTopologyKind(geometry, false, "setTriangles() is for triangle meshes");
  checkCounts(id, positions, triangles, GeometryKind::Triangles);
  setTopology(geometry, checkedRest(id, positions), {positions.size(), triangles});
}

void GeometryTable::setTetrahedra(GeometryId id, std::span<const Eigen::Vector3d> positions,
                                  std::span<const Tetrahedron> tetrahedra) {
  Geometry& geometry = at(id);
  checkTopologyKind(geometry, true, "setTetrahedra() is for tetrahedral meshes");
  std::vector<Eigen::Vector3d> rest = checkedRest(id, positions);
  TetrahedralTopology solid = checkedTopology(id, rest, tetrahedra);
  setTopology(geometry, std::move(rest), {positions.size(), solid.surface});
  geometry.solid = std::move(solid);
  geometry.tetrahedronTree.forget();
}

void GeometryTable::setTopology(Geometry& geometry, std::vector<Eigen::Vector3d> rest,
                                MeshTopology topology) {
  if (geometry.isPlaced()) checkPlaceable(geometry.id, rest, ErrorCode::NonFinitePosition);
  geometry.mesh.now.setBody(std::make_shared<const std::vector<Eigen::Vector3d>>(rest));
  geometry.mesh.before = geometry.mesh.now;
  geometry.mesh.rest = std::move(rest);
  geometry.mesh.topology = std::move(topology);
  geometry.setThisFrame = true;
  geometry.hasLastFrame = geometry.beforeGiven = false;
  geometry.treeKnown = false;
  geometry.smallestHeight = smallestHeight(geometry.mesh);
  for (auto* revision : {&geometry.revision, &geometry.stepRevision, &geometry.bodyRevision,
                         &geometry.topologyRevision, &geometry.restRevision})
    ++*revision;
}

void GeometryTable::setFilter(GeometryId id, const CollisionFilter& filter) {
  Geometry& geometry = at(id);
  if (filter.sidedness != Sidedness::Both && filter.sidedness != Sidedness::Outer)
    throw Error(ErrorCode::InvalidSettings, nameOf(id) + ": sidedness must be Both or Outer", id);
  if (filter.sidedness == Sidedness::Outer && !geometry.mesh.topology.hasFaces())
    throw Error(ErrorCode::InvalidSettings,
                nameOf(id) + " is " + nameOf(geometry.mesh.topology.kind) + ", which has no sides",
                id);
  geometry.filter = filter;
  geometry.mesh.outer = filter.sidedness == Sidedness::Outer;
  ++geometry.revision;
  ++geometry.stepRevision;
}

void GeometryTable::setDisabled(GeometryId id, std::span<const std::uint32_t> elements) {
  Geometry& geometry = at(id);
  MeshTopology& topology = geometry.mesh.topology;
  for (const std::uint32_t element : elements)
    if (element >= topology.triangles.size())
      throw Error(ErrorCode::IndexOutOfRange,
                  nameOf(id) + ": element " + std::to_string(element) +
                      " is out of range; it has " + std::to_string(topology.triangles.size()),
                  id, element);
  topology.disable(elements);
  ++geometry.revision;
  ++geometry.stepRevision;
  ++geometry.topologyRevision;
}

void GeometryTable::updateMotion(Geometry& geometry) {
  if (geometry.motionRevision == geometry.stepRevision) return;
  geometry.motionRevision = geometry.stepRevision;
  const TriangleMesh& mesh = geometry.mesh;
  if (geometry.isPlaced() && mesh.now.hasSameBody(mesh.before))
    geometry.motion = rigidMotion(geometry);
  else if (geometry.movedRevision != geometry.stepRevision)
    geometry.motion = motionRange(mesh.before, mesh.now);
  geometry.arcDeviation = arcDeviation(geometry);
  geometry.correction = geometry.hasLastFrame && geometry.beforeGiven
                            ? motionRange(geometry.lastFrame, mesh.before)
                            : MotionRange{};
}

void GeometryTable::updateOctrees(const OctreeSettings& settings, const Threads& threads) {
  double spread = 0;
  for (const auto& geometry : m_geometries) {
    if (!geometry->treeIsNow()) {
      const SampledExtent extent = sampleExtent(geometry->mesh.now.body());
      geometry->frame.origin = extent.median;
      geometry->spread = extent.spread;
    }
    spread = std::max(spread, geometry->spread);
  }
  const double scale = frameScale(spread);
  m_changed.clear();
  for (const auto& geometry : m_geometries) {
    if (geometry->treeIsNow() && geometry->frame.scale == scale) continue;
    geometry->frame.scale = scale;
    m_changed.push_back(geometry.get());
  }
  // Side by side, the largest first, and a large one's work is shared too: what one does alone is
  // hidden by another.
  const auto size = [](const Geometry* geometry) {
    return geometry->mesh.topology.triangles.size();
  };
  std::sort(m_changed.begin(), m_changed.end(), [&](const Geometry* l, const Geometry* r) {
    return size(l) != size(r) ? size(l) > size(r) : l->id < r->id;
  });
  if (m_changed.empty()) return;
  std::size_t total = 0;
  for (const Geometry* geometry : m_changed) total += size(geometry);
  const Threads one(1);
  m_updatedAlone = settings.update == OctreeUpdate::Auto && total < kSmallRefit;
  (m_updatedAlone ? one : threads).forEach(m_changed.size(), [&](std::size_t i) {
    updateOctree(*m_changed[i], settings, size(m_changed[i]) < kSmall ? one : threads);
  });
}

void GeometryTable::endFrame() {
  ++m_framesEnded;
  for (const auto& geometry : m_geometries) {
    geometry->setThisFrame = false;
    geometry->hasLastFrame = true;
  }
}

}  // namespace palpate
