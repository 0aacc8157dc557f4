#pragma once

#include <palpate/Types.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cstdint>
#include <set>
#include <span>
#include <vector>

namespace palpate::testing {

using Eigen::Vector3d;

/// The definition of a ridge or a border of a triangle mesh, as seen from `direction` by a straight
/// body of some length: an edge is neither if two triangles lie on opposite sides of it, and if a
/// body that rests on both sides, as each of them says, sinks by at most 2^-13 of the thickness. A
/// vertex is neither if no edge at it is one of them. feature: one vertex, or the two of an edge.
struct RidgeTruth {
  const std::vector<Vector3d>& now;
  std::span<const Triangle> triangles;
  double length, thickness;

  bool isOnRidge(const std::set<std::uint32_t>& feature, const Vector3d& direction) const {
    const std::uint32_t p = *feature.begin();
    if (feature.size() == 2) return !isInner(p, *feature.rbegin(), direction);
    for (const Triangle& triangle : triangles) {
      if (std::ranges::find(triangle, p) == triangle.end()) continue;
      for (const std::uint32_t q : triangle)
        if (q != p && !isInner(p, q, direction)) return true;
    }
    return false;
  }

 private:
  bool isInner(std::uint32_t p, std::uint32_t q, const Vector3d& direction) const {
    std::vector<Vector3d> across;  // from the line through the edge to each triangle's third corner
    const Eigen::ParametrizedLine<double, 3> line =
        Eigen::ParametrizedLine<double, 3>::Through(now[p], now[q]);
    for (const Triangle& triangle : triangles) {
      if (std::ranges::find(triangle, p) == triangle.end() ||
          std::ranges::find(triangle, q) == triangle.end())
        continue;
      for (const std::uint32_t r : triangle)
        if (r != p && r != q) across.push_back(now[r] - line.projection(now[r]));
    }
    const auto bendsLittle = [&](const Vector3d& a, const Vector3d& b) {
      if (a.norm() == 0 || b.norm() == 0 || a.dot(b) >= 0) return false;
      Vector3d up = a.cross(line.direction()).normalized();
      if (up.dot(direction) < 0) up = -up;
      const double sine = -up.dot(b.normalized());
      return 0.25 * length * (sine - 1e-11) <= thickness / 8192;
    };
    for (const Vector3d& a : across)
      for (const Vector3d& b : across)
        if (bendsLittle(a, b) && bendsLittle(b, a)) return true;
    return false;
  }
};

}  // namespace palpate::testing
