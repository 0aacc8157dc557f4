#include <palpate/FclEngine.h>

#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"
#include "Common/ShapeTruth.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace palpate::testing {
namespace {

std::vector<ElementPair> pairsOf(const CollisionData& data) {
  return {data.intersectingTriangles().begin(), data.intersectingTriangles().end()};
}

/// The same calls to both engines.
class Both {
 public:
  template <class F>
  void each(F&& f) {
    f(octree);
    f(fcl);
  }
  GeometryId add(const Mesh& mesh) {
    const GeometryId id = octree.addTriangleMesh(mesh.positions, mesh.triangles);
    EXPECT_EQ(fcl.addTriangleMesh(mesh.positions, mesh.triangles), id);
    return id;
  }
  /// Detects, expects the same pairs, and returns how many.
  std::size_t expectSame(GeometryId a, GeometryId b) {
    each([](auto& engine) { engine.detectCollision(); });
    const std::vector<ElementPair> pairs = pairsOf(octree.collisionData(a, b));
    EXPECT_EQ(pairsOf(fcl.collisionData(a, b)), pairs);
    return pairs.size();
  }
  OctreeBasedCD octree;
  FclEngine fcl;
};

TEST(FclEngine, MeshIntersectionsMatchOctreeBasedCD) {
  Random random(1);
  Both both;
  Mesh sheets[] = {sheet(12, 0.5, 0), soup(random, 60, 0.2)};
  const GeometryId a = both.add(sheets[0]), b = both.add(sheets[1]);
  both.each([&](auto& engine) { engine.addCollisionPair(a, b, {Method::Intersection}); });
  std::size_t found = both.expectSame(a, b);
  for (int frame = 0; frame < 10; ++frame) {  // far, so that the boxes must follow
    for (Vector3d& p : sheets[0].positions) p += Vector3d(0.02, 0, 0.03 * (frame % 3));
    both.each([&](auto& engine) { engine.setPositions(a, sheets[0].positions); });
    found += both.expectSame(a, b);
  }
  for (int frame = 0; frame < 10; ++frame) {
    const Matrix3d turn = randomTurn(random);
    const Vector3d shift = randomPoint(random, -0.3, 0.3);
    both.each([&](auto& engine) { engine.setTransform(a, {turn, shift}); });
    found += both.expectSame(a, b);
  }
  const Mesh other = soup(random, 80, 0.2);
  both.each([&](auto& engine) { engine.setTriangles(b, other.positions, other.triangles); });
  found += both.expectSame(a, b);
  EXPECT_GT(found, 300u);
}

TEST(FclEngine, MeshesWithoutTrianglesHaveNoContacts) {
  FclEngine engine;
  const std::vector<Vector3d> positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const GeometryId a = engine.addTriangleMesh(positions, {}),
                   b = engine.addTriangleMesh(positions, std::vector<Triangle>{{0, 1, 2}});
  engine.addCollisionPair(a, b, {Method::Intersection});
  engine.setPositions(a, positions);
  engine.detectCollision();
  EXPECT_TRUE(engine.collisionData(a, b).intersectingTriangles().empty());
  engine.setTriangles(a, positions, std::vector<Triangle>{{0, 1, 2}});
  engine.detectCollision();
  EXPECT_EQ(engine.collisionData(a, b).intersectingTriangles().size(), 1u);
  EXPECT_FALSE(engine.collisionData(a, b).validity().trusted);
}

TEST(FclEngine, ShapesMatchHandComputedValues) {
  const auto only = [](const AnalyticalGeometry& a, const AnalyticalGeometry& b, double thickness) {
    FclEngine engine;
    const GeometryId first = engine.addAnalyticalGeometry(a),
                     second = engine.addAnalyticalGeometry(b);
    engine.setTransform(second, {.translation = {0, 0, -1}});
    engine.addCollisionPair(first, second, {Method::Proximity, thickness});
    engine.detectCollision();
    const auto contacts = engine.collisionData(first, second).shapeShape();
    return std::vector<ShapeShapeContact>(contacts.begin(), contacts.end());
  };
  const auto expect = [&](const AnalyticalGeometry& a, const AnalyticalGeometry& b,
                          double thickness, double distance) {
    const auto contacts = only(a, b, thickness);
    ASSERT_EQ(contacts.size(), 1u);
    EXPECT_NEAR(contacts[0].distance, distance, 1e-6);
    EXPECT_LT((contacts[0].normal - Vector3d::UnitZ()).norm(), 1e-6);
    EXPECT_LT((contacts[0].pointA - contacts[0].pointB - distance * Vector3d::UnitZ()).norm(),
              1e-6);
  };
  const Sphere ball{{0, 0, 2}, 1};
  expect(ball, Sphere{{0, 0, 0}, 1}, 2, 1);
  expect(ball, Box{{0, 0, 0}, {1, 1, 1}}, 2, 1);
  expect(ball, Capsule{{-1, 0, 0}, {1, 0, 0}, 0.5}, 2, 1.5);
  expect(ball, Cylinder{{-1, 0, 0}, {1, 0, 0}, 0.5}, 2, 1.5);
  expect(ball, Sphere{{0, 0, 1.5}, 1}, 0, -0.5);
  expect(ball, Plane{{0, 0, 2.25}, {0, 0, 3}}, 0, -0.25);
  expect(Box{{0, 0, 2}, {1, 1, 1}}, Box{{0, 0, 1.25}, {3, 3, 1}}, 0, -0.25);
  EXPECT_TRUE(only(ball, Sphere{{0, 0, 0}, 1}, 0.5).empty());
  EXPECT_TRUE(only(ball, Plane{}, 0).empty());
}

TEST(FclEngine, UnsupportedPairsThrowErrorsThatNameThem) {
  FclEngine engine;
  const std::vector<Vector3d> positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<Triangle> triangles{{0, 1, 2}};
  const GeometryId mesh = engine.addTriangleMesh(positions, triangles),
                   other = engine.addTriangleMesh(positions, triangles),
                   box = engine.addAnalyticalGeometry(Box{{0, 0, 0}, {1, 1, 1}}),
                   hull = engine.addAnalyticalGeometry(ConvexHull{positions}),
                   plane = engine.addAnalyticalGeometry(Plane{}),
                   twoSided = engine.addAnalyticalGeometry(Plane{{0, 0, 0}, {0, 0, 1}, true});
  const auto refuse = [&](GeometryId a, GeometryId b, const PairSettings& settings,
                          const std::string& words) {
    expectRefused(ErrorCode::UnsupportedMethod, words,
                  [&] { engine.addCollisionPair(a, b, settings); });
  };
  for (const Method method : {Method::Auto, Method::Proximity, Method::Continuous})
    refuse(mesh, other, {method, 0.1},
           "pair (0, 1): FCL supports triangle meshes by Method::Inter");
  refuse(mesh, mesh, {Method::Intersection},
         "pair (0, 0): FCL does not support a geometry with itself");
  refuse(box, mesh, {Method::Proximity, 0.1}, "pair (2, 0): FCL supports two triangle meshes");
  refuse(hull, twoSided, {Method::Proximity}, "pair (3, 5): FCL does not support a hull with");
  refuse(twoSided, hull, {Method::Proximity}, "pair (5, 3): FCL does not support a hull with");
  refuse(box, plane, {Method::Proximity, 0.1}, "the thickness must be 0");
  refuse(box, hull, {Method::Proximity, 0.1}, "the thickness must be 0");
  refuse(plane, twoSided, {Method::Proximity}, "a pair of two planes is not supported");
  for (const Method method : {Method::Auto, Method::Intersection, Method::Continuous})
    refuse(box, hull, {method}, "pair (2, 3): FCL supports shapes by Method::Proximity only");
  EXPECT_TRUE(engine.pairs().empty());
}

TEST(FclEngine, BadInputThrowsTheErrorsOfOctreeBasedCD) {
  FclEngine engine;
  const auto refuse = [](ErrorCode code, auto&& call) { expectRefused(code, "", call); };
  std::vector<Vector3d> positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<Triangle> triangles{{0, 1, 2}};
  const GeometryId mesh = engine.addTriangleMesh(positions, triangles),
                   other = engine.addTriangleMesh(positions, triangles),
                   ball = engine.addAnalyticalGeometry(Sphere{{0, 0, 0}, 1});
  engine.addCollisionPair(mesh, other, {Method::Intersection});
  engine.detectCollision();
  positions[1].y() = std::numeric_limits<double>::quiet_NaN();
  refuse(ErrorCode::NonFinitePosition, [&] { engine.setPositions(mesh, positions); });
  refuse(ErrorCode::IndexOutOfRange, [&] { engine.addTriangleMesh({}, triangles); });
  refuse(ErrorCode::InvalidShape, [&] { engine.addAnalyticalGeometry(Sphere{{0, 0, 0}, -1}); });
  refuse(ErrorCode::InvalidTransform, [&] {
    engine.setTransform(ball, {2 * Matrix3d::Identity(), {0, 0, 0}});
  });
  EXPECT_THROW(engine.setPositions(ball, positions), Error);
  refuse(ErrorCode::UnknownPair, [&] { engine.collisionData(other, mesh); });
  EXPECT_EQ(engine.collisionData(mesh, other).intersectingTriangles().size(), 1u);
  EXPECT_EQ(engine.pairs().size(), 1u);
  engine.removeCollisionPair(other, mesh);
  refuse(ErrorCode::UnknownPair, [&] { engine.collisionData(mesh, other); });
  engine.addCollisionPair(mesh, other, {Method::Intersection});
  refuse(ErrorCode::NotAvailable, [&] { engine.collisionData(mesh, other); });
  engine.removeGeometry(other);
  refuse(ErrorCode::UnknownGeometry,
         [&] { engine.addCollisionPair(mesh, other, {Method::Intersection}); });
  engine.detectCollision();
  FclEngine moved = std::move(engine);
  EXPECT_TRUE(moved.pairs().empty());
}

}  // namespace
}  // namespace palpate::testing
