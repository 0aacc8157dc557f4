#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/EveryQuery.h"

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

struct ToolScene : QueryScene {
  explicit ToolScene(Engine engine) : QueryScene(settingsOf(engine)) {}

  const Mesh toolMesh = sphere(5, 6, {0, 0, 0}, 0.1);
  RigidMesh rigid{toolMesh.positions, toolMesh.triangles};
  const std::vector<GeometryId> bodies{ball, solid, body, open, line, points};
};

TEST(RigidMesh, HasTheContactsOfAPair) {
  constexpr double kThickness = 0.03;
  for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
    ToolScene scene(engine);
    OctreeBasedCD& collisions = scene.collisions;
    collisions.setDisabledElements(scene.open, std::vector<std::uint32_t>{3, 4, 90, 91, 92});
    collisions.setCollisionFilter(scene.ball, {.sidedness = Sidedness::Outer});
    const GeometryId tool = addTo(collisions, scene.toolMesh);
    for (const GeometryId body : scene.bodies)
      collisions.addCollisionPair(body, tool, {Method::Proximity, kThickness});
    Random random(5);
    std::size_t found = 0;
    CollisionData contacts;
    for (int i = 0; i < (engine == Engine::Octree ? 100 : 20); ++i) {
      const Matrix3d rotation = randomTurn(random);
      const Pose pose{rotation, randomPoint(random, 0.1, 0.9)};
      collisions.setTransform(tool, pose);
      collisions.detectCollision();
      collisions.publish();
      const auto snapshot = collisions.latestSnapshot();
      for (const GeometryId body : scene.bodies) {
        const CollisionData& expected = collisions.collisionData(body, tool);
        for (const SpatialQueries& queries : {collisions.queries(), snapshot->queries()}) {
          queries.contacts(body, scene.rigid, pose, kThickness, contacts);
          EXPECT_EQ(contacts.hash(), expected.hash());
          EXPECT_EQ(contacts.validity().atEnd, expected.validity().atEnd);
        }
        found += contacts.validity().atEnd;
      }
      collisions.advance();
    }
    EXPECT_GT(found, 500u);
  }
}

TEST(RigidMesh, MayBeEmptyOrFarAwayAndRefusesInvalidInput) {
  ToolScene scene(Engine::Octree);
  const SpatialQueries queries = scene.collisions.queries();
  CollisionData out;
  RigidMesh empty({}, {});
  for (const GeometryId body : scene.bodies) {
    queries.contacts(body, scene.rigid, {.translation = {1e9, 0, 0}}, 0.1, out);
    EXPECT_EQ(out.validity().atEnd, 0u);
    for (const double x : {0.5, 1e9}) {
      queries.contacts(body, empty, {.translation = {x, 0.5, 0.5}}, 0.1, out);
      EXPECT_EQ(out.validity().atEnd, 0u);
    }
  }
  using enum ErrorCode;
  const auto refused = [&](ErrorCode code, const char* words, GeometryId id, double scale,
                           double thickness) {
    const Matrix3d rotation = scale * Matrix3d::Identity();
    expectRefused(code, words, [&] {
      queries.contacts(id, scene.rigid, {rotation, {0, 0, 0}}, thickness, out);
    });
  };
  refused(InvalidTransform, "the query's mesh", scene.ball, 2, 0.1);
  refused(InvalidSettings, "thickness", scene.ball, 1, -1);
  refused(InvalidSettings, "thickness", scene.ball, 1, kInfinity);
  refused(UnknownGeometry, "geometry 77", GeometryId{77}, 1, 0.1);
  refused(UnsupportedMethod, "is a shape", scene.shape, 1, 0.1);
  const std::vector<Triangle> wrong{{0, 1, 99}};
  expectRefused(IndexOutOfRange, "vertex index 99",
                [&] { RigidMesh(scene.toolMesh.positions, wrong); });
  const RigidMesh taken = std::move(scene.rigid);
  refused(InvalidCall, "moved from", scene.ball, 1, 0.1);
}

}  // namespace
}  // namespace palpate::testing
