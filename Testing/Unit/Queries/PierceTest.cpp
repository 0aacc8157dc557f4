#include <palpate/OctreeBasedCD.h>
#include <palpate/SpatialQueries.h>

#include "Common/ExpectRefused.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

// SpatialQueries::pierce() tells elements that pierce each other from those that touch.
namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// A floor at z = 0, and three triangles: one through it, one that stands on it, one above it.
struct PiercingScene {
  PiercingScene() {
    const std::vector<Vector3d> corners{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}};
    floor = collisions.addTriangleMesh(corners, std::vector<Triangle>{{0, 1, 2}});
    std::vector<Vector3d> ends;
    std::vector<Triangle> triangles;
    for (const double lowest : {-1.0, 0.0, 0.5}) {
      const auto first = static_cast<std::uint32_t>(ends.size());
      ends.insert(ends.end(), {{0, 0, lowest}, {0.25, 0, 1}, {0, 0.25, 1}});
      triangles.push_back({first, first + 1, first + 2});
    }
    spikes = collisions.addTriangleMesh(ends, triangles);
    line = collisions.addLineMesh(ends, std::vector<Segment>{{0, 1}, {3, 4}});
    points = collisions.addPointSet(ends);
    ball = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 1});
  }
  OctreeBasedCD collisions;
  GeometryId floor, spikes, line, points, ball;
};

TEST(Pierce, OnlyWhatHasPointsOnBothSidesPierces) {
  const PiercingScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  for (std::uint32_t spike = 0; spike < 3; ++spike) {
    EXPECT_EQ(queries.pierce(scene.floor, 0, scene.spikes, spike), spike == 0);
    EXPECT_EQ(queries.pierce(scene.spikes, spike, scene.floor, 0), spike == 0);
  }
  for (std::uint32_t segment = 0; segment < 2; ++segment)
    EXPECT_EQ(queries.pierce(scene.line, segment, scene.floor, 0), segment == 0);
}

TEST(Pierce, BadInputIsRefused) {
  const PiercingScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  expectRefused(
      ErrorCode::UnsupportedMethod, "points, which pierce nothing",
      [&] { queries.pierce(scene.floor, 0, scene.points, 0); }, scene.points);
  expectRefused(
      ErrorCode::UnsupportedMethod, "is a shape",
      [&] { queries.pierce(scene.ball, 0, scene.floor, 0); }, scene.ball);
  expectRefused(
      ErrorCode::IndexOutOfRange, "no element 3",
      [&] { queries.pierce(scene.floor, 0, scene.spikes, 3); }, scene.spikes, 3);
}

}  // namespace
}  // namespace palpate::testing
