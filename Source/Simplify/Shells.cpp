#include "Simplify/Shells.h"

#include "Simplify/SimplifyOffset.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <numeric>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Of the longest side: how far from a triangle its sides are looked at.
constexpr double kSideStep = 1e-7;
constexpr std::uint32_t kNoTriangle = 0xffffffff;

}  // namespace

std::vector<std::uint32_t> componentsOf(std::size_t vertices, std::span<const Triangle> triangles) {
  std::vector<std::uint32_t> parents(vertices);
  std::iota(parents.begin(), parents.end(), 0u);
  const auto rootOf = [&](std::uint32_t v) {
    while (parents[v] != v) v = parents[v] = parents[parents[v]];
    return v;
  };
  for (const auto& [a, b, c] : triangles)
    for (const std::uint32_t v : {b, c}) {
      const std::uint32_t one = rootOf(a), two = rootOf(v);
      parents[std::max(one, two)] = std::min(one, two);
    }
  for (std::uint32_t v = 0; v < vertices; ++v) {
    parents[v] = rootOf(v);
    PALPATE_ASSERT(parents[v] <= v);
  }
  return parents;
}

Shells shellsOf(const Body& body, const SimplifyCertificate& certificate) {
  const auto positions = body.mesh.now.body();
  const std::span<const Triangle> triangles = body.mesh.topology.elements;
  Shells shells{componentsOf(positions.size(), triangles),
                std::vector<std::int8_t>(positions.size(), 0),
                std::vector<Vector3d>(positions.size(), Vector3d::Zero())};
  std::vector<std::uint32_t> largest(positions.size(), kNoTriangle);  // triangle of each component
  std::vector<double> areas(positions.size(), 0.0);
  Eigen::AlignedBox3d box;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const auto& [a, b, c] = triangles[t];
    const Vector3d normal = unitNormal(positions, triangles[t]);
    for (const std::uint32_t v : triangles[t]) {
      box.extend(positions[v]);
      shells.normals[v] += normal;
    }
    const double area = (positions[b] - positions[a]).cross(positions[c] - positions[a]).norm();
    const std::uint32_t component = shells.componentOf[a];
    if (largest[component] != kNoTriangle && !(area > areas[component])) continue;
    largest[component] = t;
    areas[component] = area;
  }
  PointQueryStack stack;
  for (const std::uint32_t t : largest) {
    if (t == kNoTriangle) continue;
    const auto& [a, b, c] = triangles[t];
    const Vector3d centre = (positions[a] + positions[b] + positions[c]) / 3.0,
                   step = kSideStep * box.sizes().maxCoeff() * unitNormal(positions, triangles[t]);
    std::int8_t& side = shells.sides[shells.componentOf[a]];
    if (!certificate.isInside(centre + step, stack))
      side = 1;
    else if (!certificate.isInside(centre - step, stack))
      side = -1;
  }
  // Not all shells are inside others.
  if (std::all_of(shells.sides.begin(), shells.sides.end(),
                  [](std::int8_t side) { return side == 0; }))
    std::fill(shells.sides.begin(), shells.sides.end(), std::int8_t{1});
  return shells;
}

}  // namespace palpate
