#include "Contact/DistinctShapeContacts.h"

#include "Contact/DistinctRule.h"
#include "Mesh/ExcludedDirections.h"
#include "Mesh/PointMotion.h"
#include "Math/NormalCone.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

namespace palpate {

namespace {

using Eigen::Vector3d;

bool isFirst(const ShapeContact& a, const ShapeContact& b) {
  return std::tie(a.timeOfImpact, a.distance) < std::tie(b.timeOfImpact, b.distance);
}

/// L: the largest extent of the shape along an axis of its own frame, which does not turn with it.
double sizeOf(const Shape& shape, const Pose& pose) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : shape.corners()) box.extend(pose.rotation.transpose() * p);
  return box.sizes().maxCoeff() + 2.0 * shape.radius();
}

}  // namespace

/// One pair's mesh, and its shape at the step's end.
class DistinctShapeContacts::Step {
 public:
  Step(const TriangleMesh& mesh, const Shape& shape, const Pose& before, const Pose& now,
       const PairSettings& settings)
      : m_mesh(mesh),
        m_shape(shape),
        m_before(before),
        m_now(now),
        m_settings(settings),
        m_size(sizeOf(shape, now)) {}

  /// Whether elements around the vertex or edge that holds the contact's point exclude its normal.
  bool isExcluded(const ShapeContact& c) const {
    const auto feature = endsOfFeature(c);
    return feature && excludesDirection(m_mesh, *feature, -c.normal, c.timeOfImpact);
  }
  /// The plane in which all triangles around the vertex or edge lie that holds the contact's point,
  /// at the step's end. None if there are fewer than two, or if areas are too small or too large to
  /// be squared twice.
  std::optional<FlatPart> flatPartOf(const ShapeContact& c) const {
    const auto feature = endsOfFeature(c);
    if (!feature) return {};
    Vector3d corner = Vector3d::Zero(), first = corner;  // of the first triangle
    std::size_t count = 0;
    for (const std::uint32_t triangle : m_mesh.topology.vertexTriangles[(*feature)[0]]) {
      const Triangle& corners = m_mesh.topology.elements[triangle];
      if (std::find(corners.begin(), corners.end(), (*feature)[1]) == corners.end()) continue;
      const Vector3d a = m_mesh.now[corners[0]],
                     across = (m_mesh.now[corners[1]] - a).cross(m_mesh.now[corners[2]] - a);
      if (count++ == 0) corner = a, first = across;
      const double most = first.squaredNorm() * across.squaredNorm();
      if (!(most > 0.0 &&
            first.cross(across).squaredNorm() <= kNormalConeError * kNormalConeError * most))
        return {};
    }
    if (count < 2) return {};
    const Vector3d normal = first.stableNormalized();
    return FlatPart{normal, normal.dot(corner)};
  }
  /// Whether the contact's point is on a ridge or a border of a mesh with faces. No part of a shape
  /// is longer than twice its largest extent. A sphere has no straight parts: its row keeps it away
  /// from the whole plane.
  bool isOnRidge(const ShapeContact& c) const {
    const auto feature = endsOfFeature(c);
    const double length = 2.0 * (m_size - (m_shape.isCylinder() ? 0.0 : 2.0 * m_shape.radius()));
    return feature && m_mesh.topology.hasFaces() &&
           hasRidge(m_mesh, *feature, -c.normal, length, m_settings.thickness);
  }
  double slackAt(const Vector3d& x) const {
    return kPlaneShare * m_settings.thickness + kNormalConeError * x.lpNorm<1>();
  }
  Vector3d firstVertexOf(const ShapeContact& c) const { return m_mesh.now[c.vertices[0]]; }
  bool isIn(const FlatPart& part, const Vector3d& x) const {
    return std::abs(part.normal.dot(x) - part.height) <= slackAt(x);
  }
  bool isIn(const FlatPart& part, const ShapeContact& c) const {
    return std::all_of(c.vertices.begin(), c.vertices.end(),
                       [&](std::uint32_t v) { return isIn(part, m_mesh.now[v]); });
  }
  static bool areSame(const FlatPart& a, const FlatPart& b) {
    const double cosine = a.normal.dot(b.normal);
    if (!(std::abs(cosine) > 0.5)) return false;
    return std::abs(a.height - (cosine < 0 ? -b.height : b.height)) <=
               kNormalConeError * std::abs(a.height) &&
           a.normal.cross(b.normal).norm() <= kNormalConeError;
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
    return areIn(plane, m_mesh, c.vertices);
  }
  /// Whether two contacts have one normal at different points of the shape.
  bool areOfOnePart(const ShapeContact& a, const ShapeContact& b) const {
    return (a.normal - b.normal).norm() <= kSamePartAngle &&
           (pointOnShape(a) - pointOnShape(b)).norm() > kSamePartShare * m_size;
  }
  /// Whether `s` is early enough to stand for `c`.
  bool isInTime(const ShapeContact& s, const ShapeContact& c) const {
    return standsInTime(s.element == ShapeElement::Face, s.timeOfImpact, s.distance, c.timeOfImpact,
                        c.distance, m_settings);
  }

