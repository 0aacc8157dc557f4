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

}  // namespace palpate
