// Part of <palpate/SpatialQueries.h>: intervals along a path.
#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "Queries/Containment.h"
#include "Queries/PathIntervals.h"
#include "Queries/QuerySource.h"
#include "Math/Range.h"
#include "Core/Text.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

namespace palpate {

void SpatialQueries::path(std::span<const Eigen::Vector3d> polyline, double radius,
                          std::span<const GeometryId> bodies, std::vector<PathInterval>& inside,
                          std::vector<PathClearance>& outside) const {
  const Source::Call source(*this);
  checkLength(radius, "radius", true);
  if (polyline.size() < 2)
    throw Error(ErrorCode::InvalidSettings, "the path has " + std::to_string(polyline.size()) +
                                                " points; it must have 2 or more");
  for (std::size_t i = 0; i < polyline.size(); ++i)
    if (!isWithinRange(polyline[i]))
      throw Error(ErrorCode::NonFinitePosition, "point " + std::to_string(i) + " of the path is " +
                                                    textOf(polyline[i]) + "; it must be " +
                                                    kRangeRule);
  const Source::Loan scratch(*source);
  PathScratch& found = scratch->path;
  const PathLine path(polyline, found.lengths);
  if (!std::isfinite(path.length()))
    throw Error(ErrorCode::InvalidSettings, "the path's length is not finite");
  const bool bruteForce = source->engine() == Engine::BruteForce;
  const InsideSettings closed;
  found.inside.clear();
  found.outside.clear();
  for (const GeometryId id : bodies) {
    const Body& body = source->at(id);
    const bool isBody = !body.shape && source->prepareIfClosed(body);
    if (body.shape)
      findPathParts(body.shape->now, path, radius, found.parts);
    else
      findPathParts(body, path, radius, bruteForce, scratch->met, found);
    if (isBody && body.solid) addInvertedFaces(body, path, bruteForce, scratch->stack, found);
    const std::size_t before = found.inside.size();
    joinPathParts(
        id, path, found.parts, radius > 0.0 || !isBody,
        [&](const Eigen::Vector3d& point) {
          return isBody && isInside(body, point, closed, source->engine(), scratch->stack);
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

}  // namespace palpate
