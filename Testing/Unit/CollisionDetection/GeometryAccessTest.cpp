#include <palpate/PenetrationTracker.h>

#include "Common/ExpectRefused.h"
#include "Common/QueryCalls.h"
#include "Common/ShapeTruth.h"
#include "Common/TestGeometry.h"

// Functions that read the geometries and pairs of an OctreeBasedCD.

namespace palpate::testing {
namespace {

Positions copyOf(std::span<const Vector3d> positions) {
  return {positions.begin(), positions.end()};
}

TEST(GeometryAccess, ContainsWhatWasAddedAndNotRemoved) {
  OctreeBasedCD collisions;
  EXPECT_FALSE(collisions.has(GeometryId{0}));
  const Mesh mesh = sheet(2, 0.5, 0.0);
  const GeometryId a = addMesh(collisions, mesh), b = collisions.addAnalyticalGeometry(Sphere{});
  EXPECT_TRUE(collisions.has(a) && collisions.has(b));
  collisions.addCollisionPair(a, b);
  collisions.removeGeometry(a);
  EXPECT_FALSE(collisions.has(a));
  EXPECT_TRUE(collisions.has(b));
  EXPECT_TRUE(collisions.pairs().empty());
  EXPECT_FALSE(collisions.has(GeometryId{7}));
  EXPECT_GT(addMesh(collisions, mesh), b);  // no id is reused
  expectRefused(ErrorCode::UnknownGeometry, "geometry 0 was removed",
                [&] { (void)collisions.vertexCount(a); });
}

TEST(GeometryAccess, PositionsAreTheCurrentOnes) {
  Random random(1);
  OctreeBasedCD collisions;
  const Mesh mesh = sheet(3, 0.5, 0.1);
  const GeometryId id = addMesh(collisions, mesh);
  EXPECT_EQ(copyOf(collisions.positions(id)), mesh.positions);
  const Positions next = moved(random, mesh.positions, 0.1);
  collisions.setPositions(id, next);
  EXPECT_EQ(copyOf(collisions.positions(id)), next);
  collisions.setPositions(id, next, mesh.positions);
  EXPECT_EQ(copyOf(collisions.positions(id)), mesh.positions);
  // Positions of a placed body are in its own frame.
  collisions.setTransform(id, {.translation = {1, 2, 3}});
  EXPECT_EQ(copyOf(collisions.positions(id)), mesh.positions);
  EXPECT_EQ(collisions.vertexCount(id), mesh.positions.size());
  const Positions two{{0, 0, 0}, {1, 0, 0}};
  collisions.setTriangles(id, two, {});
  EXPECT_EQ(collisions.vertexCount(id), 2u);
  const GeometryId shape = collisions.addAnalyticalGeometry(Box{{0, 0, 0}, {1, 1, 1}});
  EXPECT_EQ(collisions.vertexCount(shape), 0u);
  EXPECT_TRUE(collisions.positions(shape).empty());
}

TEST(GeometryAccess, BoundsEncloseVerticesWithTheirRadii) {
  Random random(2);
  const TestGeometry line = thread(random, 20, 0.2, 0.0, false);
  const TestGeometry geometries[] = {testing::testGeometry(soup(random, 30, 0.3)), line,
                                     tapered(random, line, 0.1), particles(random, 20, 0.05)};
  for (const TestGeometry& geometry : geometries) {
    OctreeBasedCD collisions;
    const GeometryId id = geometry.addTo(collisions);
    const Positions now = moved(random, geometry.positions, 0.3);
    collisions.setPositions(id, now);
    for (const bool placed : {false, true}) {
      const Eigen::AngleAxisd turn(0.7, Vector3d(1, 2, 3).normalized());
      const Vector3d shift(0.3, -2, 5);
      if (placed) collisions.setTransform(id, {turn.toRotationMatrix(), shift});
      Eigen::AlignedBox3d truth;
      for (std::uint32_t v = 0; v < now.size(); ++v) {
        const Vector3d at = placed ? Vector3d(turn * now[v] + shift) : now[v];
        truth.extend(at + Vector3d::Constant(geometry.radius(v)));
        truth.extend(at - Vector3d::Constant(geometry.radius(v)));
      }
      const Eigen::AlignedBox3d found = collisions.bounds(id);
      EXPECT_LE((found.min() - truth.min()).norm(), 1e-14);
      EXPECT_LE((found.max() - truth.max()).norm(), 1e-14);
    }
  }
  OctreeBasedCD collisions;
  EXPECT_TRUE(collisions.bounds(collisions.addPointSet({})).isEmpty());
}

/// The furthest point of each shape along each axis, from its definition.
TEST(GeometryAccess, BoundsOfShapesAreTight) {
  Random random(3);
  for (const AnalyticalGeometry& shape : shapesOfEveryKind(random)) {
    const PlacedShape placed{shape, randomTurn(random), {0.3, -2, 5}};
    OctreeBasedCD collisions;
    const GeometryId id = collisions.addAnalyticalGeometry(shape);
    collisions.setTransform(id, {placed.rotation, placed.translation});
    const Eigen::AlignedBox3d found = collisions.bounds(id);
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d way = Vector3d::Unit(axis);
      if (std::holds_alternative<Plane>(shape)) {
        EXPECT_EQ(found.max()[axis], std::numeric_limits<double>::infinity());
        EXPECT_EQ(found.min()[axis], -std::numeric_limits<double>::infinity());
      } else {
        EXPECT_NEAR(found.max()[axis], reachOf(placed, way), 1e-13);
        EXPECT_NEAR(found.min()[axis], -reachOf(placed, -way), 1e-13);
      }
    }
  }
}

TEST(GeometryAccess, PairSettingsAreTheLastOnes) {
  OctreeBasedCD collisions;
  const Mesh mesh = sheet(2, 0.5, 0.0);
  const GeometryId a = addMesh(collisions, mesh), b = addMesh(collisions, mesh);
  expectRefused(ErrorCode::UnknownPair, "(0, 1)", [&] { (void)collisions.pairSettings(a, b); });
  collisions.addCollisionPair(a, b, {Method::Proximity, 0.5});
  EXPECT_EQ(collisions.pairSettings(a, b).thickness, 0.5);
  collisions.setPairSettings(a, b, {.method = Method::Continuous, .thickness = 0.25});
  EXPECT_EQ(collisions.pairSettings(a, b).method, Method::Continuous);
  EXPECT_EQ(collisions.pairSettings(a, b).thickness, 0.25);
  expectRefused(ErrorCode::UnknownPair, "was added as",
                [&] { (void)collisions.pairSettings(b, a); });
  EXPECT_EQ(collisions.candidatePairs(b, a), collisions.candidatePairs(a, b));
  collisions.removeCollisionPair(b, a);
  EXPECT_TRUE(collisions.pairs().empty());
}

/// Disabled elements do not collide, but vertices are found inside bodies anyway.
TEST(GeometryAccess, VerticesOfDisabledElementsAreFoundInABody) {
  const Mesh inner = sphere(3, 4, {0.5, 0.5, 0.5}, 0.1), outer = sphere(6, 8, {0.5, 0.5, 0.5}, 0.4);
  OctreeBasedCD collisions;
  const GeometryId vertices = addMesh(collisions, inner), body = addMesh(collisions, outer);
  const std::size_t count = testing::insideVertices(collisions, vertices, body).size();
  EXPECT_EQ(count, inner.positions.size());
  std::vector<std::uint32_t> all(inner.triangles.size());
  for (std::uint32_t t = 0; t < all.size(); ++t) all[t] = t;
  collisions.setDisabledElements(vertices, all);
  EXPECT_EQ(testing::insideVertices(collisions, vertices, body).size(), count);
}

TEST(GeometryAccess, ShapesHaveNoVertices) {
  OctreeBasedCD collisions;
  const Mesh ball = sphere(6, 8, {0.5, 0.5, 0.5}, 0.4);
  const GeometryId shape = collisions.addAnalyticalGeometry(Box{{0.5, 0.5, 0.5}, {0.1, 0.1, 0.1}}),
                   body = addMesh(collisions, ball);
  const auto refuse = [&](auto&& call) {
    expectRefused(ErrorCode::UnsupportedMethod, "geometry 0 is a shape, which has no vertices",
                  call);
  };
  refuse([&] { (void)testing::insideVertices(collisions, shape, body); });
  refuse([&] { (void)PenetrationTracker(shape, body).update(collisions.queries()); });
  refuse([&] {
    const Positions corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const std::vector<Tetrahedron> one{{0, 1, 2, 3}};
    (void)testing::embeddedVertices(collisions, shape, collisions.addTetrahedralMesh(corners, one));
  });
}

}  // namespace
}  // namespace palpate::testing
