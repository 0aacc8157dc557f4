#include <palpate/ConstraintRows.h>
#include <palpate/Error.h>

#include "Mesh/PointMotion.h"
#include "Mesh/Rotation.h"
#include "Core/FloatingPoint.h"

#include <string>

namespace palpate {

Stencil stencil(const EdgeEdgeContact& contact) {
  const StandardFloatingPoint standard;
  return standard.evaluated(
      Stencil{{contact.edgeA[0], contact.edgeA[1], contact.edgeB[0], contact.edgeB[1]},
              {1.0 - contact.weightA, contact.weightA, contact.weightB - 1.0, -contact.weightB}});
}

double ConstraintRow::gap(std::span<const Eigen::Vector3d> positions) const {
  const StandardFloatingPoint standard;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) sum += weights[i] * positions[vertices[i]];
  return standard.evaluated(normal.dot(sum) - offset);
}

void appendRows(const CollisionData& contacts, const SolverVertices& a, const SolverVertices& b,
                std::vector<ConstraintRow>& rows, const RigidMotion& body) {
  const StandardFloatingPoint standard;
  const std::size_t initialSize = rows.size();
  const RigidMotion motion = withExactRotations(body);
  const auto require = [&](const SolverVertices& side, std::uint32_t vertex) {
    if (vertex < side.before.size() && vertex < side.now.size()) return;
    throw Error(ErrorCode::WrongPositionCount,
                "appendRows(): a contact refers to vertex " + std::to_string(vertex) + " of " +
                    (&side == &a ? "a" : "b") + ", which has " +
                    std::to_string(side.before.size()) + " positions before and " +
                    std::to_string(side.now.size()) + " now",
                {}, vertex);
  };
  const auto add = [&](const auto& contact, const Eigen::Vector3d& normal,
                       const std::array<const SolverVertices*, 4>& sides) {
    const auto [vertices, weights] = stencil(contact);
    const double time = contact.timeOfImpact;
    ConstraintRow row{{}, weights, normal, 0.0};
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 4; ++i) {
      const SolverVertices& side = *sides[i];
      require(side, vertices[i]);
      row.vertices[i] = side.first + vertices[i];
      sum += weights[i] * ((1 - time) * side.before[vertices[i]] + time * side.now[vertices[i]]);
    }
    row.offset = normal.dot(sum) - contact.distance;
    rows.push_back(row);
  };
  try {
    // Calls f(contact, normal) with the smooth normals if there are any.
    const auto forEach = [](const auto& list, std::span<const Eigen::Vector3d> smooth, auto&& f) {
      for (std::size_t i = 0; i < list.size(); ++i)
        f(list[i], smooth.empty() ? list[i].normal : smooth[i]);
    };
    forEach(contacts.vertexTriangle(), contacts.smoothVertexTriangle(),
            [&](const auto& contact, const auto& normal) {
              add(contact, normal, {&a, &b, &b, &b});
            });
    forEach(contacts.triangleVertex(), contacts.smoothTriangleVertex(),
            [&](const auto& contact, const auto& normal) {
              add(contact, normal, {&b, &a, &a, &a});
            });
    forEach(contacts.edgeEdge(), contacts.smoothEdgeEdge(),
            [&](const auto& contact, const auto& normal) {
              add(contact, normal, {&a, &a, &b, &b});
            });
    if (!contacts.shape().empty() && !(a.before.empty() && a.now.empty()) &&
        !(b.before.empty() && b.now.empty()))
      throw Error(ErrorCode::WrongPositionCount,
                  "appendRows(): both sides have positions, but one of them is a shape, or a body "
                  "whose distance field answered; leave that one empty");
    const SolverVertices& mesh = a.before.empty() && a.now.empty() ? b : a;  // the other: the shape
    forEach(contacts.shape(), contacts.smoothShape(), [&](const auto& contact, const auto& normal) {
      const auto& [i, j, k] = contact.vertices;
      for (const std::uint32_t vertex : contact.vertices) require(mesh, vertex);
      const std::uint32_t first = mesh.first;
      const double time = contact.timeOfImpact;
      const Eigen::Vector3d rest =
          (1 - time) * displacementAt(motion.before, motion.now, contact.pointOnShape, time);
      rows.push_back({{first + i, first + j, first + k, first + i},
                      {contact.weights[0], contact.weights[1], contact.weights[2], 0.0},
                      normal,
                      normal.dot(contact.point + rest) - contact.distance});
    });
  } catch (...) {
    rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(initialSize), rows.end());
    throw;
  }
}

void forEachEntry(std::span<const ConstraintRow> rows, void (*entry)(void*, int, int, double),
                  void* context) {
  const StandardFloatingPoint standard;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t i = 0; i < 4; ++i) {
      if (rows[r].weights[i] == 0) continue;
      for (int axis = 0; axis < 3; ++axis) {
        entry(context, static_cast<int>(r), static_cast<int>(3 * rows[r].vertices[i] + axis),
              rows[r].weights[i] * rows[r].normal[axis]);
      }
    }
  }
}

}  // namespace palpate
