#include "Simplify/SimplifyOffset.h"

#include "Mesh/TriangleMesh.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <limits>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Steps towards the centre of the smallest ball around the normals.
constexpr int kSteps = 60;
/// Least cosine between a way and the normals. Longer ways are of no use.
constexpr double kLeastCosine = 0.02;
/// From this cosine on, the mean of the normals is good enough.
constexpr double kGoodCosine = 0.95;

/// The index of the normal with the least component along a direction.
std::size_t worst(std::span<const Vector3d> normals, const Vector3d& direction) {
  std::size_t least = 0;
  for (std::size_t i = 1; i < normals.size(); ++i)
    if (normals[i].dot(direction) < normals[least].dot(direction)) least = i;
  return least;
}

/// The way along the centre of the smallest ball around unit normals has the greatest least
/// component along them. Badoiu and Clarkson, Smaller core-sets for balls, SODA 2003.
OutwardWay wayOf(std::span<const Vector3d> normals, const Vector3d& mean) {
  if (normals.empty()) return {};
  Vector3d centre = mean.stableNormalized();
  double cosine = normals[worst(normals, centre)].dot(centre);
  Vector3d best = centre;
  for (int step = 1; step <= kSteps && cosine < kGoodCosine; ++step) {
    centre += (normals[worst(normals, centre)] - centre) / (step + 1.0);
    const Vector3d direction = centre.stableNormalized();
    const double found = normals[worst(normals, direction)].dot(direction);
    if (!(found > cosine)) continue;
    cosine = found;
    best = direction;
  }
  if (!(cosine >= kLeastCosine)) return {best, std::numeric_limits<double>::infinity()};
  return {best, 1.0 / cosine};
}

}  // namespace

Vector3d unitNormal(std::span<const Vector3d> positions, const Triangle& triangle) {
  const Vector3d& a = positions[triangle[0]];
  return (positions[triangle[1]] - a).cross(positions[triangle[2]] - a).stableNormalized();
}

std::vector<OutwardWay> outwardWays(std::span<const Vector3d> positions,
                                    std::span<const Triangle> triangles,
                                    std::span<const std::int8_t> sides) {
  const IndexLists around = listsByKey(positions.size(), [&](auto&& add) {
    for (std::uint32_t t = 0; t < triangles.size(); ++t)
      for (const std::uint32_t v : triangles[t]) add(v, t);
  });
  PALPATE_ASSERT(sides.size() == triangles.size());
  std::vector<Vector3d> normalOf(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t)
    normalOf[t] = sides[t] * unitNormal(positions, triangles[t]);
  std::vector<OutwardWay> ways(positions.size());
  std::vector<Vector3d> normals;
  for (std::uint32_t v = 0; v < positions.size(); ++v) {
    normals.clear();
    Vector3d mean = Vector3d::Zero();
    for (const std::uint32_t t : around[v]) {
      if (normalOf[t].isZero(0.0)) continue;
      normals.push_back(normalOf[t]);
      mean += normalOf[t];
    }
    ways[v] = wayOf(normals, mean);
  }
  return ways;
}

}  // namespace palpate
