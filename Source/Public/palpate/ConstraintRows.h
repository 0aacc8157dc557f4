#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// A contact as a row of a solver: gap(x) = normal . sum of weights[i] x[vertices[i]] - offset.
/// Units    the gap is in L. A solver keeps it at least as large as the distance h that it wants.
///          The depth of the contact at the positions `now` is h - gap(now); the `distance` of the
///          contact is that at timeOfImpact. Docs/HowTo/Solvers.md has the rule for h.
/// Offset   of two geometries with vertices the sum of the radii at the closest points, within
///          rounding. With a shape it is normal . p and the element's radius: p is the point of the
///          shape's surface, as law (1) moves it.
/// Laws     (1) with the positions at the contact's timeOfImpact the gap is the contact's distance.
///          If a shape moves on by d until the step's end, the gap is that less normal . d.
///          (2) the gap's gradient at vertex i is weights[i] normal. At these positions it is also
///          the gradient of the distance, because the motion of the closest points changes the
///          distance only in second order. There are two exceptions. Where radii differ along an
///          element, the distance also changes with the radius at the closest point. Where the
///          centres are at distance 0, the distance has no gradient; the row has that of the
///          distance along the normal.
///          (3) let a step along this row alone bring the gap to g > 0. It moves each vertex by a
///          multiple of its inverse mass, its weight and the normal. Then the signed distance is g,
///          up to (g + radii) (4 s / e)^2. Here s is the longest displacement of a vertex of a
///          triangle or an edge; e is the triangle's least height, or the shorter edge times the
///          sine of the angle between the edges. One case is weaker: a vertex behind a triangle
///          (distance below 0 from Method::Intersection) whose closest point an edge or a corner
///          holds. It comes to the outer side, at a signed distance above 0 and at most g.
struct ConstraintRow {
  /// Numbers of the solver; one may occur several times. Then only its first weight may differ from
  /// 0, unless the mesh has a triangle that names a vertex twice.
  std::array<std::uint32_t, 4> vertices;
  std::array<double, 4> weights;  ///< 0: this vertex does not count
  Eigen::Vector3d normal;         ///< unit
  double offset;                  ///< L

  /// L, at these positions, one for each vertex number of the solver.
  PALPATE_EXPORT double gap(std::span<const Eigen::Vector3d> positions) const;
};

/// The place of one geometry's vertices among those of a solver. Leave it empty for a shape, and
/// for the body whose distance field answered. Both arrays are those of the step that was detected:
/// `before` has the positions at the last advance(), or those that you passed with two arrays.
struct SolverVertices {
  std::uint32_t first = 0;                       ///< the solver's number of vertex 0
  std::span<const Eigen::Vector3d> before, now;  ///< L, in the world, one per vertex
};

/// Appends a row for each contact of a pair (a, b), linearised at its timeOfImpact, whatever method
/// found it. For a pair with a shape or a distance field, leave the SolverVertices of the shape or
/// of the field's body empty. The motion of that body is passed as that of a shape.
///
/// body     the motion of the pair's shape or field's body, as you passed it to setTransform(). Its
/// rows then refer to the shape at the step's end: the
///          point of the shape that the contact touches moves on to there. Without it, the shape
///          counts as at rest from timeOfImpact on, so that gap(now) does not see where it went.
/// Needs    a shape that turns by less than 90 degrees in the step.
/// Order    vertexTriangle(), triangleVertex(), edgeEdge(), shape(). Contacts in shapeShape() have
///          no row.
/// Errors   WrongPositionCount names the first vertex of a contact for which `before` or `now` has
///          no position. WrongPositionCount also if both sides have positions, and contacts are in
///          shape(). No row is added then.
/// Cost     linear in the contacts.
PALPATE_EXPORT void appendRows(const CollisionData& contacts, const SolverVertices& a,
                               const SolverVertices& b, std::vector<ConstraintRow>& rows,
                               const RigidMotion& body = {});

/// Calls entry(context, row, column, value) for each entry that is not 0 of the rows' Jacobian,
/// that is of the gaps' derivatives by the positions. column: 3 vertex + axis. If a row has one
/// vertex twice, the entries of the two add up. appendTriplets() is more convenient.
PALPATE_EXPORT void forEachEntry(std::span<const ConstraintRow> rows,
                                 void (*entry)(void* context, int row, int column, double value),
                                 void* context);

