#include "CollisionDetection/RestoredGeometry.h"

#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/GeometryChecks.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace palpate {

namespace {

template <class T>
bool haveEqualBits(std::span<const T> l, std::span<const T> r) {
  return l.size() == r.size() &&
         (l.empty() || std::memcmp(l.data(), r.data(), l.size_bytes()) == 0);
}

template <class T>
bool areEqual(const std::vector<T>& l, const auto& r) {
  return haveEqualBits<T>(l, r);
}

/// Whether all that follows from the elements and the shape at rest is the same, and what is
/// attached.
bool isSameBody(const Geometry& geometry, const SavedGeometry& saved) {
  const CollisionProblem::Geometry& given = saved.problem;
  const Body& body = geometry.body;
  const MeshTopology& topology = body.mesh.topology;
  if (given.type != topology.type || saved.field.has_value() != static_cast<bool>(body.field) ||
      saved.proxy.has_value() != static_cast<bool>(geometry.proxy) ||
      given.analytical.has_value() != body.shape.has_value())
    return false;
  if (geometry.isShapeFixed() &&
      !((!saved.proxy || *saved.proxy == geometry.proxySettings) &&
        areEqual(given.now, body.mesh.now.body()) && given.disabled.empty()))
    return false;
  if (body.shape) return body.shape->analytical == *given.analytical;
  if (body.isField()) return true;
  const CollisionProblem::Geometry own = problemOf(geometry);
  return given.now.size() == topology.vertexCount && areEqual(own.triangles, given.triangles) &&
         areEqual(own.radii, given.radii) && areEqual(own.removed, given.removed) &&
         areEqual(own.tetrahedra, given.tetrahedra) &&
         areEqual(own.removedTetrahedra, given.removedTetrahedra) &&
         areEqual(given.rest.empty() ? given.now : given.rest, body.mesh.rest);
}

/// An end of a saved step: positions in the body's frame, and the pose if it is placed. What equals
/// that of an end now, or of one in `others`, takes its revision.
Positions savedEnd(Geometry& geometry, std::span<const Eigen::Vector3d> saved,
                   const std::optional<Pose>& pose, std::initializer_list<const Positions*> others,
                   const Threads& threads) {
  const TriangleMesh& mesh = geometry.body.mesh;
  std::vector<const Positions*> known{&mesh.now, &geometry.step.detected(), &mesh.before};
  known.insert(known.end(), others.begin(), others.end());
  Positions positions;
  const auto same = std::find_if(known.begin(), known.end(), [&](const Positions* other) {
    return other->size() == saved.size() &&
           (saved.empty() || std::memcmp(other->body().data(), saved.data(),
                                         saved.size() * sizeof(Eigen::Vector3d)) == 0);
  });
  if (same != known.end()) {
    positions.setBodyOf(**same);
  } else {
    auto body = std::make_shared<CountedVector<Eigen::Vector3d>>(saved.size());
    const auto bounds = checkPositions(geometry, saved, body->data(), "", threads);
    positions.setBody(std::move(body), bounds, geometry.step.nextRevision());
  }
  if (!pose) return positions;
  if (const std::string fault = faultOf(*pose); !fault.empty())
    throw Error(ErrorCode::InvalidTransform, nameOf(geometry) + ": " + fault, geometry.body.id);
  const auto equal = std::find_if(known.begin(), known.end(), [&](const Positions* other) {
    return other->isPlaced() && haveSameBits(other->transform(), *pose);
  });
  if (equal != known.end())
    positions.placeAs(**equal);
  else
    positions.place(*pose, geometry.step.nextRevision());
  return positions;
}

/// The ends of the step of a geometry whose body is as it was saved.
GeometryStep::State restoredStep(const SavedGeometry& saved, Geometry& geometry,
                                 const Threads& threads) {
  const CollisionProblem::Geometry& given = saved.problem;
  const Body& body = geometry.body;
  const std::span<const Eigen::Vector3d> fixed = body.mesh.now.body();
  const bool hasPositions = !body.shape && !body.isField();
  const auto end = [&](std::span<const Eigen::Vector3d> positions, std::size_t i,
                       std::initializer_list<const Positions*> others) {
    if (hasPositions) checkPositionCount(geometry, positions.size());
    return savedEnd(geometry, hasPositions ? positions : fixed, saved.poses[i], others, threads);
  };
  if (!saved.poses[0] && (saved.poses[1] || saved.poses[2]))
    throw Error(ErrorCode::InvalidTransform, nameOf(geometry) + " is placed before, but not now",
                body.id);
  GeometryStep::State step;
  step.now = end(given.now, 0, {});
  step.before = end(given.before, 1, {&step.now});
  step.detected = end(saved.isDetectedOther    ? saved.detected
                      : saved.isDetectedBefore ? given.before
                                               : given.now,
                      2, {&step.now, &step.before});
  step.isNew = saved.isNew;
  step.bodyGiven = saved.bodyGiven;
  step.transformGiven = saved.transformGiven;
  step.sets = saved.sets;
  return step;
}

/// With what is attached.
std::unique_ptr<Geometry> make(const SavedGeometry& saved, const GeometryTable& table,
                               const Threads& threads) {
  const CollisionProblem::Geometry& given = saved.problem;
  const GeometryBuilder build = table.restorer(given.id);
  const auto field = saved.field ? table.at(given.id).body.field : nullptr;
  if (given.type == GeometryType::Field) return build.field(field);
  GeometryTable one;
  const GeometryId id = one.add(build.problem(given));
  if (field || saved.proxy) {
    one.setPositions(id, {}, given.now, threads);
    one.setDisabled(id, given.disabled);
  }
  if (field) one.attach(id, field);
  if (saved.proxy) one.attach(id, saved.proxy, threads);
  return one.remove(id);
}

}  // namespace

