#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/QueryTruth.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <vector>

// contacts(): those of a frame that has the shape or the RigidMesh as a geometry, bit by bit.
namespace palpate::testing {
namespace {

/// The contacts of a frame whose shape is at this pose.
std::vector<ShapeContact> frameContacts(const Both::Add& add, const PlacedShape& shape,
                                        double thickness, Engine engine) {
  OctreeBasedCD collisions(settingsOf(engine));
  const GeometryId body = add(collisions), tool = collisions.addAnalyticalGeometry(shape.geometry);
  collisions.setTransform(tool, {shape.rotation, shape.translation});
  collisions.addCollisionPair(body, tool, {Method::Proximity, thickness, Contacts::Distinct});
  collisions.detectCollision();
  const auto contacts = collisions.collisionData(body, tool).shape();
  return {contacts.begin(), contacts.end()};
}

std::vector<PlacedShape> queriedShapes(Random& random) {
  std::vector<PlacedShape> all;
  for (const AnalyticalGeometry& geometry : shapesOfEveryKind(random))
    all.push_back({geometry, randomTurn(random), randomPoint(random, 0.3, 0.7)});
  return all;
}

void expectFrame(const Both::Add& add, const Both& both, Random& random, std::size_t& count) {
  const SpatialQueries fast = both.octree.queries(), truth = both.bruteForce.queries();
  std::vector<ShapeContact> found(1), expected;
  for (const PlacedShape& shape : queriedShapes(random))
    for (const double thickness : {0.0, 0.04}) {
      fast.contacts(both.id, shape.geometry, {shape.rotation, shape.translation}, thickness, found);
      truth.contacts(both.id, shape.geometry, {shape.rotation, shape.translation}, thickness,
                     expected);
      EXPECT_TRUE(found == expected) << shape.geometry.index();
      EXPECT_TRUE(found == frameContacts(add, shape, thickness, Engine::Octree));
      EXPECT_TRUE(found == frameContacts(add, shape, thickness, Engine::BruteForce));
      for (const ShapeContact& contact : found) EXPECT_EQ(contact.timeOfImpact, 1.0);
      count += found.size();
    }
}

TEST(QueryContacts, AreThoseOfTheFrame) {
  Random random(701);
  for (const TestGeometry& geometry : geometriesOfEveryType(random)) {
    std::size_t count = 0;
    const Positions now = moved(random, geometry.positions, 0.03);
    const Matrix3d turn = randomTurn(random);
    const Vector3d centre(0.5, 0.5, 0.5), shift = centre - turn * centre;
    const Both::Add still = [&](OctreeBasedCD&each) { return geometry.addTo(each); },
                    deformed =
                        [&](OctreeBasedCD&each) {
                          const GeometryId id = geometry.addTo(each);
                          each.update();
                          each.setPositions(id, now);
                          return id;
                        },
                    turned = [&](OctreeBasedCD&each) {
                      const GeometryId id = deformed(each);
                      each.setTransform(id, {turn, shift});
                      return id;
                    };
    for (const Both::Add& add : {still, deformed, turned})
      expectFrame(add, Both(add), random, count);
    EXPECT_GT(count, 300u);
  }
  Solid solid = cells(3, random);
  for (Vector3d& p : solid.positions) p /= 3;
  const Both::Add add = [&](OctreeBasedCD& each) { return addTo(each, solid); };
  std::size_t count = 0;
  expectFrame(add, Both(add), random, count);
  EXPECT_GT(count, 100u);
}

// ---- Contacts of a RigidMesh at thickness 0 ----

/// Whether a corner of one triangle is on the other, or two edges meet, exactly.
bool featuresTouch(const Positions& a, const Positions& b) {
  bool touch = false;
  for (std::size_t i = 0; i < 3; ++i) {
    touch = touch || oracle::vertexTriangle(a[i], b[0], b[1], b[2]).square == 0 ||
            oracle::vertexTriangle(b[i], a[0], a[1], a[2]).square == 0;
    for (std::size_t j = 0; j < 3; ++j)
      touch = touch || oracle::edgeEdge(a[i], a[(i + 1) % 3], b[j], b[(j + 1) % 3]).square == 0;
  }
  return touch;
}

/// Triangles on a lattice, moved by whole numbers and turned by quarters, touch exactly or not.
TEST(QueryContacts, RigidMeshesAtThicknessZeroTouch) {
  Random random(703);
  Matrix3d quarter;
  quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  std::size_t touching = 0, apart = 0;
  CollisionData found, truth;
  for (int i = 0; i < casesOf(1500); ++i) {
    const TestGeometry body = latticeSoup(random, 1, 4), tool = latticeSoup(random, 1, 4);
    const Both both(body);
    RigidMesh mesh(tool.positions, tool.triangles);
    const Matrix3d turn = i % 2 ? quarter : Matrix3d(Matrix3d::Identity());
    const Vector3d from = onLattice(random, 3), shift = onLattice(random, 3) - from;
    both.octree.queries().contacts(both.id, mesh, {turn, shift}, 0.0, found);
    both.bruteForce.queries().contacts(both.id, mesh, {turn, shift}, 0.0, truth);
    EXPECT_EQ(found.hash(), truth.hash());
    const bool touch = featuresTouch(body.positions, placed(tool.positions, turn, shift));
    EXPECT_EQ(found.validity().atEnd > 0, touch) << i;
    const auto expectZero = [](const auto& contacts) {
      for (const auto& contact : contacts) EXPECT_EQ(contact.distance, 0.0);
    };
    expectZero(found.vertexTriangle());
    expectZero(found.triangleVertex());
    expectZero(found.edgeEdge());
    (touch ? touching : apart) += 1;
  }
  EXPECT_GE(touching, leastOf(100));
  EXPECT_GE(apart, leastOf(100));
}

using Eigen::Matrix3d;
using Eigen::Vector3d;

bool sameContacts(const CollisionData& a, const CollisionData& b) { return a.hash() == b.hash(); }

/// A ball, a sheet, the surface of a placed body, lines and points.
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
    collisions.setCollisionFilter(scene.bodies[0], {.sidedness = Sidedness::Outer});
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

TEST(RigidMesh, MayBeEmptyOrFarAwayAndRefusesInvalidInput) {
  ToolScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  CollisionData out;
  RigidMesh empty({}, {});
  for (RigidMesh* mesh : {&empty, &scene.tool})
    for (const GeometryId body : scene.bodies) {
      queries.contacts(body, *mesh, {Matrix3d::Identity(), {1e9, 0, 0}}, 0.1, out);
      EXPECT_EQ(out.validity().atEnd, 0u);
      queries.contacts(body, empty, {Matrix3d::Identity(), {0.5, 0.5, 0.5}}, 0.1, out);
      EXPECT_EQ(out.validity().atEnd, 0u);
    }
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

}  // namespace
}  // namespace palpate::testing
