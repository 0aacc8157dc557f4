#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "Core/FloatingPoint.h"
#include "Core/Text.h"
#include "Math/Range.h"
#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Queries/Containment.h"
#include "Queries/Embedding.h"
#include "Queries/GeometryDistances.h"
#include "Queries/PathIntervals.h"
#include "Queries/PointDistances.h"
#include "Queries/QuerySource.h"
#include "Queries/RayHits.h"
#include "Queries/ElementsNearShape.h"
#include "Queries/ShapeOverlap.h"
#include "Queries/ShapePenetration.h"
#include "Queries/ShapeRays.h"
#include "Mesh/Rotation.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

namespace palpate {

namespace {

std::uint64_t nextSourceId() {
  static std::atomic<std::uint64_t> last = 0;
  return ++last;
}

}  // namespace

SpatialQueries::Source::Pool::Pool(std::shared_ptr<MemoryBudget> budget)
    : m_id(nextSourceId()), m_budget(std::move(budget)) {}

SpatialQueries::Source::Pool::~Pool() { delete m_spare.load(); }

std::unique_ptr<SpatialQueries::Source::Scratch> SpatialQueries::Source::Pool::take() {
  if (Scratch* const spare = m_spare.exchange(nullptr)) return std::unique_ptr<Scratch>(spare);
  {
    const std::lock_guard lock(m_mutex);
    if (!m_free.empty()) {
      auto scratch = std::move(m_free.back());
      m_free.pop_back();
      return scratch;
    }
  }
  return std::make_unique<Scratch>();
}

void SpatialQueries::Source::Pool::giveBack(std::unique_ptr<Scratch> scratch) {
  Scratch* none = nullptr;
  if (m_spare.compare_exchange_strong(none, scratch.get())) {
    scratch.release();
    return;
  }
  const std::lock_guard lock(m_mutex);
  try {
    m_free.push_back(std::move(scratch));
  } catch (...) {  // no memory to keep it: the next call makes another
  }
}

void SpatialQueries::Source::Pool::release() {
  delete m_spare.exchange(nullptr);
  const std::lock_guard lock(m_mutex);
  m_free.clear();
}

void SpatialQueries::Source::Scratch::sort(std::vector<std::uint32_t>& numbers) {
  if (numbers.empty()) return;
  const auto [least, most] = std::minmax_element(numbers.begin(), numbers.end());
  const std::size_t first = *least / 64, words = *most / 64 - first + 1;
  if (words > 8 * numbers.size()) {
    std::sort(numbers.begin(), numbers.end());
    return;
  }
  bits.assign(words, 0);
  for (const std::uint32_t i : numbers) bits[i / 64 - first] |= std::uint64_t{1} << i % 64;
  std::size_t count = 0;
  for (std::size_t w = 0; w < words; ++w)
    for (std::uint64_t word = bits[w]; word; word &= word - 1)
      numbers[count++] = static_cast<std::uint32_t>((first + w) * 64) +
                         static_cast<std::uint32_t>(std::countr_zero(word));
}

void SpatialQueries::Source::prepareInside(const Body& body, const InsideSettings& settings) {
  checkSettings(body, settings);
  PreparedState& prepared = body.prepared->preparedFor[settings.rule == InsideRule::WindingNumber];
  const std::uint64_t now = state(), updates = body.tree.updates();
  if (prepared.isCurrent(now, updates)) return;
  const std::lock_guard lock(body.prepared->mutex);
  const MemoryScope memory(budget(), MemoryStage::Queries);
  checkInside(body, settings.rule);
  if (settings.rule == InsideRule::WindingNumber && body.tree.octree().size() > 0)
    body.prepared->windingNumbers.update(body, Workers(*this));
  else if (settings.rule == InsideRule::Closed && body.solid)
    updateTetrahedra(body, octreeSettings(), Workers(*this));
  prepared.commit(now, updates);
}

bool SpatialQueries::Source::prepareIfClosed(const Body& body) {
  const std::lock_guard lock(body.prepared->mutex);
  const MemoryScope memory(budget(), MemoryStage::Queries);
  if (!isClosed(body)) return false;
  if (body.solid) updateTetrahedra(body, octreeSettings(), Workers(*this));
  return true;
}

void SpatialQueries::Source::prepareTetrahedra(const Body& solid) {
  const std::lock_guard lock(solid.prepared->mutex);
  const MemoryScope memory(budget(), MemoryStage::Queries);
  updateTetrahedra(solid, octreeSettings(), Workers(*this));
}

void checkVertices(const Body& vertices, GeometryId body) {
  if (vertices.id == body)
    throw Error(
        ErrorCode::InvalidSettings,
        nameOf(vertices) + " is both the body and the owner of the vertices; these must differ",
        body);
  if (vertices.shape)
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(vertices) + " is a shape, which has no vertices", vertices.id);
}

