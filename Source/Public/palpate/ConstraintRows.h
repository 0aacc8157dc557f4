#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Export.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// A contact as a solver's row: gap(x) = normal . sum of weights[i] x[vertices[i]] - offset.
///
/// Units    the gap is in L. A solver keeps it at least as large as it wants its bodies apart.
/// Laws     (1) with the positions at the contact's timeOfImpact the gap is the contact's distance.
///          (2) the gap's gradient at vertex i is weights[i] normal. There it is the distance's
///          gradient as well, because weights and normal change the distance in the second order
///          only. Two exceptions: radii that differ along an element, where the distance also
///          changes by what the closest point's way along the element changes of the radius; and
///          centres at distance 0, where the distance itself has no gradient and the row has that
///          of the distance along the normal.
///          (3) a step along the row alone, each vertex by a multiple of its inverse mass, its
///          weight and the normal, to a gap g > 0 makes the signed distance g, up to (g + radii)
///          (4 s / h)^2: s is the longest displacement of a vertex of a triangle or an edge, h the
///          triangle's least height, or the shorter edge times the sine between the edges. Where a
///          vertex lies behind a triangle (distance below 0 from Method::Intersection) and an edge
///          or a corner holds the closest point, the vertex comes to the outer side, at a signed
///          distance above 0 and at most g.
struct ConstraintRow {
  std::array<std::uint32_t, 4> vertices;  ///< in the solver's numbering; may repeat
  std::array<double, 4> weights;          ///< 0: not there
  Eigen::Vector3d normal;                 ///< unit
  double offset;                          ///< L

  /// L; positions: of all that the solver numbers.
  PALPATE_EXPORT double gap(std::span<const Eigen::Vector3d> positions) const;
};

/// The vertices of one geometry among those of a solver; a shape has none.
struct SolverVertices {
  std::uint32_t first = 0;                       ///< number of the geometry's vertex 0
  std::span<const Eigen::Vector3d> before, now;  ///< as handed to setPositions()
};

/// Adds a row for each contact of a pair (a, b), in the order vertexTriangle(), triangleVertex(),
/// edgeEdge(), shape(), each at its timeOfImpact, whatever method found it. Of a pair with a shape
/// the side without any positions is the shape.
/// Errors   WrongPositionCount names the first vertex that a contact has and `before` or `now` has
///          not; no row is added.
PALPATE_EXPORT void appendRows(const CollisionData& contacts, const SolverVertices& a,
                               const SolverVertices& b, std::vector<ConstraintRow>& rows);

/// Calls entry(context, row, column, value) for each entry of the rows' Jacobian that is not zero;
/// column: 3 vertex + axis. appendTriplets() is the convenient form.
PALPATE_EXPORT void forEachEntry(std::span<const ConstraintRow> rows,
                                 void (*entry)(void* context, int row, int column, double value),
                                 void* context);

/// The rows' Jacobian of gaps by positions as triplets (row, 3 vertex + axis, value), for a matrix
/// that sums equal places, as Eigen::SparseMatrix::setFromTriplets() does.
/// Needs    Triplet(row, column, value), such as Eigen::Triplet<double>.
template <class Triplet>
void appendTriplets(std::span<const ConstraintRow> rows, std::vector<Triplet>& triplets) {
  forEachEntry(
      rows,
      [](void* context, int row, int column, double value) {
        static_cast<std::vector<Triplet>*>(context)->emplace_back(row, column, value);
      },
      &triplets);
}

/// How setTransform() moves an analytical shape in the step; as it is, the shape stays in its body
/// frame.
struct ShapeMotion {
  Eigen::Matrix3d rotationBefore = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translationBefore = Eigen::Vector3d::Zero();  ///< L
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< L
};

/// One geometry of a pair, for appendMotions().
struct ContactSide {
  SolverVertices vertices{};           ///< of a mesh, lines or points; a shape has none
  std::span<const double> radii = {};  ///< L: none, one for all, or one for each vertex
  ShapeMotion shape{};                 ///< of a shape
};

/// Where a contact is and how its sides slide: what friction and haptics need beside its row. The
/// first side is the one that the normal points to: its weights in the row are positive.
///
/// Units    L. relativeDisplacement is that of the whole step; divided by the step's duration it is
///          the relative velocity.
/// Laws     (1) point - opposite = distance normal, within the error of the contact's own law:
///          of Continuous without a thickness features touch, and both are one point.
///          (2) of two geometries with vertices, normal . relativeDisplacement is the row's gap at
///          `now` less its gap at `before`, within rounding. A direction t in place of the row's
///          normal, with offset 0, is the row of sliding along t.
struct ContactMotion {
  /// On the surface of the first side at the contact's time; of lines and points a radius from the
  /// centre line or centre.
  Eigen::Vector3d point;
  Eigen::Vector3d opposite;  ///< the same of the other side
  /// Of the first side's material at the contact, relative to the other side's, over the step. The
  /// material moves with the contact's weights; lines and points do not spin.
  Eigen::Vector3d relativeDisplacement;
};

/// Adds a motion for each contact of a pair (a, b), in the order of appendRows(); then, where both
/// are shapes, that of shapeShape(), which has no row: its first side is a.
///
/// Time     each contact is at its timeOfImpact. A shape's material there is that of its pose
///          between the two ends, of which each point moves in a straight line.
/// Needs    shapes that turn by less than 90 degrees in the step.
/// Errors   WrongPositionCount as appendRows(), and for a contact with a shape, too; InvalidRadius
///          unless radii are none, one, or one for each vertex. No motion is added.
/// Cost     linear in the contacts; no allocation where the vector has room.
PALPATE_EXPORT void appendMotions(const CollisionData& contacts, const ContactSide& a,
                                  const ContactSide& b, std::vector<ContactMotion>& motions);

/// Two directions that are perpendicular to a unit normal and to each other. In this order, with
/// the normal as the third, they are a right-handed system.
using Tangents = std::array<Eigen::Vector3d, 2>;

/// Tangents by a rule that depends only on the normal: the x and the y axis, turned as the shortest
/// turn from the z axis to the normal turns them.
///
/// Laws     (1) continuous but at the normal -z, which no rule for all normals can avoid: where the
///          normal turns by a small angle e, tangents change by at most 2 e / |normal + z|.
///          (2) tangents are unit and perpendicular within 4 ulp, next to -z as well.
/// Needs    a unit normal.
/// Errors   none; the normal -z has the tangents -x and y.
/// Source   Frisvad, Building an Orthonormal Basis from a 3D Unit Vector Without Normalization
///          (2012). Difference: below the equator 1 + z is taken from x and y, which is exact to
///          rounding next to -z.
PALPATE_EXPORT Tangents tangentsOf(const Eigen::Vector3d& normal);

/// Tangents carried over from an earlier frame: turned as the shortest turn from the previous
/// normal, their cross product, to the normal turns them. Friction that keeps a force or a stretch
/// for each contact takes these.
///
/// Laws     (1) each tangent changes by at most the change of the normal: |t - previous t| <=
///          |normal - previous normal|, within 2^-40. No normal is an exception.
///          (2) tangents are unit and perpendicular within 4 ulp, however many frames they are
///          carried.
///          (3) a normal that comes back by another way may come back with turned tangents: by the
///          solid angle between the ways.
/// Needs    a unit normal. Previous tangents of an earlier call, or zero.
/// Errors   none; previous tangents that are zero or NaN are as none: tangentsOf(normal). Of a
///          normal opposite to the previous one the first tangent stays and the second turns.
PALPATE_EXPORT Tangents tangentsOf(const Eigen::Vector3d& normal, const Tangents& previous);

}  // namespace palpate
