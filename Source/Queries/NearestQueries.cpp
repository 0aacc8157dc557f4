// Part of <palpate/SpatialQueries.h>: elements near points.
#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "Queries/ElementsNearShape.h"
#include "Queries/PointDistances.h"
#include "Queries/QuerySource.h"
#include "Queries/ShapeOverlap.h"
#include "Queries/ShapeRays.h"

#include <optional>
#include <string>

namespace palpate {

namespace {

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

}  // namespace

std::optional<SurfacePoint> SpatialQueries::closestPoint(GeometryId id,
                                                         const Eigen::Vector3d& point,
                                                         double maxDistance) const {
  const Source::Call source(*this);
  checkPoint(point);
  checkLength(maxDistance, "maxDistance", false);
  const Body& geometry = source->at(id);
  PointDistances::Last last;
  return closestPointOf(geometry, point, maxDistance, source->engine() == Engine::BruteForce, last);
}

void SpatialQueries::closestPoints(GeometryId id, std::span<const Eigen::Vector3d> points,
                                   std::span<SurfacePoint> out, double maxDistance) const {
  const Source::Call source(*this);
  checkSizes(points.size(), out.size(), "points");
  checkPoints(points);
  checkLength(maxDistance, "maxDistance", false);
  const Body& geometry = source->at(id);
  const bool bruteForce = source->engine() == Engine::BruteForce;
  forParts(*source, points.size(), [&](std::size_t begin, std::size_t end) {
    PointDistances::Last last;
    for (std::size_t i = begin; i < end; ++i)
      out[i] = closestPointOf(geometry, points[i], maxDistance, bruteForce, last)
                   .value_or(SurfacePoint{id, kNoElement, {}, {0, 0, 0}, {0, 0, 0}, kInfinity});
  });
}

void SpatialQueries::nearestElements(GeometryId id, const Eigen::Vector3d& point, int k,
                                     std::vector<SurfacePoint>& out, double maxDistance) const {
  const Source::Call source(*this);
  checkPoint(point);
  checkLength(maxDistance, "maxDistance", false);
  if (k < 1)
    throw Error(ErrorCode::InvalidSettings, "k is " + std::to_string(k) + "; it must be 1 or more");
  const Body& geometry = source->at(id);
  checkHasElements(geometry);
  const Source::Loan scratch(*source);
  scratch->near.clear();
  if (geometry.tree.ordered().empty()) return out.clear();
  const PointDistances distances(geometry, point, source->engine() == Engine::BruteForce);
  distances.nearest(static_cast<std::size_t>(k), maxDistance, scratch->near);
  out.reserve(scratch->near.size());  // nothing below throws
  out.clear();
  for (const PointDistances::Near& near : scratch->near)
    out.push_back(distances.surfacePoint(near));
}

void SpatialQueries::elementsWithin(GeometryId id, const Eigen::Vector3d& point, double radius,
                                    std::vector<std::uint32_t>& elements) const {
  const Source::Call source(*this);
  checkPoint(point);
  checkLength(radius, "radius", true);
  const Body& geometry = source->at(id);
  checkHasElements(geometry);
  const Source::Loan scratch(*source);
  std::vector<std::uint32_t>& found = scratch->elements;
  found.clear();
  if (!geometry.tree.ordered().empty())
    findWithin(geometry, point, radius, source->engine() == Engine::BruteForce, scratch->nearShape,
               found);
  scratch->giveSorted(elements);
}

}  // namespace palpate
