#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/TestGeometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// The sum of the normals of all triangles that hold the point, at a vertex weighted by their
/// angles.
Vector3d truthOf(const Mesh& mesh, const SurfacePoint& at) {
  Vector3d sum = Vector3d::Zero();
  for (const Triangle& t : mesh.triangles) {
    bool holds = true;
    double angle = 1.0;
    for (int i = 0; i < 3; ++i) {
      if (at.weights[i] == 0.0) continue;
      const auto found = std::find(t.begin(), t.end(), at.vertices[static_cast<std::size_t>(i)]);
      if (found == t.end()) {
        holds = false;
        break;
      }
      if (at.weights[i] != 1.0) continue;
      const auto corner = static_cast<std::size_t>(found - t.begin());
      const Vector3d u = mesh.positions[t[(corner + 1) % 3]] - mesh.positions[t[corner]],
                     v = mesh.positions[t[(corner + 2) % 3]] - mesh.positions[t[corner]];
      angle = std::atan2(u.cross(v).norm(), u.dot(v));
    }
    if (!holds) continue;
    const Vector3d a = mesh.positions[t[0]];
    sum += angle * (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a).normalized();
  }
  return sum.normalized();
}

/// A bumpy closed body, seen from points on, near and far from it.
TEST(SurfaceNormals, AreAngleWeighted) {
  Random random(301);
  Mesh body = sphere(10, 14, {0.5, 0.5, 0.5}, 0.4);
  for (Vector3d& p : body.positions) p += randomPoint(random, -0.02, 0.02);
  OctreeBasedCD collisions;
  const GeometryId id = collisions.addTriangleMesh(body.positions, body.triangles);
  const SpatialQueries queries = collisions.queries();
  std::array<std::size_t, 4> features{};
  const auto compare = [&](const Vector3d& point) {
    const SurfacePoint found = *queries.closestPoint(id, point);
    ++features[static_cast<std::size_t>((found.weights.array() != 0.0).count())];
    EXPECT_NEAR(found.normal.norm(), 1.0, 1e-15);
    EXPECT_LE((found.normal - truthOf(body, found)).norm(), 1e-11);
  };
  for (int repeat = 0; repeat < casesOf(2000); ++repeat) compare(randomPoint(random, -0.5, 1.5));
  for (const Vector3d& vertex : body.positions) {
    compare(vertex);
    EXPECT_EQ(queries.closestPoint(id, vertex)->distance, 0.0);
  }
  EXPECT_GE(features[1], leastOf(100));
  EXPECT_GE(features[2], leastOf(50));
  EXPECT_GE(features[3], leastOf(50));
}

/// Baerentzen and Aanaes: the angle-weighted normal tells inside from outside.
TEST(SurfaceNormals, TellTheSide) {
  Random random(302);
  Mesh body = sphere(10, 14, {0.5, 0.5, 0.5}, 0.4);
  for (Vector3d& p : body.positions) p += randomPoint(random, -0.02, 0.02);
  OctreeBasedCD collisions;
  const GeometryId id = collisions.addTriangleMesh(body.positions, body.triangles);
  const SpatialQueries queries = collisions.queries();
  for (int repeat = 0; repeat < casesOf(2000); ++repeat) {
    const Vector3d point = randomPoint(random, 0, 1);
    const SignedDistance found = queries.signedDistance(id, point);
    const double side = found.nearest.normal.dot(point - found.nearest.position);
    if (std::abs(found.distance) > 1e-9) {
      EXPECT_EQ(side > 0.0, found.distance > 0.0) << repeat;
    }
  }
}

TEST(SurfaceNormals, OfLinesPointsAndShapes) {
  OctreeBasedCD collisions;
  const std::vector<Vector3d> ends{{0, 0, 0}, {2, 0, 0}};
  const GeometryId line = collisions.addLineMesh(ends, std::vector<Segment>{{0, 1}}, 0.1),
                   points = collisions.addPointSet(ends, 0.1),
                   box = collisions.addAnalyticalGeometry(Box{{0, 0, 0}, {1, 1, 1}});
  collisions.setTransform(box, {Eigen::Matrix3d::Identity(), {10, 0, 0}});
  const SpatialQueries queries = collisions.queries();
  EXPECT_EQ(queries.closestPoint(line, {1, 0, 3})->normal, Vector3d(0, 0, 1));
  const Vector3d across = queries.closestPoint(line, {1, 0, 0})->normal;
  EXPECT_EQ(across.norm(), 1.0);
  EXPECT_EQ(across.x(), 0.0);
  EXPECT_EQ(queries.closestPoint(points, {0, -3, 0})->normal, Vector3d(0, -1, 0));
  EXPECT_EQ(queries.closestPoint(points, {0, 0, 0})->normal.norm(), 1.0);
  EXPECT_EQ(queries.closestPoint(box, {12, 0, 0})->normal, Vector3d(1, 0, 0));
  const GeometryDistance found = queries.distance(line, box);
  EXPECT_EQ(found.a.normal, Vector3d(1, 0, 0));
  EXPECT_EQ(found.b.normal, Vector3d(-1, 0, 0));
}

/// Faces back to back cancel, and a triangle without area has no normal: there is a unit one still.
TEST(SurfaceNormals, OfDegenerateMeshes) {
  OctreeBasedCD collisions;
  const std::vector<Vector3d> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}};
  const GeometryId doubled = collisions.addTriangleMesh(
                       corners, std::vector<Triangle>{{0, 1, 2}, {0, 2, 1}}),
                   flat = collisions.addTriangleMesh(corners, std::vector<Triangle>{{0, 1, 3}});
  const SpatialQueries queries = collisions.queries();
  for (const Vector3d& p : {Vector3d(0, 0, 0), Vector3d(0.5, -1, 0), Vector3d(0.2, 0.2, 1)}) {
    EXPECT_EQ(queries.closestPoint(doubled, p)->normal, Vector3d(0, 0, 1));
    EXPECT_EQ(queries.closestPoint(flat, p)->normal.norm(), 1.0);
  }
}

}  // namespace
}  // namespace palpate::testing