SpatialQueries::SpatialQueries(std::shared_ptr<Source> source)
    : m_source(std::move(source)), m_state(m_source->state()) {}

SpatialQueries::Source& SpatialQueries::valid() const {
  if (!m_source) throw Error(ErrorCode::InvalidCall, "this SpatialQueries object was moved from");
  if (m_state == 0 || m_source->state() != m_state)
    throw Error(
        ErrorCode::InvalidCall,
        "this SpatialQueries object is outdated: positions, transforms, topology or geometries "
        "changed, advance() was called, or the OctreeBasedCD or Snapshot was destroyed; call "
        "queries() again");
  return *m_source;
}

void checkLength(double length, const char* name, bool finite) {
  if (!(length >= 0) || (finite && !isWithinRange(length)))
    throw Error(ErrorCode::InvalidSettings, std::string(name) + " is " + textOf(length) +
                                                "; it must be " +
                                                (finite ? kLengthRule : "a number of at least 0"));
}

void checkHasElements(const Body& geometry) {
  if (geometry.shape)
    throw Error(ErrorCode::UnsupportedMethod, nameOf(geometry) + " is a shape: it has no elements",
                geometry.id);
}

RigidTransform checkedPose(const RigidTransform& pose, const char* what) {
  if (const std::string fault = faultOf(pose); !fault.empty())
    throw Error(ErrorCode::InvalidTransform, std::string(what) + ": " + fault);
  return withExactRotation(pose);
}

namespace {

/// index: of a batch.
void checkPoint(const Eigen::Vector3d& point, std::optional<std::size_t> index = {}) {
  if (!isWithinRange(point))
    throw Error(ErrorCode::NonFinitePosition,
                (index ? "point " + std::to_string(*index) : "the query's point") + " is " +
                    textOf(point) + "; it must be " + kRangeRule);
}

void checkPoints(std::span<const Eigen::Vector3d> points) {
  for (std::size_t i = 0; i < points.size(); ++i) checkPoint(points[i], i);
}

std::optional<SurfacePoint> closestPointOf(const Body& geometry, const Eigen::Vector3d& point,
                                           double maxDistance, bool bruteForce,
                                           PointDistances::Last& last) {
  if (geometry.shape) {
    const SurfacePoint nearest = closestPointOnShape(geometry.id, geometry.shape->now, point);
    return nearest.distance <= maxDistance ? std::optional(nearest) : std::nullopt;
  }
  if (geometry.tree.ordered().empty()) return {};
  const PointDistances distances(geometry, point, bruteForce);
  const auto near = distances.nearest(maxDistance, kNoElement, last.boundAt(point));
  if (!near) return {};
  last.set(distances, *near);
  return distances.surfacePoint(*near);
}

void checkSizes(std::size_t asked, std::size_t room, const char* name) {
  if (asked != room)
    throw Error(ErrorCode::InvalidSettings, std::to_string(asked) + " " + name + ", but room for " +
                                                std::to_string(room) + " answers");
}

/// Calls f(begin, end) for parts of a batch, on all threads.
template <class F>
void forParts(SpatialQueries::Source& source, std::size_t size, F&& f) {
  constexpr std::size_t kGrain = 64;
  const SpatialQueries::Source::Workers workers(source);
  const Threads& threads = workers;
  threads.forChunks(size, kGrain,
                    [&](std::size_t, std::size_t begin, std::size_t end) { f(begin, end); });
}

/// The vertex and the edge of the element that are nearest to where the ray hits it. Of equally
/// near ones the first in the element's order.
Pick pickOf(const RayHit& hit, const Ray& ray, const Positions& now) {
  const Eigen::Vector3d point = ray.origin + hit.t * ray.direction;
  Pick pick{hit, hit.vertices[0], {hit.vertices[0], hit.vertices[1]}};
  double leastVertex = kInfinity, leastEdge = kInfinity;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::uint32_t p = hit.vertices[i], q = hit.vertices[(i + 1) % 3];
    if (const double distance = stableLength(now[p] - point); distance < leastVertex) {
      leastVertex = distance;
      pick.vertex = p;
    }
    const Eigen::Vector3d a = now[p], b = now[q];
    const double distance = finiteVertexTriangleDistance(point, a, b, b).distance;
    if (p != q && distance < leastEdge) {
      leastEdge = distance;
      pick.edge = {std::min(p, q), std::max(p, q)};
    }
  }
  return pick;
}

