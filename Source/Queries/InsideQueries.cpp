// Part of <palpate/SpatialQueries.h>: points inside of bodies.
#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "Queries/Containment.h"
#include "Queries/Embedding.h"
#include "Queries/PointDistances.h"
#include "Queries/QuerySource.h"
#include "Math/Range.h"
#include "Core/Text.h"

#include <optional>

namespace palpate {

bool SpatialQueries::contains(GeometryId id, const Eigen::Vector3d& point,
                              const InsideSettings& settings) const {
  const Source::Call source(*this);
  checkPoint(point);
  const Body& body = source->at(id);
  source->prepareInside(body, settings);
  const Source::Loan scratch(*source);
  return isInside(body, point, settings, source->engine(), scratch->stack);
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
  const Source::Call source(*this);
  checkSizes(points.size(), out.size(), "points");
  checkPoints(points);
  const Body& body = source->at(id);
  source->prepareInside(body, settings);
  if (body.tree.ordered().empty())
    throw Error(ErrorCode::NotClosed, nameOf(body) + " has no triangles and so no surface", id);
  const bool bruteForce = source->engine() == Engine::BruteForce;
  // Only these sides never change but at the surface: the winding number of an open mesh changes
  // everywhere, and inverted tetrahedra end inside.
  const bool sidesAreBySurface = settings.rule == InsideRule::Closed && !body.solid && !bruteForce;
  forParts(*source, points.size(), [&](std::size_t begin, std::size_t end) {
    const Source::Loan scratch(*source);
    PointDistances::Last last;
    bool inside = false;
    for (std::size_t i = begin; i < end; ++i) {
      const PointDistances distances(body, points[i], bruteForce);
      const auto near = *distances.nearest(kInfinity, kNoElement, last.boundAt(points[i]));
      if (!sidesAreBySurface || !last.isOnSideOf(distances, near))
        inside = isInside(body, points[i], settings, source->engine(), scratch->stack);
      last.set(distances, near);
      out[i] = {distances.surfacePoint(near), inside ? -near.distance : near.distance};
    }
  });
}

void SpatialQueries::findInsideVertices(GeometryId vertices, GeometryId body,
                                        std::vector<InsideVertex>& out,
                                        const InsideSettings& settings) const {
  const Source::Call source(*this);
  const Body& owner = source->at(vertices);
  const Body& container = source->at(body);
  checkVertices(owner, body);
  source->prepareInside(container, settings);
  const Source::Loan scratch(*source);
  findInside(owner, container, settings, source->engine(), Source::Workers(*source),
             scratch->inside, out);
}

void SpatialQueries::findEmbeddedVertices(GeometryId vertices, GeometryId body,
                                          std::vector<EmbeddedVertex>& out) const {
  const Source::Call source(*this);
  const Body& owner = source->at(vertices);
  const Body& solid = source->at(body);
  checkVertices(owner, body);
  checkMeshType(solid, true, "findEmbeddedVertices() is for tetrahedral meshes");
  source->prepareTetrahedra(solid);
  const Source::Loan scratch(*source);
  findEmbedded(owner, solid, source->engine(), Source::Workers(*source), scratch->embedded, out);
}

std::optional<TetrahedronPoint> SpatialQueries::findTetrahedron(
    GeometryId body, const Eigen::Vector3d& point) const {
  const Source::Call source(*this);
  const Body& solid = source->at(body);
  checkMeshType(solid, true, "findTetrahedron() is for tetrahedral meshes");
  if (!isWithinRange(point))
    throw Error(ErrorCode::NonFinitePosition,
                nameOf(solid) + ": the point is " + textOf(point) + "; it must be " + kRangeRule,
                body);
  source->prepareTetrahedra(solid);
  const Source::Loan scratch(*source);
  return SolidQuery(solid, source->engine(), scratch->stack).lowest(point);
}

}  // namespace palpate