RestoredGeometry::RestoredGeometry(const SavedGeometry& saved, const GeometryTable& table,
                                   const Threads& threads) {
  const CollisionProblem::Geometry& given = saved.problem;
  geometry = table.find(given.id);
  if (saved.field) {
    const DistanceField* const field = geometry ? geometry->body.field.get() : nullptr;
    if (!field || *saved.field != std::array{field->errorBound(), field->band()})
      throw Error(ErrorCode::NotAvailable,
                  "a saved state has no distance fields: " + nameOf(given.id) +
                      " must have the one that it had",
                  given.id);
  }
  if (!geometry || !isSameBody(*geometry, saved)) {
    made = make(saved, table, threads);
    geometry = made.get();
  }
  Body& body = geometry->body;
  checkName(body, given.name);
  checkFilter(*geometry, given.filter);
  checkElements(*geometry, given.disabled);
  checkTags(body, given.tags.size());
  name = given.name;
  filter = given.filter;
  tags.assign(given.tags.begin(), given.tags.end());
  if (body.solid) {
    solidTags = std::move(tags);
    tags = tagsOfSurface(body.solid->topology, solidTags);
  }
  BodyRevisions& now = body.revisions;
  revisions = now;
  if (!(given.filter == geometry->filter && haveEqualBits<std::uint32_t>(tags, body.mesh.tags) &&
        (!body.solid || haveEqualBits<std::uint32_t>(solidTags, body.solid->tags))))
    revisions.filter = now.counter.next();
  if (!areEqual(given.disabled, body.mesh.topology.disabled)) {
    topology = body.mesh.topology;
    topology->disable(given.disabled);
    revisions.elements.enabled = now.counter.next();
  }
  step = restoredStep(saved, *geometry, threads);
  if (!saved.freeMotion.empty() && saved.freeMotion.size() != geometry->freeMotionCount())
    throw Error(ErrorCode::InvalidSettings,
                nameOf(*geometry) + ": the number of free motions is wrong", body.id);
  freeMotion.assign(saved.freeMotion.begin(), saved.freeMotion.end());
}

void RestoredGeometry::apply() noexcept {
  Body& body = geometry->body;
  TriangleMesh& mesh = body.mesh;
  body.name = std::move(name);
  geometry->filter = filter;
  mesh.outerSideOnly = filter.sidedness == Sidedness::Outer;
  mesh.tags = std::move(tags);
  if (body.solid) body.solid->tags = std::move(solidTags);
  if (topology) mesh.topology = std::move(*topology);
  const Revision::Counter counter = body.revisions.counter;
  body.revisions = revisions;
  body.revisions.counter = counter;
  geometry->step.restore(mesh, body.shape ? &*body.shape : nullptr, step);
  geometry->freeMotion = std::move(freeMotion);
}

}  // namespace palpate
