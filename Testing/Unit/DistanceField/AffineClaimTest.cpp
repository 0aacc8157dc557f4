#include "DistanceField/AffineClaim.h"

#include "Common/EverySimdPath.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Mesh/FloatPositions.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace palpate::testing {

using Eigen::Vector3d;

/// Disproves claims with sampled points. Lengths are in the octree's floats, about the centre.
struct ClaimOracle {
  const AffineClaim& claim;
  const AffineClaim::Side& side;
  Vector3d normal{side.normal[0], side.normal[1], side.normal[2]};

  /// H less the level.
  double above(const Vector3d& p) const { return normal.dot(p) + side.atCentre - claim.level; }
  /// Whether a point x of the cell is nearer to y than H(x) - level.
  bool isTooNear(const Vector3d& y) const {
    constexpr int kSteps = 6;
    for (int i = 0; i <= kSteps; ++i)
      for (int j = 0; j <= kSteps; ++j)
        for (int k = 0; k <= kSteps; ++k) {
          const Vector3d x =
              claim.halfSide * (Vector3d(i, j, k) * (2.0 / kSteps) - Vector3d::Ones());
          if ((x - y).norm() < above(x) - 1e-9) return true;
        }
    return false;
  }
  /// Whether the line along the normal through p meets the inside of the cell.
  bool isInShadow(const Vector3d& p) const {
    double first = -1e9, last = 1e9;
    for (int k = 0; k < 3; ++k) {
      const double one = (-claim.halfSide - p[k]) / normal[k],
                   two = (claim.halfSide - p[k]) / normal[k];
      first = std::max(first, std::min(one, two));
      last = std::min(last, std::max(one, two));
    }
    return first < last - 1e-9;
  }
  bool disproves(const Vector3d (&corners)[3]) const {
    constexpr int kSteps = 8;
    if (side.needsDistance)
      for (int i = 0; i <= kSteps; ++i)
        for (int j = 0; i + j <= kSteps; ++j)
          if (isTooNear(corners[0] + (corners[1] - corners[0]) * i / kSteps +
                        (corners[2] - corners[0]) * j / kSteps))
            return true;
    std::vector<Vector3d> ends;  // of the triangle's part in the plane H = level
    for (int i = 0; i < 3; ++i) {
      const Vector3d &p = corners[i], &q = corners[(i + 1) % 3];
      if ((above(p) < 0) != (above(q) < 0))
        ends.push_back(p + (q - p) * (above(p) / (above(p) - above(q))));
    }
    if (side.needsCrossing && ends.size() == 2)
      for (int i = 0; i <= 20; ++i)
        if (isInShadow(ends[0] + (ends[1] - ends[0]) * i / 20)) return true;
    return false;
  }
};

TEST(AffineClaim, HoldsOnlyIfNoSampleDisprovesIt) {
  Random random(1);
  int held = 0, disproved = 0;
  for (int i = 0; i < casesOf(3000, 700); ++i) {
    Body geometry(GeometryId{0});
    std::vector<Vector3d> positions;
    const std::uint32_t triangles = 1 + random() % 12;
    for (std::uint32_t t = 0; t < triangles; ++t) {
      const Vector3d middle = randomPoint(random, -1, 1);
      const double size = uniform(random, 0.02, 0.5);
      for (int k = 0; k < 3; ++k) positions.push_back(middle + size * randomPoint(random, -1, 1));
      geometry.mesh.topology.elements.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    }
    geometry.mesh.topology.vertexCount = positions.size();
    geometry.mesh.now = Positions(positions);
    geometry.mesh.before = geometry.mesh.now;
    geometry.revisions.elements.topology = geometry.revisions.counter.next();
    geometry.tree.sampleFrame(geometry.mesh, geometry.revisions.elements.topology);
    geometry.tree.update(geometry.mesh, geometry.revisions.elements.topology, 1.0, {}, Threads(1));

    AffineClaim claim;
    const Vector3d centre = randomPoint(random, -0.5, 0.5) - geometry.tree.frame().origin;
    claim.centre = {centre[0], centre[1], centre[2]};
    claim.halfSide = uniform(random, 0.02, 0.3);
    claim.level = uniform(random, 0.01, 0.2);
    claim.error = 1e-12;
    claim.reach = 10;
    for (AffineClaim::Side& side : claim.sides) {
      const Vector3d normal = randomPoint(random, -1, 1).normalized();
      side = {{normal[0], normal[1], normal[2]},
              uniform(random, -0.3, 0.5),
              random() % 2 == 0,
              random() % 4 != 0,
              random() % 2 == 0};
    }
    bool isDisproved = false;
    for (const AffineClaim::Side& side : claim.sides)
      for (std::uint32_t t = 0; side.isWanted && t < triangles; ++t) {
        Vector3d corners[3];
        for (std::uint32_t k = 0; k < 3; ++k)
          corners[k] = positions[3 * t + k] - geometry.tree.frame().origin - centre;
        isDisproved = isDisproved || ClaimOracle{claim, side}.disproves(corners);
      }
    const bool holds = claim.holds(geometry);
    ASSERT_FALSE(holds && isDisproved) << "case " << i;
    for (const std::string& path : EverySimdPath()) {
      ASSERT_EQ(claim.holds(geometry), holds) << "case " << i << ", " << path;
    }
    held += holds;
    disproved += isDisproved;
  }
  EXPECT_GT(held, casesOf(75, 17));
  EXPECT_GT(disproved, casesOf(300, 70));
}

}  // namespace palpate::testing