/// index: of a batch.
void checkRay(const Ray& ray, std::optional<std::size_t> index = {}) {
  const auto refuse = [&](ErrorCode code, const std::string& fault) {
    throw Error(code, (index ? "ray " + std::to_string(*index) : "the ray") + " has " + fault);
  };
  if (!isWithinRange(ray.origin) || !isWithinRange(ray.direction))
    refuse(ErrorCode::NonFinitePosition, "origin " + textOf(ray.origin) + " and direction " +
                                             textOf(ray.direction) + "; both must be " +
                                             kRangeRule);
  if (ray.direction == Eigen::Vector3d::Zero())
    refuse(ErrorCode::InvalidSettings, "a direction of length 0");
  if (!std::isfinite(ray.tMin) || !(ray.tMin <= ray.tMax))
    refuse(ErrorCode::InvalidSettings, "tMin " + textOf(ray.tMin) + " and tMax " +
                                           textOf(ray.tMax) +
                                           "; tMin must be finite and at most tMax");
}

}  // namespace

namespace {

/// The hits of rays, in scratch of one call.
class RayQuery {
 public:
  explicit RayQuery(SpatialQueries::Source& source)
      : m_scratch(source), m_bruteForce(source.engine() == Engine::BruteForce) {}

  /// By ascending t; valid until the next call.
  const std::vector<RayHit>& all(const Body& geometry, const Ray& ray) {
    std::vector<RayHit>& hits = m_scratch->hits;
    hits.clear();
    if (geometry.shape)
      addShapeHits(geometry.id, geometry.shape->now, bounded(ray), hits);
    else
      on(geometry, ray).all(hits);
    return hits;
  }
  /// bound: as in RayHits::first().
  std::optional<RayHit> first(const Body& geometry, const Ray& ray, double bound) {
    if (!geometry.shape) return on(geometry, ray).first(bound);
    const std::vector<RayHit>& hits = all(geometry, ray);
    return hits.empty() ? std::nullopt : std::optional(hits.front());
  }
  /// out: element kNoElement where there is none.
  void first(const Body& geometry, std::span<const Ray> rays, std::span<RayHit> out) {
    const RayHit none{geometry.id, kNoElement, {}, {0, 0, 0}, kInfinity, false, false};
    if (!geometry.shape)
      return RayHits::first(geometry, rays, m_bruteForce, m_scratch->metInFlight, none, out);
    for (std::size_t i = 0; i < rays.size(); ++i)
      out[i] = first(geometry, rays[i], kInfinity).value_or(none);
  }
  bool any(const Body& geometry, const Ray& ray) {
    return geometry.shape ? !all(geometry, ray).empty() : on(geometry, ray).any();
  }

 private:
  RayHits on(const Body& geometry, const Ray& ray) {
    return {geometry, bounded(ray), m_bruteForce, m_scratch->met};
  }
  /// A hit beyond double's range is none.
  static Ray bounded(Ray ray) {
    ray.tMax = std::min(ray.tMax, std::numeric_limits<double>::max());
    return ray;
  }

