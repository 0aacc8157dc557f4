#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"
#include "Common/ShapeTruth.h"

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <vector>

// SpatialQueries::contacts() of a RigidMesh, compared with a frame that has the mesh as a geometry.
namespace palpate::testing {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

bool sameContacts(const CollisionData& a, const CollisionData& b) { return a.hash() == b.hash(); }

/// A ball, a sheet with its winding, the surface of a placed body, lines and points.
struct ToolScene {
  explicit ToolScene(Engine engine = Engine::Octree)
      : collisions({.engine = engine, .threads = 1}), tool(toolMesh.positions, toolMesh.triangles) {
    const Mesh ball = sphere(10, 12, {0.5, 0.5, 0.5}, 0.3), plain = sheet(10, 0.5, 0);
    bodies.push_back(collisions.addTriangleMesh(ball.positions, ball.triangles));
    bodies.push_back(collisions.addTriangleMesh(plain.positions, plain.triangles));
    bodies.push_back(collisions.addTriangleMesh(plain.positions, plain.triangles));
    collisions.setTransform(
        bodies[2],
        {Eigen::AngleAxisd(0.5, Vector3d::UnitX()).toRotationMatrix(), {0.1, 0.2, -0.1}});
    std::vector<Segment> segments;
    for (std::uint32_t i = 0; i < 40; ++i) segments.push_back({i, i + 1});
    bodies.push_back(collisions.addLineMesh(plain.positions, segments, 0.02));
    bodies.push_back(collisions.addPointSet(ball.positions, 0.01));
  }

  const Mesh toolMesh = sphere(5, 6, {0, 0, 0}, 0.1);
  OctreeBasedCD collisions;
  RigidMesh tool;
  std::vector<GeometryId> bodies;
};

TEST(RigidMesh, HasTheContactsOfAPair) {
  constexpr double kThickness = 0.03;
  for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
    ToolScene scene(engine);
    OctreeBasedCD& collisions = scene.collisions;
    collisions.setDisabledElements(scene.bodies[1], std::vector<std::uint32_t>{3, 4, 90, 91, 92});
    const GeometryId tool =
        collisions.addTriangleMesh(scene.toolMesh.positions, scene.toolMesh.triangles);
    for (const GeometryId body : scene.bodies)
      collisions.addCollisionPair(body, tool, {Method::Proximity, kThickness});
    Random random(5);
    std::size_t found = 0;
    CollisionData contacts;
    for (int i = 0; i < (engine == Engine::Octree ? 100 : 20); ++i) {
      const Matrix3d rotation = randomTurn(random);
      const Vector3d translation = randomPoint(random, 0.1, 0.9);
      collisions.setTransform(tool, {rotation, translation});
      collisions.detectCollision();
      collisions.publish();
      const auto snapshot = collisions.latestSnapshot();
      for (const GeometryId body : scene.bodies) {
        const CollisionData& expected = collisions.collisionData(body, tool);
        collisions.queries().contacts(body, scene.tool, {rotation, translation}, kThickness,
                                      contacts);
        EXPECT_TRUE(sameContacts(contacts, expected));
        EXPECT_EQ(contacts.validity().atEnd, expected.validity().atEnd);
        snapshot->queries().contacts(body, scene.tool, {rotation, translation}, kThickness,
                                     contacts);
        EXPECT_TRUE(sameContacts(contacts, expected));
        found += contacts.validity().atEnd;
      }
      collisions.advance();
    }
    EXPECT_GT(found, 500u);
  }
}

TEST(RigidMesh, HeedsSidedness) {
  ToolScene scene;
  const GeometryId body = scene.bodies[0], tool = scene.collisions.addTriangleMesh(
                                               scene.toolMesh.positions, scene.toolMesh.triangles);
  scene.collisions.setCollisionFilter(body, {.sidedness = Sidedness::Outer});
  scene.collisions.addCollisionPair(body, tool, {Method::Proximity, 0.05});
  const Vector3d inside(0.5, 0.5, 0.68);
  scene.collisions.setTransform(tool, {Matrix3d::Identity(), inside});
  scene.collisions.detectCollision();
  scene.collisions.publish();
  const CollisionData& expected = scene.collisions.collisionData(body, tool);
  CollisionData contacts;
  scene.collisions.latestSnapshot()->queries().contacts(
      body, scene.tool, {Matrix3d::Identity(), inside}, 0.05, contacts);
  EXPECT_TRUE(sameContacts(contacts, expected));
  scene.collisions.setCollisionFilter(body, {});
  scene.collisions.publish();
  scene.collisions.latestSnapshot()->queries().contacts(
      body, scene.tool, {Matrix3d::Identity(), inside}, 0.05, contacts);
  EXPECT_GT(contacts.validity().atEnd, expected.validity().atEnd);
}

TEST(RigidMesh, RefusesInvalidInput) {
  ToolScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  CollisionData out;
  const auto contacts = [&](GeometryId id, const Matrix3d& rotation, double thickness) {
    queries.contacts(id, scene.tool, {rotation, {0, 0, 0}}, thickness, out);
  };
  const Matrix3d unit = Matrix3d::Identity();
  expectRefused(ErrorCode::InvalidTransform, "the query's mesh",
                [&] { contacts(scene.bodies[0], 2 * unit, 0.1); });
  expectRefused(ErrorCode::InvalidSettings, "thickness",
                [&] { contacts(scene.bodies[0], unit, -1); });
  expectRefused(ErrorCode::InvalidSettings, "thickness",
                [&] { contacts(scene.bodies[0], unit, kInfinity); });
  expectRefused(ErrorCode::UnknownGeometry, "geometry 77",
                [&] { contacts(GeometryId{77}, unit, 0.1); });
  const std::vector<Triangle> wrong{{0, 1, 99}};
  expectRefused(ErrorCode::IndexOutOfRange, "vertex index 99",
                [&] { RigidMesh(scene.toolMesh.positions, wrong); });
  const RigidMesh taken = std::move(scene.tool);
  expectRefused(ErrorCode::InvalidCall, "moved from",
                [&] { contacts(scene.bodies[0], unit, 0.1); });
  const GeometryId shape = scene.collisions.addAnalyticalGeometry(Sphere{});
  scene.tool = RigidMesh(scene.toolMesh.positions, scene.toolMesh.triangles);
  expectRefused(ErrorCode::UnsupportedMethod, "is a shape", [&] {
    scene.collisions.queries().contacts(shape, scene.tool, {unit, {0, 0, 0}}, 0.1, out);
  });
}

TEST(RigidMesh, WithoutTrianglesOrFarAwayHasNoContacts) {
  ToolScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  RigidMesh empty({}, {});
  CollisionData out;
  for (const Vector3d& at : {Vector3d(0.5, 0.5, 0.5), Vector3d(1e9, 0, 0)})
    for (const GeometryId body : scene.bodies) {
      queries.contacts(body, empty, {Matrix3d::Identity(), at}, 0.1, out);
      EXPECT_EQ(out.validity().atEnd, 0u);
    }
  queries.contacts(scene.bodies[0], scene.tool, {Matrix3d::Identity(), {1e9, 0, 0}}, 0.1, out);
  EXPECT_EQ(out.validity().atEnd, 0u);
}

}  // namespace
}  // namespace palpate::testing