 private:
  /// The vertex {v, v} or the edge that holds the contact's point; none in a triangle's interior.
  static std::optional<Segment> endsOfFeature(const ShapeContact& c) {
    Segment feature{};
    std::size_t count = 0;
    for (int i = 0; i < 3; ++i) {
      if (c.weights[i] <= 2 * kEdgeWeight) continue;
      if (count == 2) return {};
      feature[count++] = c.vertices[static_cast<std::size_t>(i)];
    }
    PALPATE_ASSERT(count > 0);
    if (count == 1) feature[1] = feature[0];
    return feature;
  }

  const TriangleMesh& m_mesh;
  const Shape& m_shape;
  const Pose &m_before, &m_now;
  const PairSettings& m_settings;
  const double m_size;  ///< L: of the shape
};

void DistinctShapeContacts::dropAlongFlatParts(const Step& step,
                                               std::span<const ShapeContact> contacts) {
  m_parts.clear();
  m_flat.clear();
  m_sunk.clear();
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const bool isProper = m_states[i] == State::Proper || m_states[i] == State::OnPlane;
    if (isProper && contacts[i].distance < 0)
      m_sunk.push_back({i, step.firstVertexOf(contacts[i])});
    if (m_states[i] != State::Excluded) continue;
    const std::optional<FlatPart> part = step.flatPartOf(contacts[i]);
    if (!part) continue;
    std::size_t number = 0;
    while (number < m_parts.size() && !step.areSame(m_parts[number], *part)) ++number;
    if (number == m_parts.size()) m_parts.push_back(*part);
    m_flat.push_back({number, i});
  }
  std::sort(m_flat.begin(), m_flat.end());
  for (auto first = m_flat.begin(), last = first; first != m_flat.end(); first = last) {
    const std::size_t number = (*first)[0];
    last = std::find_if(first, m_flat.end(), [&](const auto& flat) { return flat[0] != number; });
    const FlatPart& part = m_parts[number];
    const auto steepnessOf = [&](std::size_t i) {
      return std::abs(part.normal.dot(contacts[i].normal));
    };
    m_leading.clear();
    for (const Sunk& sunk : m_sunk)
      if (step.isIn(part, sunk.vertex) && step.isIn(part, contacts[sunk.contact]))
        m_leading.push_back({steepnessOf(sunk.contact), sunk.contact});
    // The steepest come first: few others are looked at.
    std::sort(m_leading.begin(), m_leading.end(), [](const Leading& a, const Leading& b) {
      return std::tuple(-a.steepness, a.contact) < std::tuple(-b.steepness, b.contact);
    });
    for (; first != last; ++first) {
      const std::size_t i = (*first)[1];
      const double least = steepnessOf(i) + kSamePartAngle;
      for (const Leading& other : m_leading) {
        if (!(other.steepness > least)) break;
        if (!step.isInTime(contacts[other.contact], contacts[i])) continue;
        m_states[i] = State::Dropped;
        break;
      }
    }
  }
}

std::size_t DistinctShapeContacts::keep(const TriangleMesh& mesh, const Shape& shape,
                                        const Pose& before, const Pose& now,
                                        const PairSettings& settings,
                                        std::span<ShapeContact> contacts) {
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
          step.areOfOnePart(*first, c) || step.isOnRidge(c))
        continue;
      m_states[i] = State::Dropped;
      --excluded;
    }
  }
  // Of spheres and capsules, the nearest contact alone stands for all others of a flat floor.
  const bool hasSides = shape.isCylinder() || shape.radius() == 0.0;
  if (excluded > 0 && hasSides &&
      std::any_of(contacts.begin(), contacts.end(),
                  [](const ShapeContact& c) { return c.distance < 0; }))
    dropAlongFlatParts(step, contacts);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (m_states[i] != State::Dropped) contacts[kept++] = contacts[i];
  PALPATE_ASSERT(kept > 0 || contacts.empty());  // the first law
  return kept;
}

}  // namespace palpate