  const SpatialQueries::Source::Loan m_scratch;
  const bool m_bruteForce;
};

/// The first hit of all geometries. frontFacesOnly: other hits do not count.
std::optional<RayHit> firstHitOfAll(SpatialQueries::Source& source, const Ray& ray,
                                    bool frontFacesOnly) {
  RayQuery query(source);
  std::optional<RayHit> best;
  const auto take = [&](const RayHit& hit) {
    if (!best || hit.t < best->t) best = hit;
  };
  for (std::size_t i = 0; i < source.geometryCount(); ++i) {
    const Body& geometry = source.geometry(i);
    // The ray itself is not cut at the best hit, as this would change other hits.
    const auto first = query.first(geometry, ray, best ? best->t : ray.tMax);
    if (!first || (best && !(first->t < best->t))) continue;
    if (!frontFacesOnly) {
      take(*first);
      continue;
    }
    for (const RayHit& hit : query.all(geometry, ray))
      if (hit.frontFace) take(hit);
  }
  return best;
}

}  // namespace

std::optional<RayHit> SpatialQueries::firstHit(GeometryId id, const Ray& ray) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkRay(ray);
  const Body& geometry = source.at(id);
  return RayQuery(source).first(geometry, ray, ray.tMax);
}

std::optional<RayHit> SpatialQueries::firstHit(const Ray& ray) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkRay(ray);
  return firstHitOfAll(source, ray, false);
}

bool SpatialQueries::anyHit(GeometryId id, const Ray& ray) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkRay(ray);
  const Body& geometry = source.at(id);
  return RayQuery(source).any(geometry, ray);
}

std::optional<Pick> SpatialQueries::pick(const Ray& ray, bool frontFacesOnly) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkRay(ray);
  const auto hit = firstHitOfAll(source, ray, frontFacesOnly);
  if (!hit) return {};
  if (hit->element == kNoElement) return Pick{*hit, kNoElement, {kNoElement, kNoElement}};
  return pickOf(*hit, ray, source.at(hit->geometry).mesh.now);
}

void SpatialQueries::firstHits(GeometryId id, std::span<const Ray> rays,
                               std::span<RayHit> out) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkSizes(rays.size(), out.size(), "rays");
  for (std::size_t i = 0; i < rays.size(); ++i) checkRay(rays[i], i);
  const Body& geometry = source.at(id);
  forParts(source, rays.size(), [&](std::size_t begin, std::size_t end) {
    RayQuery(source).first(geometry, rays.subspan(begin, end - begin), out.subspan(begin));
  });
}

void SpatialQueries::allHits(GeometryId id, const Ray& ray, std::vector<RayHit>& out) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkRay(ray);
  const Body& geometry = source.at(id);
  RayQuery query(source);
  const std::vector<RayHit>& hits = query.all(geometry, ray);
  out.reserve(hits.size());  // nothing below throws
  out.assign(hits.begin(), hits.end());
}

std::optional<SurfacePoint> SpatialQueries::closestPoint(GeometryId id,
                                                         const Eigen::Vector3d& point,
                                                         double maxDistance) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkPoint(point);
  checkLength(maxDistance, "maxDistance", false);
  const Body& geometry = source.at(id);
  PointDistances::Last last;
  return closestPointOf(geometry, point, maxDistance, source.engine() == Engine::BruteForce, last);
}

void SpatialQueries::closestPoints(GeometryId id, std::span<const Eigen::Vector3d> points,
                                   std::span<SurfacePoint> out, double maxDistance) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkSizes(points.size(), out.size(), "points");
  checkPoints(points);
  checkLength(maxDistance, "maxDistance", false);
  const Body& geometry = source.at(id);
  const bool bruteForce = source.engine() == Engine::BruteForce;
  forParts(source, points.size(), [&](std::size_t begin, std::size_t end) {
    PointDistances::Last last;
    for (std::size_t i = begin; i < end; ++i)
      out[i] = closestPointOf(geometry, points[i], maxDistance, bruteForce, last)
                   .value_or(SurfacePoint{id, kNoElement, {}, {0, 0, 0}, {0, 0, 0}, kInfinity});
  });
}

bool SpatialQueries::contains(GeometryId id, const Eigen::Vector3d& point,
                              const InsideSettings& settings) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkPoint(point);
  const Body& body = source.at(id);
  source.prepareInside(body, settings);
  const Source::Loan scratch(source);
  return isInside(body, point, settings, source.engine(), scratch->stack);
}

SignedDistance SpatialQueries::signedDistance(GeometryId id, const Eigen::Vector3d& point,
                                              const InsideSettings& settings) const {
  valid();
  checkPoint(point);
  SignedDistance out;
  signedDistances(id, {&point, 1}, {&out, 1}, settings);
  return out;
}

