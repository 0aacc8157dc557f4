#pragma once

#include <palpate/DistanceField.h>
#include <palpate/Settings.h>

#include "Core/Buffer.h"
#include "Mesh/TriangleMesh.h"
#include "Octree/PointQueries.h"
#include "Queries/SearchableGeometry.h"
#include "Shapes/ShapeContacts.h"

#include <Eigen/Core>

#include <cstdint>
#include <span>

namespace palpate {

/// A distance field in the world.
class PlacedField {
 public:
  /// body: the positions of the field's geometry, whose transform places the field. The field must
  /// live as long as this object.
  PlacedField(const DistanceField&, const Positions& body);

  const DistanceField& field() const { return m_field; }
  const FieldLookup& lookup() const { return m_lookup; }
  /// L: the point in the field's frame.
  Eigen::Vector3d inField(const Eigen::Vector3d& world) const;
  /// The unit direction of the gradient at a point of the field's frame, in the world; the last
  /// axis of that frame where the gradient is 0.
  Eigen::Vector3d normalAt(const Eigen::Vector3d& inField) const;
  /// L: a box in the world that holds the field's domain.
  Eigen::AlignedBox3d domain() const;

 private:
  const DistanceField& m_field;
  const FieldLookup& m_lookup;
  RigidTransform m_pose;  ///< with an orthonormal rotation
};

/// L: distances above this are beyond the band, or may be.
double reachOf(const DistanceField&);
/// L: how far a contact's value may be above the least one of its edge or triangle.
double depthToleranceOf(const DistanceField&);

/// What the contacts of one pair share. Keeps its peak capacity.
struct FieldScratch {
  PointQueryStack stack;
  Buffer<std::uint32_t> elements;  ///< that may be near
  Buffer<std::uint32_t> vertices;  ///< of these elements, each once
  Buffer<std::uint32_t> stamps;    ///< per vertex: the last pair that needed it
  std::uint32_t stamp = 0;
  Buffer<double> values;  ///< L, per vertex: of the field, for `vertices`
  Buffer<double> least;   ///< L, per edge of `elements`: of a contact inside it, or infinity
};

/// Finds the contacts of a mesh with a field: vertices, edges and triangles with a value of the
/// field, less the radius, of at most the thickness. Edges and triangles are contacts at their
/// deepest point, to within depthToleranceOf().
///
/// Distinct: an edge is a contact if it is deeper than its ends by more than the tolerance, and a
/// triangle if it is deeper than its vertices and edges by more than that. All: every edge and
/// triangle whose deepest point is within the thickness.
///
/// Call start(), then each of the three other functions for all elements in turn, in any order and
/// by any number of threads.
class FieldContacts {
 public:
  FieldContacts(const TriangleMesh&, const PlacedField&, const PairSettings&, FieldScratch&);

  /// Finds the elements near the field, and their vertices.
  void start(const SearchableGeometry&);
  /// Looks up the field at scratch.vertices[begin, end).
  void findValues(std::size_t begin, std::size_t end);
  /// Finds contacts of vertices and edges that scratch.elements[begin, end) own.
  void findEdges(std::size_t begin, std::size_t end, ShapeContactBuffers& out);
  /// Finds contacts of the triangles among scratch.elements[begin, end).
  void findFaces(std::size_t begin, std::size_t end, ShapeContactBuffers& out);

  /// The reference: the same contacts of the features that the given elements own, without what
  /// start() finds, and without passing over edges and triangles by bounds.
  static void findByBruteForce(const TriangleMesh&, const PlacedField&, const PairSettings&,
                               std::span<const std::uint32_t> elements, ShapeContactBuffers& out);

 private:
  const TriangleMesh& m_mesh;
  const PlacedField& m_field;
  const PairSettings& m_settings;
  FieldScratch& m_scratch;
};

}  // namespace palpate
