#include "Simplify/SimplifyCertificate.h"

#include "Queries/Containment.h"
#include "Queries/PointDistances.h"
#include "Mesh/Corners.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Most halvings of a triangle's edges.
constexpr int kMostDepth = 7;
/// Relative to the largest coordinate. A corner of a part of a triangle is off by at most
/// kMostDepth roundings of each coordinate, 2^-53 each; any point of the part by at most those of
/// its corners.
constexpr double kPartError = 0x1p-48;
/// Relative error of a length that is computed from rounded differences, with a margin.
constexpr double kLengthError = 0x1p-48;
/// Triangles below are tried at this share of the largest distance, so that roundings do not exceed
/// it.
constexpr double kBelowShare = 1.0 - 0x1p-16;

}  // namespace

SimplifyCertificate::SimplifyCertificate(const Body& geometry, double maxDistance, double largest)
    : m_geometry(geometry),
      m_frame(geometry),
      m_maxDistance(maxDistance),
      m_slack(kPartError * (largest + maxDistance)) {
  PALPATE_ASSERT(geometry.tree.isValid() && maxDistance > 0.0 && largest >= 0.0);
}

/// Calls f with the place of each triangle that has a point in common with this one, until f
/// returns false.
template <class F>
void SimplifyCertificate::forEachTouched(const Corners& triangle, PointQueryStack& stack,
                                         F&& f) const {
  FloatBox box = m_frame.boxOf(triangle[0]);
  box.add(m_frame.boxOf(triangle[1]));
  box.add(m_frame.boxOf(triangle[2]));
  findOverlapping(m_geometry.tree.octree(), m_frame.map(), box, stack);
  SignCounts counts;
  for (const std::uint32_t place : stack.found) {
    const Corners other = cornersOf(m_geometry.tree.ordered()[place], m_geometry.mesh.now);
    if (intersectTriangles(triangle, other, counts).intersect() && !f(place)) return;
  }
}

void SimplifyCertificate::findTouched(const Corners& triangle, PointQueryStack& stack,
                                      std::vector<std::uint32_t>& places) const {
  places.clear();
  forEachTouched(triangle, stack, [&](std::uint32_t place) {
    places.push_back(place);
    return true;
  });
}

bool SimplifyCertificate::touches(const Corners& triangle, PointQueryStack& stack) const {
  bool isAny = false;
  forEachTouched(triangle, stack, [&](std::uint32_t) {
    isAny = true;
    return false;
  });
  return isAny;
}

bool SimplifyCertificate::isInside(const Vector3d& point, PointQueryStack& stack) const {
  return palpate::isInside(m_geometry, point, {}, Engine::Octree, stack);
}

SimplifyCertificate::Foot SimplifyCertificate::footOf(const Vector3d& point,
                                                      std::uint32_t likely) const {
  const auto near = PointDistances(m_geometry, point, false).nearest(kInfinity, likely);
  return {point - near->closest.difference, near->distance + near->error, near->place};
}

std::optional<double> SimplifyCertificate::distanceBound(const Corners& triangle,
                                                         PointQueryStack& stack) const {
  PALPATE_ASSERT(!touches(triangle, stack));
  const Foot a = footOf(triangle[0], 0), b = footOf(triangle[1], a.place),
             c = footOf(triangle[2], b.place);
  const auto found = bound(triangle, {a, b, c}, 0, stack);
  PALPATE_ASSERT(!found || *found <= m_maxDistance);
  return found;
}

/// The bound by a triangle that has corresponding points on the other side of the surface.
std::optional<double> SimplifyCertificate::boundBelow(const Corners& triangle, const Corners& below,
                                                      PointQueryStack& stack) const {
  double most = 0.0;
  for (std::size_t i = 0; i < 3; ++i) most = std::max(most, (triangle[i] - below[i]).norm());
  most = most * (1.0 + kLengthError) + m_slack;
  if (!(most <= m_maxDistance) || !isInside(below[0], stack) || touches(below, stack)) return {};
  return most;
}

std::optional<double> SimplifyCertificate::boundOf(const Corners& triangle,
                                                   const std::array<Foot, 3>& feet,
                                                   PointQueryStack& stack) const {
  const double furthest = std::max({feet[0].distance, feet[1].distance, feet[2].distance});
  const double deepest = kBelowShare * m_maxDistance - m_slack;
  const Vector3d normal =
      (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).stableNormalized();
  for (const double depth : {std::min(1.5 * furthest, deepest), deepest}) {
    Corners towardsFeet = triangle, alongNormal = triangle;
    for (std::size_t i = 0; i < 3; ++i) {
      towardsFeet[i] += (feet[i].position - triangle[i]).stableNormalized() * depth;
      alongNormal[i] -= normal * depth;
    }
    if (const auto found = boundBelow(triangle, towardsFeet, stack)) return found;
    if (const auto found = boundBelow(triangle, alongNormal, stack)) return found;
  }
  return {};
}

std::optional<double> SimplifyCertificate::bound(const Corners& triangle,
                                                 const std::array<Foot, 3>& feet, int depth,
                                                 PointQueryStack& stack) const {
  // The distance from one triangle of the mesh is convex, so that it is largest at a corner.
  const Vector3d centre = (triangle[0] + triangle[1] + triangle[2]) / 3.0;
  const Foot foot = footOf(centre, feet[0].place);
  if (foot.distance > 1.001 * m_maxDistance) return {};
  double most = 0.0;
  for (const Vector3d& corner : triangle) {
    const auto near = PointDistances(m_geometry, corner, false).at(foot.place);
    most = std::max(most, near.distance + near.error);
  }
  most = most * (1.0 + kLengthError) + m_slack;
  if (most <= m_maxDistance) return most;
  if (const auto found = boundOf(triangle, feet, stack)) return found;
  if (depth == kMostDepth) return {};
  const auto& [a, b, c] = triangle;
  const Vector3d ab = 0.5 * (a + b), bc = 0.5 * (b + c), ca = 0.5 * (c + a);
  const Foot footAb = footOf(ab, foot.place), footBc = footOf(bc, foot.place),
             footCa = footOf(ca, foot.place);
  most = 0.0;
  const auto add = [&](const Corners& part, const std::array<Foot, 3>& partFeet) {
    const auto found = bound(part, partFeet, depth + 1, stack);
    if (found) most = std::max(most, *found);
    return found.has_value();
  };
  if (add({ab, bc, ca}, {footAb, footBc, footCa}) && add({a, ab, ca}, {feet[0], footAb, footCa}) &&
      add({ab, b, bc}, {footAb, feet[1], footBc}) && add({ca, bc, c}, {footCa, footBc, feet[2]}))
    return most;
  return {};
}

}  // namespace palpate
