// Part of <palpate/SpatialQueries.h>: distances and penetrations of two geometries.
#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "Queries/GeometryDistances.h"
#include "Queries/QuerySource.h"
#include "Queries/ShapePenetration.h"
#include "Queries/SurfaceNormal.h"
#include "NarrowPhase/Meeting.h"

#include <string>

namespace palpate {

namespace {

GeometryDistance withNormals(GeometryDistance found, const Body& a, const Body& b) {
  const Eigen::Vector3d way = found.b.position - found.a.position;
  setNormal(a, way, found.a);
  setNormal(b, -way, found.b);
  return found;
}

Penetration withNormals(Penetration found, const Body& a, const Body& b) {
  if (!found.intersecting) return found;
  setNormal(a, found.direction, found.a);
  setNormal(b, -found.direction, found.b);
  return found;
}

}  // namespace

GeometryDistance SpatialQueries::distance(GeometryId idA, GeometryId idB) const {
  const Source::Call source(*this);
  const Body &a = source->at(idA), &b = source->at(idB);
  if (idA == idB)
    throw Error(ErrorCode::InvalidSettings, "distance() was called for " + nameOf(a) + " twice",
                idA);
  const bool bruteForce = source->engine() == Engine::BruteForce;
  const Source::Loan scratch(*source);
  if (!a.shape && !b.shape)
    return withNormals(distanceBetween(a, b, bruteForce, scratch->pairs), a, b);
  if (!a.shape) return withNormals(distanceBetween(a, idB, b.shape->now, bruteForce), a, b);
  if (!b.shape) {
    const GeometryDistance found = distanceBetween(b, idA, a.shape->now, bruteForce);
    return withNormals({found.b, found.a, found.distance}, a, b);
  }
  const Shape &first = a.shape->now, &second = b.shape->now;
  if (first.isPlane() && second.isPlane())
    throw Error(ErrorCode::UnsupportedMethod, nameOf(a) + " and " + nameOf(b) + " are both planes",
                idA);
  return withNormals(distanceBetween(idA, first, idB, second, scratch->shapeContacts.shapePair), a,
                     b);
}

Penetration SpatialQueries::penetration(GeometryId idA, GeometryId idB) const {
  const Source::Call source(*this);
  const Body &a = source->at(idA), &b = source->at(idB);
  if (idA == idB)
    throw Error(ErrorCode::InvalidSettings, "penetration() was called for " + nameOf(a) + " twice",
                idA);
  for (const Body* const body : {&a, &b}) {
    if (body->shape && body->shape->now.isTwoSided())
      throw Error(ErrorCode::NotClosed,
                  nameOf(*body) + " is a two-sided plane, which has no inside", body->id);
    if (!body->shape && !body->solid) source->prepareInside(*body, {});
  }
  const Source::Loan scratch(*source);
  if (!a.shape && !b.shape)
    return withNormals(penetrationOf(a, b, source->engine(), scratch->penetration), a, b);
  if (a.shape && b.shape && a.shape->now.isPlane() && b.shape->now.isPlane())
    throw Error(ErrorCode::UnsupportedMethod, nameOf(a) + " and " + nameOf(b) + " are both planes",
                idA);
  return withNormals(shapePenetration(a, b, source->engine(), source->octreeSettings(),
                                      scratch->penetration, scratch->shapeContacts.shapePair),
                     a, b);
}

bool SpatialQueries::pierce(GeometryId idA, std::uint32_t elementOfA, GeometryId idB,
                            std::uint32_t elementOfB) const {
  const Source::Call source(*this);
  const auto meshOf = [&](GeometryId id, std::uint32_t element) -> const TriangleMesh& {
    const Body& body = source->at(id);
    checkHasElements(body);
    const MeshTopology& topology = body.mesh.topology;
    if (topology.type == GeometryType::Points)
      throw Error(ErrorCode::UnsupportedMethod, nameOf(body) + " has points, which pierce nothing",
                  id);
    if (element >= topology.elements.size() || topology.isRemoved(element))
      throw Error(ErrorCode::IndexOutOfRange,
                  nameOf(body) + " has no element " + std::to_string(element), id, element);
    return body.mesh;
  };
  const TriangleMesh &a = meshOf(idA, elementOfA), &b = meshOf(idB, elementOfB);
  ContactBuffers counts;
  return meetingOf(MeshPair{a, b, {}}, false, ElementPair{elementOfA, elementOfB}, counts) ==
         Meeting::Piercing;
}

}  // namespace palpate
