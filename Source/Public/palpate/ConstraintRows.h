#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Error.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace palpate {

/// A contact as a solver's row: gap(x) = normal . sum of weights[i] x[vertices[i]] - offset.
///
/// Units    the gap is in L: the contact's distance at the positions that it was found for, less
///          the radii. A solver keeps it at least as large as it wants its bodies apart.
/// Laws     (1) the gap's gradient at vertex i is weights[i] normal. Where a static method's contact
///          was found it is the distance's as well, as weights and normal change that in the second
///          order only; with radii that differ along an edge it is not.
struct ConstraintRow {
  std::array<std::uint32_t, 4> vertices;  ///< in the solver's numbering; may repeat
  std::array<double, 4> weights;          ///< 0: not there
  Eigen::Vector3d normal;                 ///< unit
  double offset;                          ///< L

  /// L; positions: of all that the solver numbers.
  double gap(std::span<const Eigen::Vector3d> positions) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 4; ++i) sum += weights[i] * positions[vertices[i]];
    return normal.dot(sum) - offset;
  }
};

/// The vertices of one geometry among those of a solver; a shape has none.
struct SolverVertices {
  std::uint32_t first = 0;                       ///< number of the geometry's vertex 0
  std::span<const Eigen::Vector3d> before, now;  ///< as handed to setPositions()
};

/// Adds a row for each contact of a pair (a, b), in the order vertexTriangle(), triangleVertex(),
/// edgeEdge(), shape(). Contacts of Continuous and Auto are at their time of impact, others now.
/// Errors   WrongPositionCount names the first vertex that a contact has and `before` or `now` has
///          not; no row is added.
inline void appendRows(const CollisionData& contacts, const SolverVertices& a,
                       const SolverVertices& b, std::vector<ConstraintRow>& rows) {
  const Method method = contacts.validity().method;
  const bool swept = method == Method::Continuous || method == Method::Auto;
  const std::size_t given = rows.size();
  const auto add = [&](const auto& contact, const std::array<const SolverVertices*, 4>& sides) {
    const auto [vertices, weights] = stencil(contact);
    const double time = swept ? contact.timeOfImpact : 1.0;
    ConstraintRow row{{}, weights, contact.normal, 0.0};
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 4; ++i) {
      const SolverVertices& side = *sides[i];
      if (vertices[i] >= side.before.size() || vertices[i] >= side.now.size()) {
        rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(given), rows.end());
        throw Error(ErrorCode::WrongPositionCount,
                    "appendRows(): a contact has vertex " + std::to_string(vertices[i]) + " of " +
                        (sides[i] == &a ? "a" : "b") + ", which has " +
                        std::to_string(side.before.size()) + " positions before and " +
                        std::to_string(side.now.size()) + " now",
                    {}, vertices[i]);
      }
      row.vertices[i] = side.first + vertices[i];
      sum += weights[i] * ((1 - time) * side.before[vertices[i]] + time * side.now[vertices[i]]);
    }
    row.offset = contact.normal.dot(sum) - contact.distance;
    rows.push_back(row);
  };
  for (const auto& contact : contacts.vertexTriangle()) add(contact, {&a, &b, &b, &b});
  for (const auto& contact : contacts.triangleVertex()) add(contact, {&b, &a, &a, &a});
  for (const auto& contact : contacts.edgeEdge()) add(contact, {&a, &a, &b, &b});
  const std::uint32_t first = a.now.empty() ? b.first : a.first;  // the other is the shape
  for (const ShapeContact& contact : contacts.shape()) {
    const auto& [i, j, k] = contact.vertices;
    rows.push_back({{first + i, first + j, first + k, first + i},
                    {contact.weights[0], contact.weights[1], contact.weights[2], 0.0},
                    contact.normal,
                    contact.normal.dot(contact.point) - contact.distance});
  }
}

/// The rows' Jacobian of gaps by positions as triplets (row, 3 vertex + axis, value), for a matrix
/// that sums equal places, as Eigen::SparseMatrix::setFromTriplets() does.
/// Needs    Triplet(row, column, value), such as Eigen::Triplet<double>.
template <class Triplet>
void appendTriplets(std::span<const ConstraintRow> rows, std::vector<Triplet>& triplets) {
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t i = 0; i < 4; ++i) {
      if (rows[r].weights[i] == 0) continue;
      for (int axis = 0; axis < 3; ++axis) {
        triplets.emplace_back(static_cast<int>(r), static_cast<int>(3 * rows[r].vertices[i] + axis),
                              rows[r].weights[i] * rows[r].normal[axis]);
      }
    }
  }
}

}  // namespace palpate
