// Part of <palpate/SpatialQueries.h>: elements that overlap a shape.
#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "Queries/ElementsNearShape.h"
#include "Queries/QuerySource.h"
#include "Queries/ShapeOverlap.h"

#include <algorithm>
#include <optional>
#include <string>
#include <tuple>

namespace palpate {

namespace {

/// Throws InvalidShape or InvalidTransform.
Pose poseOfQuery(const AnalyticalGeometry& shape, const Pose& pose) {
  std::optional<std::size_t> element;
  if (const std::string fault = faultOf(shape, element); !fault.empty())
    throw Error(ErrorCode::InvalidShape, "the query's shape: " + fault, {}, element);
  return checkedPose(pose, "the query's shape");
}

}  // namespace

void SpatialQueries::overlapping(GeometryId id, const AnalyticalGeometry& shape,
                                 const Pose& placement,
                                 std::vector<std::uint32_t>& elements) const {
  const Source::Call source(*this);
  const Pose pose = poseOfQuery(shape, placement);
  const Body& geometry = source->at(id);
  checkHasElements(geometry);
  const Source::Loan scratch(*source);
  std::vector<std::uint32_t>& found = scratch->elements;
  found.clear();
  if (!geometry.tree.ordered().empty())
    findOverlapping(geometry, shape, pose, source->engine() == Engine::BruteForce, scratch->shapes,
                    scratch->nearShape, found);
  scratch->giveSorted(elements);
}

void SpatialQueries::contacts(GeometryId id, const AnalyticalGeometry& shape, const Pose& placement,
                              double thickness, std::vector<ShapeContact>& out) const {
  const Source::Call source(*this);
  const Pose pose = poseOfQuery(shape, placement);
  checkLength(thickness, "thickness", true);
  const Body& geometry = source->at(id);
  checkHasElements(geometry);
  const Source::Loan scratch(*source);
  Buffer<std::uint32_t>& near = scratch->nearShape;
  Buffer<ShapeContact>& found = scratch->shapeContacts.shape;
  near.clear();
  found.clear();
  if (!geometry.tree.ordered().empty()) {
    const PlacedShape& tool = placeAtRest(shape, pose, scratch->shapes);
    if (source->engine() == Engine::BruteForce)
      for (std::uint32_t i = 0; i < geometry.mesh.topology.elements.size(); ++i) near.push_back(i);
    else
      findElementsNear(geometry, tool.now, tool.now, thickness + geometry.mesh.largestRadius, near);
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

}  // namespace palpate
