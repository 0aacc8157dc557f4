#pragma once

#include <palpate/DistanceField.h>
#include <palpate/Settings.h>

#include "Bodies/Body.h"
#include "Octree/PointQueries.h"
#include "Shapes/ShapeContacts.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"

#include <Eigen/Core>

#include <cstdint>
#include <span>

namespace palpate {

class FieldLookup;

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
  /// L: by how much at most a distance in the field's frame is off that from the body's mesh in the
  /// world. It has two parts: the mesh's rotation is not exactly orthonormal, and rounding.
  double placementError() const;

 private:
  const DistanceField& m_field;
  const FieldLookup& m_lookup;
  Pose m_pose;          ///< with an orthonormal rotation
  double m_turned = 0;  ///< the norm of its difference from the rotation of the mesh
};

/// L: distances above this are beyond the band, or may be.
double reachOf(const DistanceField&);
/// L: how far a contact's value may be above the least one of its edge or triangle.
double depthToleranceOf(const DistanceField&);

/// What the contacts of one pair share. Keeps its peak capacity.
struct FieldScratch {
  Buffer<std::uint32_t> elements;  ///< that may be near
  Buffer<std::uint32_t> vertices;  ///< of these elements, each once
  Buffer<std::uint32_t> stamps;    ///< per vertex: the last pair that needed it
  std::uint32_t stamp = 0;
  Buffer<double> values;  ///< L, per vertex: of the field, for `vertices`
  Buffer<double> least;   ///< L, per edge of `elements`: of a contact inside it, or infinity
  /// The element because of which isFurther() was false last. It is tested first.
  std::uint32_t nearest = 0;
};

/// Finds the contacts of a mesh with a field: vertices, edges and triangles with a value of the
/// field, less the radius, of at most the thickness. Edges and triangles are contacts at their
/// deepest point, to within depthToleranceOf(). thickness: L.
///
/// Distinct: an edge is a contact if it is deeper than its ends by more than the tolerance, and a
/// triangle if it is deeper than its vertices and edges by more than that. All: every edge and
/// triangle whose deepest point is within the thickness.
///
/// Call start(), then each of the three other functions for all elements in turn, in any order and
/// by any number of threads.
class FieldContacts {
 public:
  FieldContacts(const TriangleMesh&, const PlacedField&, Contacts, double thickness, FieldScratch&);

  /// Whether the field proves that all points of the mesh are outside the body, and that each is
  /// further from its surface than `distance` and its radius. False also where the band is too
  /// narrow to prove it.
  ///
  /// Law      true if all values, less the radius, exceed the distance by more than the field's
  ///          error bound, depthToleranceOf() and the placement's error.
  /// Cost     that of the elements with smaller values, or near them. False is mostly found at the
  ///          first element.
  bool isFurther(const Body&, double distance);
  /// The same, by the values in every element. Bounds exclude none.
  bool isFurtherByBruteForce(double distance) const;

  /// Finds the elements near the field, and their vertices.
  void start(const Body&);
  /// Looks up the field at scratch.vertices[begin, end).
  void findValues(std::size_t begin, std::size_t end);
  /// Finds contacts of vertices and edges that scratch.elements[begin, end) own.
  void findEdges(std::size_t begin, std::size_t end, ShapeContactBuffers& out);
  /// Finds contacts of the triangles among scratch.elements[begin, end).
  void findFaces(std::size_t begin, std::size_t end, ShapeContactBuffers& out);

  /// The reference: the same contacts of the features that the given elements own, without what
  /// start() finds, and without passing over edges and triangles by bounds.
  static void findByBruteForce(const TriangleMesh&, const PlacedField&, Contacts, double thickness,
                               std::span<const std::uint32_t> elements, ShapeContactBuffers& out);

 private:
  void startValues();

  const TriangleMesh& m_mesh;
  const PlacedField& m_field;
  const Contacts m_contacts;
  const double m_thickness;
  FieldScratch& m_scratch;
};

}  // namespace palpate
