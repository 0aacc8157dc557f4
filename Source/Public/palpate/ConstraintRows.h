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
/// Units    L. A solver keeps the gap at least h; the depth is h - gap (Docs/HowTo/Solvers.md).
/// Normal   the smooth one of a pair with PairSettings::smoothNormals, else the contact's.
/// Offset   the sum of the radii at the closest points, within rounding. With a shape normal . p
///          plus the element's radius; p is the shape's touched point, where it is at the step's
///          end.
/// End      with Contacts::Distinct a row that would ask for more at the step's end than the
///          features need, or that is smooth, is linearised there instead, unless the features may
///          have met in the step (Docs/HowTo/Solvers.md). Weights, normal and offset may be others
///          than the contact's, and the gap at `now` is the least distance of the features for
///          which the contact stands.
/// Laws     (1) at timeOfImpact the gap is the contact's distance; less normal . d if a shape moves
///          on by d until the step's end. Not of a row at the step's end.
///          (2) the gap's gradient at vertex i is weights[i] normal. It is also the distance's,
///          unless radii differ along an element, the centres coincide, or normals are smooth.
///          (3) a step along this row alone, by inverse masses, to a gap g > 0 gives the signed
///          distance g, up to (g + radii) (4 s / e)^2: s is the longest displacement of a vertex; e
///          the triangle's least height, or the shorter edge times the sine of the edges' angle. A
///          vertex behind a triangle, next to an edge or corner, gets a distance in (0, g]. Not
///          with smooth normals.
struct ConstraintRow {
  /// The solver's numbers. One may occur again with weight 0, or if a triangle names it twice.
  std::array<std::uint32_t, 4> vertices;
  std::array<double, 4> weights;  ///< 0: this vertex does not count
  Eigen::Vector3d normal;         ///< unit
  double offset;                  ///< L

  /// L. Throws WrongPositionCount if there are fewer positions than the row names.
  PALPATE_EXPORT double gap(std::span<const Eigen::Vector3d> positions) const;
};

/// One geometry's vertices in the detected step. Leave it empty for a shape or a field's body.
struct SolverVertices {
  std::uint32_t first = 0;                       ///< the solver's number of vertex 0
  std::span<const Eigen::Vector3d> before, now;  ///< L, in the world, one per vertex
};

/// Appends a row for each contact of (a, b), linearised at its timeOfImpact or, where ConstraintRow
/// says so, at the step's end, in linear time.
/// CollisionData::appendRows() does it with the positions that the OctreeBasedCD has.
/// body     the motion of the pair's shape or field's body, which turns by less than 90 degrees in
///          the step. By default the shape rests from timeOfImpact on.
/// Order    vertexTriangle(), triangleVertex(), edgeEdge(), shape(). shapeShape() has no rows.
/// Errors   WrongPositionCount for the first contact with a vertex without position, and if both
///          sides have positions but shape() has contacts. InvalidCall if the positions are not
///          those of the step: a contact with vertices on both sides then breaks its law by more
///          than 2^-20 of the coordinates. Contacts of Parts may have radii of any length. No row
///          is added then.
PALPATE_EXPORT void appendRows(const CollisionData& contacts, const SolverVertices& a,
                               const SolverVertices& b, std::vector<ConstraintRow>& rows,
                               const RigidMotion& body = {});

/// Calls entry(context, row, 3 vertex + axis, value) for the Jacobian; values at one place add up.
PALPATE_EXPORT void forEachEntry(std::span<const ConstraintRow> rows,
                                 void (*entry)(void* context, int row, int column, double value),
                                 void* context);

/// Appends them as Triplet(row, column, value), such as Eigen::Triplet<double>.
template <class Triplet>
void appendTriplets(std::span<const ConstraintRow> rows, std::vector<Triplet>& triplets) {
  forEachEntry(
      rows,
      [](void* context, int row, int column, double value) {
        static_cast<std::vector<Triplet>*>(context)->emplace_back(row, column, value);
      },
      &triplets);
}

struct ContactSide {
  SolverVertices vertices{};           ///< of a mesh, lines or points; empty for a shape
  std::span<const double> radii = {};  ///< L: none, one for all vertices, or one per vertex
  RigidMotion motion{};                ///< of a shape or a field's body, as setTransform() has it
};

/// The place of a contact and the sliding of its sides. The normal points to the first side.
/// Units    L; relativeDisplacement is that of the whole step.
/// Laws     (1) point - opposite = distance normal, within the contact's error.
///          (2) normal . relativeDisplacement is the row's gap at `now` less that at `before`,
///          within rounding, for two geometries with vertices; also with a tangent and offset 0.
///          Not of a row at the step's end.
struct ContactMotion {
  Eigen::Vector3d point;     ///< on the surface of the first side, at the contact's time
  Eigen::Vector3d opposite;  ///< the same on the other side
  /// Of the first side's material less the other's, at the contact's weights. Lines do not spin.
  Eigen::Vector3d relativeDisplacement;
};

/// Appends a ContactMotion for each contact of (a, b) at its timeOfImpact.
/// Order    that of appendRows(); for two shapes shapeShape(), whose first side is a.
/// Errors   those of appendRows(); InvalidRadius for radii that are not none, one, or one per
///          vertex. No motion is added then.
/// Cost     linear in the contacts. It allocates nothing if the capacity is large enough.
PALPATE_EXPORT void appendMotions(const CollisionData& contacts, const ContactSide& a,
                                  const ContactSide& b, std::vector<ContactMotion>& motions);

/// Perpendicular unit vectors: (first, second, normal) is a right-handed system.
using Tangents = std::array<Eigen::Vector3d, 2>;

/// The x and y axis after the shortest rotation from z to the unit normal; -x and y for -z.
/// Laws     (1) continuous but at -z: if the normal turns by a small angle e, tangents change by at
///          most 2 e / |normal + z|.
///          (2) tangents are unit and perpendicular within 4 ulp, also next to -z.
/// Source   Frisvad, Building an Orthonormal Basis from a 3D Unit Vector Without Normalization
///          (2012). Difference: below the equator 1 + z comes from x and y, for accuracy near -z.
PALPATE_EXPORT Tangents tangentsOf(const Eigen::Vector3d& normal);

/// The previous tangents after the shortest rotation from the previous normal to the unit normal.
/// Laws     (1) |t - previous t| <= |normal - previous normal|, within 2^-40, for every normal.
///          (2) tangents are unit and perpendicular within 4 ulp, over any number of frames.
///          (3) if a normal returns by another path, its tangents turn by the solid angle between.
/// Errors   none. tangentsOf(normal) if the previous tangents are zero or NaN. For opposite normals
///          the first tangent stays and the second turns.
PALPATE_EXPORT Tangents tangentsOf(const Eigen::Vector3d& normal, const Tangents& previous);

}  // namespace palpate