void SpatialQueries::signedDistances(GeometryId id, std::span<const Eigen::Vector3d> points,
                                     std::span<SignedDistance> out,
                                     const InsideSettings& settings) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkSizes(points.size(), out.size(), "points");
  checkPoints(points);
  const Body& body = source.at(id);
  source.prepareInside(body, settings);
  if (body.tree.ordered().empty())
    throw Error(ErrorCode::NotClosed, nameOf(body) + " has no triangles and so no surface", id);
  const bool bruteForce = source.engine() == Engine::BruteForce;
  // Only these sides never change but at the surface: the winding number of an open mesh changes
  // everywhere, and inverted tetrahedra end inside.
  const bool sidesAreBySurface = settings.rule == InsideRule::Closed && !body.solid && !bruteForce;
  forParts(source, points.size(), [&](std::size_t begin, std::size_t end) {
    const Source::Loan scratch(source);
    PointDistances::Last last;
    bool inside = false;
    for (std::size_t i = begin; i < end; ++i) {
      const PointDistances distances(body, points[i], bruteForce);
      const auto near = *distances.nearest(kInfinity, kNoElement, last.boundAt(points[i]));
      if (!sidesAreBySurface || !last.isOnSideOf(distances, near))
        inside = isInside(body, points[i], settings, source.engine(), scratch->stack);
      last.set(distances, near);
      out[i] = {distances.surfacePoint(near), inside ? -near.distance : near.distance};
    }
  });
}

void SpatialQueries::nearestElements(GeometryId id, const Eigen::Vector3d& point, int k,
                                     std::vector<SurfacePoint>& out, double maxDistance) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkPoint(point);
  checkLength(maxDistance, "maxDistance", false);
  if (k < 1)
    throw Error(ErrorCode::InvalidSettings, "k is " + std::to_string(k) + "; it must be 1 or more");
  const Body& geometry = source.at(id);
  checkHasElements(geometry);
  const Source::Loan scratch(source);
  scratch->near.clear();
  if (geometry.tree.ordered().empty()) return out.clear();
  const PointDistances distances(geometry, point, source.engine() == Engine::BruteForce);
  distances.nearest(static_cast<std::size_t>(k), maxDistance, scratch->near);
  out.reserve(scratch->near.size());  // nothing below throws
  out.clear();
  for (const PointDistances::Near& near : scratch->near)
    out.push_back(distances.surfacePoint(near));
}

void SpatialQueries::elementsWithin(GeometryId id, const Eigen::Vector3d& point, double radius,
                                    std::vector<std::uint32_t>& elements) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkPoint(point);
  checkLength(radius, "radius", true);
  const Body& geometry = source.at(id);
  checkHasElements(geometry);
  const Source::Loan scratch(source);
  std::vector<std::uint32_t>& found = scratch->elements;
  found.clear();
  if (!geometry.tree.ordered().empty())
    findWithin(geometry, point, radius, source.engine() == Engine::BruteForce, scratch->nearShape,
               found);
  scratch->sort(found);
  elements.reserve(found.size());  // nothing below throws
  elements.assign(found.begin(), found.end());
}

namespace {

/// Throws InvalidShape or InvalidTransform.
RigidTransform poseOfQuery(const AnalyticalGeometry& shape, const Eigen::Matrix3d& rotation,
                           const Eigen::Vector3d& translation) {
  std::optional<std::size_t> element;
  if (const std::string fault = faultOf(shape, element); !fault.empty())
    throw Error(ErrorCode::InvalidShape, "the query's shape: " + fault, {}, element);
  return checkedPose({rotation, translation}, "the query's shape");
}

}  // namespace

void SpatialQueries::overlapping(GeometryId id, const AnalyticalGeometry& shape,
                                 const Eigen::Matrix3d& rotation,
                                 const Eigen::Vector3d& translation,
                                 std::vector<std::uint32_t>& elements) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  const RigidTransform pose = poseOfQuery(shape, rotation, translation);
  const Body& geometry = source.at(id);
  checkHasElements(geometry);
  const Source::Loan scratch(source);
  std::vector<std::uint32_t>& found = scratch->elements;
  found.clear();
  if (!geometry.tree.ordered().empty())
    findOverlapping(geometry, shape, pose, source.engine() == Engine::BruteForce, scratch->shapes,
                    scratch->stack, scratch->nearShape, found);
  scratch->sort(found);
  elements.reserve(found.size());  // nothing below throws
  elements.assign(found.begin(), found.end());
}

