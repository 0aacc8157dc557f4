#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Settings.h>

#include "Shapes/PlacedShape.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

namespace palpate {

/// Contacts with shapes that one worker found, and its scratch.
struct ShapeContactBuffers {
  Buffer<ShapeContact> shape;
  Buffer<ShapeShapeContact> shapeShape;
  ShapePairScratch shapePair;
  /// L: no features are nearer than this, less radii and rounding errors; with Continuous at the
  /// step's start, else at its end. Infinity: none is within the thickness.
  double shapeGap = std::numeric_limits<double>::infinity();
  bool shapeSideUnknown = false;   ///< as StepFacts::sideUnknown
  std::size_t featurePairs = 0;    ///< tested
  std::size_t exactDecisions = 0;  ///< left to exact arithmetic

  void clear() {
    shape.clear();
    shapeShape.clear();
    shapeGap = std::numeric_limits<double>::infinity();
    shapeSideUnknown = false;
    featurePairs = exactDecisions = 0;
  }
};

/// Finds the contacts between the shape and the features that the given elements of the mesh own.
/// settings.method must be Proximity or Continuous.
///
/// All: reports every vertex, edge and triangle whose distance from the shape is at most the
/// thickness plus its radius, at its point nearest to the shape. Distinct: reports those of them
/// whose nearest point is strictly inside the feature. DistinctShapeContacts drops some of them.
///
/// Continuous: features within the distance before the step are reported at time 0, as with
/// Distinct. Otherwise, vertices are tested against the shape, edges against its edges, and
/// triangles against its corners. They are reported if they come within the distance at a point
/// strictly inside the feature. Whichever feature of the mesh first comes so near is among them. A
/// plane has no edges and no corners. Edges and triangles are tested against a cylinder as a whole.
void findShapeContacts(const TriangleMesh&, const PlacedShape&, const PairSettings&,
                       std::span<const std::uint32_t> elements, ShapeContactBuffers& out);

/// Finds the contact of two shapes, if they are near enough. Continuous: at the first time of the
/// step at which they are.
void findShapePair(const PlacedShape& a, const PlacedShape& b, const PairSettings&,
                   ShapeContactBuffers& out);

}  // namespace palpate
