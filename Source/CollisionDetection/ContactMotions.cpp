// Part of <palpate/ConstraintRows.h>: contact motions and tangents.
#include <palpate/ConstraintRows.h>
#include <palpate/Error.h>

#include "Contact/ContactLists.h"
#include "Contact/Contents.h"
#include "Mesh/PointMotion.h"
#include "Mesh/Rotation.h"
#include "Math/Tolerances.h"
#include "Core/FloatingPoint.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

namespace palpate {

namespace {

using Eigen::Vector3d;

struct VertexMotion {
  Vector3d position, displacement;  ///< L; at the contact's time, and over the step
  double radius;                    ///< L
};

/// name: "a" or "b", for messages.
VertexMotion motionOf(const ContactSide& side, const char* name, std::uint32_t vertex,
                      double time) {
  const auto& [first, before, now] = side.vertices;
  if (vertex >= before.size() || vertex >= now.size())
    throw Error(ErrorCode::WrongPositionCount,
                "appendMotions(): a contact refers to vertex " + std::to_string(vertex) + " of " +
                    name + ", which has " + std::to_string(before.size()) +
                    " positions before and " + std::to_string(now.size()) + " now",
                {}, vertex);
  const std::span<const double> radii = side.radii;
  return {(1 - time) * before[vertex] + time * now[vertex], now[vertex] - before[vertex],
          radii.empty() ? 0.0 : radii[radii.size() == 1 ? 0 : vertex]};
}

void checkRadiusCount(const ContactSide& side, const char* name) {
  const std::size_t count = side.radii.size();
  if (count > 1 && count != side.vertices.now.size())
    throw Error(ErrorCode::InvalidRadius,
                "appendMotions(): " + std::string(name) + " has " + std::to_string(count) +
                    " radii and " + std::to_string(side.vertices.now.size()) +
                    " positions; it must have none, one, or one for each position");
}

/// A weighted sum of the vertices on one side of a contact.
struct SideSum {
  Vector3d position = Vector3d::Zero(), displacement = Vector3d::Zero();
  double radius = 0;

  void add(double weight, const VertexMotion& vertex) {
    position += weight * vertex.position;
    displacement += weight * vertex.displacement;
    radius += weight * vertex.radius;
  }
};

}  // namespace

void appendMotions(const CollisionData& contacts, const ContactSide& a, const ContactSide& b,
                   std::vector<ContactMotion>& motions) {
  const StandardFloatingPoint standard;
  const auto nameOf = [&](const ContactSide& side) { return &side == &a ? "a" : "b"; };
  const std::size_t initialSize = motions.size();
  const RigidMotion motionA = withExactRotations(a.motion), motionB = withExactRotations(b.motion);

  const auto add = [&](ContactKind kind, const auto& contact) {
    const auto [vertices, weights] = stencil(contact);
    const auto sides = sidesOf(kind);
    SideSum one, other;  // one: of the side that the normal points to
    for (std::size_t i = 0; i < 4; ++i) {
      const ContactSide& side = sides[i] == 0 ? a : b;
      (sides[i] == sides[0] ? one : other)
          .add(std::abs(weights[i]),
               motionOf(side, nameOf(side), vertices[i], contact.timeOfImpact));
    }
    motions.push_back({one.position - one.radius * contact.normal,
                       other.position + other.radius * contact.normal,
                       one.displacement - other.displacement});
  };
  try {
    checkRadiusCount(a, "a");
    checkRadiusCount(b, "b");
    forEachMeshList(CollisionData::Contents::read(contacts),
                    [&](ContactKind kind, const auto& list) {
                      for (const auto& contact : list) add(kind, contact);
                    });
    if (!contacts.shape().empty() && !a.vertices.now.empty() && !b.vertices.now.empty())
      throw Error(ErrorCode::WrongPositionCount,
                  "appendMotions(): both sides have positions, but one of them is a shape, or a "
                  "body whose distance field answered; leave that one empty");
    const ContactSide& mesh = a.vertices.now.empty() ? b : a;
    const RigidMotion& body = &mesh == &a ? motionB : motionA;
    for (const ShapeContact& contact : contacts.shape()) {
      SideSum sum;
      for (int i = 0; i < 3; ++i)
        sum.add(contact.weights[i],
                motionOf(mesh, nameOf(mesh), contact.vertices[i], contact.timeOfImpact));
      motions.push_back(
          {contact.point - sum.radius * contact.normal, contact.pointOnShape,
           sum.displacement -
               displacementAt(body.before, body.now, contact.pointOnShape, contact.timeOfImpact)});
    }
    for (const ShapeShapeContact& contact : contacts.shapeShape())
      motions.push_back(
          {contact.pointA, contact.pointB,
           displacementAt(motionA.before, motionA.now, contact.pointA, contact.timeOfImpact) -
               displacementAt(motionB.before, motionB.now, contact.pointB, contact.timeOfImpact)});
  } catch (...) {
    motions.erase(motions.begin() + static_cast<std::ptrdiff_t>(initialSize), motions.end());
    throw;
  }
}

Tangents tangentsOf(const Vector3d& normal) {
  const StandardFloatingPoint standard;
  const double x = normal.x(), y = normal.y(), z = normal.z();
  double xx, xy, yy;  // x², x y and y² over 1 + z
  if (z >= 0) {
    const double scale = 1 / (1 + z);
    xx = x * x * scale, xy = x * y * scale, yy = y * y * scale;
  } else {
    // 1 + z = (x² + y²) / (1 - z). x and y are divided by the larger one, so that no square
    // underflows.
    const double most = std::max(std::abs(x), std::abs(y));
    const double u = most > 0 ? x / most : 1, v = most > 0 ? y / most : 0;
    const double scale = (1 - z) / (u * u + v * v);
    xx = u * u * scale, xy = u * v * scale, yy = v * v * scale;
  }
  return {Vector3d(1 - xx, -xy, -x), Vector3d(-xy, 1 - yy, -y)};
}

Tangents tangentsOf(const Vector3d& normal, const Tangents& previous) {
  const StandardFloatingPoint standard;
  const Vector3d previousNormal = previous[0].cross(previous[1]);
  if (!(previousNormal.squaredNorm() > 0.5)) return tangentsOf(normal);  // NaN as well
  // For vectors perpendicular to the previous normal, the rotation from the previous normal to the
  // normal equals the reflection that swaps the previous normal with the negated normal.
  const Vector3d middle = previousNormal + normal;
  const double lengthSquared = middle.squaredNorm();
  Vector3d first = previous[0];
  if (lengthSquared > kOppositeSquare) first -= 2 * middle.dot(first) / lengthSquared * middle;
  first -= normal.dot(first) * normal;  // removes the rounding error along the normal
  first /= first.norm();
  return {first, normal.cross(first)};
}

}  // namespace palpate