/// Appends the rows' Jacobian as triplets (row, 3 vertex + axis, value). The matrix must sum the
/// values at equal places, as Eigen::SparseMatrix::setFromTriplets() does.
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

/// One geometry of a pair, for appendMotions().
struct ContactSide {
  SolverVertices vertices{};           ///< of a mesh, lines or points; empty for a shape
  std::span<const double> radii = {};  ///< L: none, one for all vertices, or one per vertex
  RigidMotion motion{};                ///< of a shape or a field's body, as setTransform() has it
};

/// The place of a contact and how its two sides slide along each other, for friction and haptics.
/// The first side is the geometry to which the normal points. Its weights in the row are positive.
/// Units    L. relativeDisplacement is that of the whole step. Divide it by the step's duration to
///          get the relative velocity.
/// Laws     (1) point - opposite = distance normal, within the error of the contact's own law. For
///          Continuous without a thickness features touch, and both points are the same.
///          (2) for two geometries with vertices, normal . relativeDisplacement is the row's gap at
///          `now` less its gap at `before`, within rounding. To get the row of sliding along a
///          tangent t, replace the normal by t and the offset by 0.
struct ContactMotion {
  /// On the surface of the first side, at the contact's time. For lines and points this is a radius
  /// away from the centre line or centre.
  Eigen::Vector3d point;
  Eigen::Vector3d opposite;  ///< the same on the other side
  /// The displacement over the step of the first side's material at the contact, minus that of the
  /// other side's material. The material moves with the contact's weights. Lines and points do not
  /// spin about their axes.
  Eigen::Vector3d relativeDisplacement;
};

/// Appends a ContactMotion for each contact of a pair (a, b).
/// Order    that of appendRows(); for two shapes the contact in shapeShape(), whose first side is
///          a.
/// Time     each contact is at its timeOfImpact. At that time a shape is between its two poses;
///          each of its points moves in a straight line.
/// Needs    shapes that turn by less than 90 degrees in the step.
/// Errors   WrongPositionCount as appendRows(); InvalidRadius unless radii are none, one, or one
///          for each vertex. No motion is added then.
/// Cost     linear in the contacts. The function allocates nothing if the vector's capacity is
///          large enough.
PALPATE_EXPORT void appendMotions(const CollisionData& contacts, const ContactSide& a,
                                  const ContactSide& b, std::vector<ContactMotion>& motions);

/// Two unit vectors that are perpendicular to a unit normal and to each other. (first, second,
/// normal) is a right-handed system.
using Tangents = std::array<Eigen::Vector3d, 2>;

/// The tangents of a normal, by a rule that depends on the normal only. The shortest rotation from
/// the z axis to the normal turns the x and the y axis into them.
/// Laws     (1) the rule is continuous except at the normal -z; no rule is continuous everywhere.
///          If the normal turns by a small angle e, tangents change by at most 2 e / |normal + z|.
///          (2) tangents are unit and perpendicular within 4 ulp, also next to -z.
/// Needs    a unit normal.
/// Errors   none; the normal -z has the tangents -x and y.
/// Source   Frisvad, Building an Orthonormal Basis from a 3D Unit Vector Without Normalization
///          (2012). Difference: below the equator 1 + z is taken from x and y, which is exact to
///          rounding next to -z.
PALPATE_EXPORT Tangents tangentsOf(const Eigen::Vector3d& normal);

/// The tangents of a normal that continue those of an earlier frame: the shortest rotation from the
/// previous normal to the normal turns the previous tangents into them. Use it for friction that
/// keeps a force or a stretch for each contact.
/// Laws     (1) each tangent changes by at most the change of the normal: |t - previous t| <=
///          |normal - previous normal|, within 2^-40. This holds for every normal.
///          (2) tangents are unit and perpendicular within 4 ulp, over any number of frames.
///          (3) if a normal returns by another path, its tangents may differ by an angle: the solid
///          angle between the two paths.
/// Needs    a unit normal; tangents from an earlier call, or zero.
/// Errors   none. If the previous tangents are zero or NaN, the result is tangentsOf(normal). If
///          the normal is opposite to the previous one, the first tangent stays and the second
///          turns.
PALPATE_EXPORT Tangents tangentsOf(const Eigen::Vector3d& normal, const Tangents& previous);

}  // namespace palpate
