#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Settings.h>

#include "Core/Buffer.h"
#include "Mesh/TriangleMesh.h"
#include "Shapes/PlacedShape.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Contacts with shapes that one worker found, and its scratch.
struct ShapeContactBuffers {
  Buffer<ShapeContact> shape;
  Buffer<ShapeShapeContact> shapeShape;
  ShapePairScratch shapePair;
  std::size_t featurePairs = 0;    ///< tested
  std::size_t exactDecisions = 0;  ///< left to exact arithmetic
};

/// Contacts with the shape of the features that the elements of the mesh own. The settings'
/// method is Proximity or Continuous.
///
/// All: every vertex, edge and triangle at most the thickness and its radius from the shape, at its
/// point nearest to it. Distinct: those of them of which that point is strictly inside.
///
/// Continuous: those within the distance before the step, as Distinct, at time 0; else vertices
/// that come so near to the shape, edges that do to its edges, and triangles to its corners, where
/// the nearest point is then strictly inside: whatever first comes so near is one of them. A plane
/// has no edges and no corners. Edges and triangles come near to a cylinder as a whole.
void findShapeContacts(const TriangleMesh&, const PlacedShape&, const PairSettings&,
                       std::span<const std::uint32_t> elements, ShapeContactBuffers& out);

/// The contact of two shapes, if they are near enough; Continuous: where they first are within the
/// step.
void findShapePair(const PlacedShape& a, const PlacedShape& b, const PairSettings&,
                   ShapeContactBuffers& out);

}  // namespace palpate
