#include "Shapes/DistinctContacts.h"

#include "Math/NormalCone.h"
#include "Mesh/ExcludedDirections.h"
#include "Mesh/PointMotion.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace palpate {

namespace {

using Eigen::Vector3d;

bool isFirst(const ShapeContact& a, const ShapeContact& b) {
  return std::tie(a.timeOfImpact, a.distance) < std::tie(b.timeOfImpact, b.distance);
}

/// L: the largest extent of the shape along an axis of its own frame, which does not turn with it.
double sizeOf(const Shape& shape, const RigidTransform& pose) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : shape.corners()) box.extend(pose.rotation.transpose() * p);
  return box.sizes().maxCoeff() + 2.0 * shape.radius();
}

/// One pair's mesh, and its shape at the step's end.
class Step {
 public:
  Step(const TriangleMesh& mesh, const Shape& shape, const RigidTransform& before,
       const RigidTransform& now, const PairSettings& settings)
      : m_mesh(mesh),
        m_shape(shape),
        m_before(before),
        m_now(now),
        m_settings(settings),
        m_size(sizeOf(shape, now)) {}

  /// Whether elements around the vertex or edge that holds the contact's point exclude its normal.
  bool isExcluded(const ShapeContact& c) const {
    Segment feature{};
    std::size_t count = 0;
    for (int i = 0; i < 3; ++i) {
      if (c.weights[i] <= 2 * kEdgeWeight) continue;
      if (count == 2) return false;  // in the triangle's interior
      feature[count++] = c.vertices[static_cast<std::size_t>(i)];
    }
    if (count == 1) feature[1] = feature[0];
    return excludesDirection(m_mesh, feature, -c.normal, c.timeOfImpact);
  }

  TangentPlane planeOf(const ShapeContact& c) const {
    Vector3d point = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) point += c.weights[i] * m_mesh.now[c.vertices[i]];
    const double radius = m_mesh.radius(c.vertices, c.weights);
    return {-c.normal, point, radius, c.normal.dot(point - pointOnShape(c)) - radius,
            m_settings.thickness};
  }
  /// The contact's point on the shape, at the step's end.
  Vector3d pointOnShape(const ShapeContact& c) const {
    if (c.timeOfImpact == 1.0 || m_before == m_now) return c.pointOnShape;
    return c.pointOnShape +
           (1 - c.timeOfImpact) * displacementAt(m_before, m_now, c.pointOnShape, c.timeOfImpact);
  }
  /// Whether the whole shape is in front of the plane.
  bool isHeldBy(const TangentPlane& plane) const {
    const Vector3d lowest = m_shape.origin() + m_shape.support(-plane.up, 0.0);
    return plane.hasInFront(lowest, m_shape.isCylinder() ? 0.0 : m_shape.radius());
  }
  bool isIn(const TangentPlane& plane, const ShapeContact& c) const {
    return std::all_of(c.vertices.begin(), c.vertices.end(), [&](std::uint32_t v) {
      return plane.touches(m_mesh.now[v], m_mesh.radius(v));
    });
  }
  /// Whether two contacts have one normal at different points of the shape.
  bool areOfOnePart(const ShapeContact& a, const ShapeContact& b) const {
    return (a.normal - b.normal).norm() <= kSamePartAngle &&
           (pointOnShape(a) - pointOnShape(b)).norm() > kSamePartShare * m_size;
  }
  bool isInTime(const ShapeContact& s, const ShapeContact& c) const {
    return isFirst(s, c) || (s.element == ShapeElement::Face &&
                             s.timeOfImpact <= c.timeOfImpact + m_settings.timeTolerance);
  }

 private:
  const TriangleMesh& m_mesh;
  const Shape& m_shape;
  const RigidTransform &m_before, &m_now;
  const PairSettings& m_settings;
  const double m_size;  ///< L: of the shape
};

}  // namespace

std::size_t DistinctContacts::keep(const TriangleMesh& mesh, const Shape& shape,
                                   const RigidTransform& before, const RigidTransform& now,
                                   const PairSettings& settings, std::span<ShapeContact> contacts) {
  if (settings.contacts == Contacts::All || shape.isPlane()) return contacts.size();
  const Step step(mesh, shape, before, now, settings);
  m_states.resize(contacts.size());
  std::size_t excluded = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    m_states[i] = step.isExcluded(contacts[i]) ? State::Excluded : State::Proper;
    excluded += m_states[i] == State::Excluded;
  }
  for (int planes = 0; planes < kMostPlanes && excluded > 0; ++planes) {
    const ShapeContact* first = nullptr;
    for (std::size_t i = 0; i < contacts.size(); ++i)
      if (m_states[i] == State::Proper && (!first || isFirst(contacts[i], *first)))
        first = &contacts[i];
    if (!first) break;
    TangentPlane plane = step.planeOf(*first);
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      if (m_states[i] != State::Proper) continue;
      const TangentPlane other = step.planeOf(contacts[i]);
      if (!plane.isSameAs(other)) continue;
      m_states[i] = State::OnPlane;
      plane.gap = std::min(plane.gap, other.gap);
    }
    if (!step.isHeldBy(plane)) continue;
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const ShapeContact& c = contacts[i];
      if (m_states[i] != State::Excluded || !step.isInTime(*first, c) || !step.isIn(plane, c) ||
          step.areOfOnePart(*first, c))
        continue;
      m_states[i] = State::Dropped;
      --excluded;
    }
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (m_states[i] != State::Dropped) contacts[kept++] = contacts[i];
  return kept;
}

}  // namespace palpate
