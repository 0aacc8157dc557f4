#include <palpate/OctreeBasedCD.h>
#include <palpate/StepGuard.h>

#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/TestGeometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

// A StepGuard holds a segment whose radius varies by its pieces, if its largest radius already
// reaches a shape.
namespace palpate::testing {
namespace {

/// Of such a segment from a ball about the origin: the least over the balls about its points.
double clearanceOfTaper(const Positions& ends, const std::array<double, 2>& radii, double ball) {
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k <= 64; ++k) {
    const double w = k / 64.0;
    const Vector3d p = (1 - w) * ends[0] + w * ends[1];
    least = std::min(least, p.norm() - ball - ((1 - w) * radii[0] + w * radii[1]));
  }
  return least;
}

TEST(TaperedSegment, IsHeldByItsPiecesBesideAShape) {
  const std::array radii{0.02, 0.25};
  const double ball = 0.1;
  Random random(64);
  std::size_t held = 0, whole = 0;
  for (int scene = 0; scene < casesOf(400); ++scene) {
    const Positions before{randomPoint(random, -0.5, 0.5), randomPoint(random, -0.5, 0.5)};
    const Positions now = moved(random, before, 0.3);
    const double nearest = clearanceOfTaper(before, {0, 0}, ball);
    if (clearanceOfTaper(before, radii, ball) < 0.02 || nearest > radii[1]) continue;
    OctreeBasedCD collisions;
    const GeometryId line = collisions.addLineMesh(before, std::vector<Segment>{{0, 1}},
                                                   std::vector(radii.begin(), radii.end()));
    const GeometryId shape = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, ball});
    collisions.addCollisionPair(line, shape);
    StepGuard guard(collisions);
    collisions.setPositions(line, before, now);
    guard.hold();
    const Positions ends{collisions.positions(line)[0], collisions.positions(line)[1]};
    for (int i = 0; i <= 16; ++i) {
      const double t = i / 16.0;
      const Positions at{(1 - t) * before[0] + t * ends[0], (1 - t) * before[1] + t * ends[1]};
      EXPECT_GE(clearanceOfTaper(at, radii, ball), 0.0) << "scene " << scene;
    }
    for (const HeldVertex& vertex : guard.held()) EXPECT_GT(vertex.fraction, 0.0);
    held += !guard.held().empty();
    whole += guard.held().empty();
  }
  EXPECT_GE(held, leastOf(10));
  EXPECT_GE(whole, leastOf(10));
}

}  // namespace
}  // namespace palpate::testing