void SpatialQueries::contacts(GeometryId id, const AnalyticalGeometry& shape,
                              const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                              double thickness, std::vector<ShapeContact>& out) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  const RigidTransform pose = poseOfQuery(shape, rotation, translation);
  checkLength(thickness, "thickness", true);
  const Body& geometry = source.at(id);
  checkHasElements(geometry);
  const Source::Loan scratch(source);
  Buffer<std::uint32_t>& near = scratch->nearShape;
  Buffer<ShapeContact>& found = scratch->shapeContacts.shape;
  near.clear();
  found.clear();
  if (!geometry.tree.ordered().empty()) {
    const PlacedShape& tool = placeAtRest(shape, pose, scratch->shapes);
    if (source.engine() == Engine::BruteForce)
      for (std::uint32_t i = 0; i < geometry.mesh.topology.triangles.size(); ++i) near.push_back(i);
    else
      findElementsNear(geometry, tool.now, tool.now, thickness + geometry.mesh.largestRadius,
                       scratch->stack, near);
    const PairSettings settings{Method::Proximity, thickness};
    findShapeContacts(geometry.mesh, tool, settings, near, scratch->shapeContacts);
    std::sort(found.begin(), found.end(), [](const ShapeContact& a, const ShapeContact& b) {
      return std::tie(a.element, a.id, a.vertices) < std::tie(b.element, b.id, b.vertices);
    });
    found.resize(
        scratch->distinctContacts.keep(geometry.mesh, tool.now, pose, pose, settings, found));
  }
  out.reserve(found.size());  // nothing below throws
  out.assign(found.begin(), found.end());
}

GeometryDistance SpatialQueries::distance(GeometryId idA, GeometryId idB) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  const Body &a = source.at(idA), &b = source.at(idB);
  if (idA == idB)
    throw Error(ErrorCode::InvalidSettings, "distance() was called for " + nameOf(a) + " twice",
                idA);
  const bool bruteForce = source.engine() == Engine::BruteForce;
  const Source::Loan scratch(source);
  if (!a.shape && !b.shape) return distanceBetween(a, b, bruteForce, scratch->pairs);
  if (!a.shape) return distanceBetween(a, idB, b.shape->now, bruteForce);
  if (!b.shape) {
    const GeometryDistance found = distanceBetween(b, idA, a.shape->now, bruteForce);
    return {found.b, found.a, found.distance};
  }
  const Shape &first = a.shape->now, &second = b.shape->now;
  if (first.isPlane() && second.isPlane())
    throw Error(ErrorCode::UnsupportedMethod, nameOf(a) + " and " + nameOf(b) + " are both planes",
                idA);
  return distanceBetween(idA, first, idB, second, scratch->shapeContacts.shapePair);
}

Penetration SpatialQueries::penetration(GeometryId idA, GeometryId idB) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  const Body &a = source.at(idA), &b = source.at(idB);
  if (idA == idB)
    throw Error(ErrorCode::InvalidSettings, "penetration() was called for " + nameOf(a) + " twice",
                idA);
  for (const Body* const body : {&a, &b}) {
    if (body->shape && body->shape->now.isTwoSided())
      throw Error(ErrorCode::NotClosed,
                  nameOf(*body) + " is a two-sided plane, which has no inside", body->id);
    if (!body->shape && !body->solid) source.prepareInside(*body, {});
  }
  const Source::Loan scratch(source);
  if (!a.shape && !b.shape) return penetrationOf(a, b, source.engine(), scratch->penetration);
  if (a.shape && b.shape && a.shape->now.isPlane() && b.shape->now.isPlane())
    throw Error(ErrorCode::UnsupportedMethod, nameOf(a) + " and " + nameOf(b) + " are both planes",
                idA);
  return shapePenetration(a, b, source.engine(), source.octreeSettings(), scratch->penetration,
                          scratch->shapeContacts.shapePair);
}

void SpatialQueries::path(std::span<const Eigen::Vector3d> polyline, double radius,
                          std::span<const GeometryId> bodies, std::vector<PathInterval>& inside,
                          std::vector<PathClearance>& outside) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  checkLength(radius, "radius", true);
  if (polyline.size() < 2)
    throw Error(ErrorCode::InvalidSettings, "the path has " + std::to_string(polyline.size()) +
                                                " points; it must have 2 or more");
  for (std::size_t i = 0; i < polyline.size(); ++i)
    if (!isWithinRange(polyline[i]))
      throw Error(ErrorCode::NonFinitePosition, "point " + std::to_string(i) + " of the path is " +
                                                    textOf(polyline[i]) + "; it must be " +
                                                    kRangeRule);
  const Source::Loan scratch(source);
  PathScratch& found = scratch->path;
  const PathLine path(polyline, found.lengths);
  if (!std::isfinite(path.length()))
    throw Error(ErrorCode::InvalidSettings, "the path's length is not finite");
  const bool bruteForce = source.engine() == Engine::BruteForce;
  const InsideSettings closed;
  found.inside.clear();
  found.outside.clear();
  for (const GeometryId id : bodies) {
    const Body& body = source.at(id);
    const bool isBody = !body.shape && source.prepareIfClosed(body);
    if (body.shape)
      findPathParts(body.shape->now, path, radius, found.parts);
    else
      findPathParts(body, path, radius, bruteForce, scratch->met, found);
    if (isBody && body.solid) addInvertedFaces(body, path, bruteForce, scratch->stack, found);
    const std::size_t before = found.inside.size();
    joinPathParts(
        id, path, found.parts, radius > 0.0 || !isBody,
        [&](const Eigen::Vector3d& point) {
          return isBody && isInside(body, point, closed, source.engine(), scratch->stack);
        },
        found.inside);
    if (found.inside.size() == before)
      found.outside.push_back(clearanceOf(body, path, radius, bruteForce));
  }
  found.order.resize(found.inside.size());
  std::iota(found.order.begin(), found.order.end(), 0u);
  std::sort(found.order.begin(), found.order.end(), [&](std::uint32_t i, std::uint32_t j) {
    return std::pair(found.inside[i].enter, i) < std::pair(found.inside[j].enter, j);
  });
  inside.reserve(found.inside.size());
  outside.reserve(found.outside.size());  // nothing below throws
  inside.clear();
  for (const std::uint32_t i : found.order) inside.push_back(found.inside[i]);
  outside.assign(found.outside.begin(), found.outside.end());
}

void SpatialQueries::findInsideVertices(GeometryId vertices, GeometryId body,
                                        std::vector<InsideVertex>& out,
                                        const InsideSettings& settings) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  const Body& owner = source.at(vertices);
  const Body& container = source.at(body);
  checkVertices(owner, body);
  source.prepareInside(container, settings);
  const Source::Loan scratch(source);
  findInside(owner, container, settings, source.engine(), Source::Workers(source), scratch->inside,
             out);
}

void SpatialQueries::findEmbeddedVertices(GeometryId vertices, GeometryId body,
                                          std::vector<EmbeddedVertex>& out) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  const Body& owner = source.at(vertices);
  const Body& solid = source.at(body);
  checkVertices(owner, body);
  checkMeshType(solid, true, "findEmbeddedVertices() is for tetrahedral meshes");
  source.prepareTetrahedra(solid);
  const Source::Loan scratch(source);
  findEmbedded(owner, solid, source.engine(), Source::Workers(source), scratch->embedded, out);
}

std::optional<TetrahedronPoint> SpatialQueries::findTetrahedron(
    GeometryId body, const Eigen::Vector3d& point) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  const Body& solid = source.at(body);
  checkMeshType(solid, true, "findTetrahedron() is for tetrahedral meshes");
  if (!isWithinRange(point))
    throw Error(ErrorCode::NonFinitePosition,
                nameOf(solid) + ": the point is " + textOf(point) + "; it must be " + kRangeRule,
                body);
  source.prepareTetrahedra(solid);
  const Source::Loan scratch(source);
  return SolidQuery(solid, source.engine(), scratch->stack).lowest(point);
}

}  // namespace palpate
