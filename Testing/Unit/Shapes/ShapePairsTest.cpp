#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Common/StepBodies.h"
#include "Common/SupportedMethods.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

// Analytical shapes with each other. A separating direction bounds their distance from below.
// Points of both shapes bound it from above where they are apart. Where they overlap, every other
// direction does.

namespace palpate::testing {
namespace {

constexpr double kFar = 100;

std::optional<ShapeShapeContact> answer(const PlacedShape& a, const PlacedShape& b,
                                        Engine engine = Engine::Octree, double thickness = kFar) {
  const auto asBody = [](const PlacedShape& shape) {
    const Pose pose{shape.rotation, shape.translation};
    return shapeOf("shape", shape.geometry, pose, pose);
  };
  const CollisionData data =
      stepOf(settingsOf(engine), asBody(a), asBody(b), {Method::Proximity, thickness});
  EXPECT_EQ(data.shape().size() + data.vertexTriangle().size() + data.edgeEdge().size(), 0u);
  if (data.shapeShape().empty()) return {};
  EXPECT_EQ(data.shapeShape().size(), 1u);
  return data.shapeShape()[0];
}

bool isPlane(const PlacedShape& shape) { return std::holds_alternative<Plane>(shape.geometry); }
/// Pairs whose normals and depths Docs/Shapes.md calls less accurate.
bool isRound(const PlacedShape& a, const PlacedShape& b) {
  return !isPlane(a) && !isPlane(b) &&
         (std::holds_alternative<Cylinder>(a.geometry) ||
          std::holds_alternative<Cylinder>(b.geometry));
}

bool holds(const PlacedShape& shape, const Vector3d& x, const std::vector<Vector3d>& directions,
           double slack) {
  for (const Vector3d& m : directions)
    if (!(m.dot(x) <= reachOf(shape, m) + slack)) return false;
  return true;
}

std::vector<Vector3d> someDirections(Random& random, int count) {
  std::vector<Vector3d> all;
  for (int i = 0; i < count; ++i) all.push_back(randomPoint(random, -1, 1).normalized());
  return all;
}

/// scale: L, of the shapes and of the gap between them. rounding: how much longer than the shortest
/// the penetration may be where cylinders overlap, relative to the scale.
void expectDistance(Random& random, const PlacedShape& a, const PlacedShape& b,
                    const ShapeShapeContact& c, double scale, double rounding = 1e-6) {
  const double slack = 2e-13 * scale;
  const double most = isRound(a, b) && c.distance < 0 ? rounding * scale : slack;
  EXPECT_NEAR(c.normal.norm(), 1, 1e-13);
  EXPECT_LE((c.pointA - c.pointB - c.distance * c.normal).norm(), most);
  EXPECT_NEAR(apartAlong(a, b, c.normal), c.distance,
              isRound(a, b) && c.distance > 0 ? 1e-7 * scale : slack)
      << "the normal does not part them so";
  const std::vector<Vector3d> facets = facetDirections(a, b);
  std::vector<Vector3d> some = someDirections(random, 60);
  for (const double size : {1e-1, 1e-2, 1e-4, 1e-6})  // near the normal, for curved ones
    for (int i = 0; i < 10; ++i)
      some.push_back((c.normal + size * randomPoint(random, -1, 1)).normalized());
  for (const std::vector<Vector3d>& directions : {facets, some}) {
    EXPECT_TRUE(holds(a, c.pointA, directions, slack));
    EXPECT_TRUE(holds(b, c.pointB, directions, slack));
    if (c.distance > 0 && !isPlane(a) && !isPlane(b)) continue;  // the points are a bound
    for (const Vector3d& m : directions)
      EXPECT_LE(apartAlong(a, b, m), c.distance + most) << "another direction parts them sooner";
  }
}

void expectPair(Random& random, const PlacedShape& a, const PlacedShape& b, double scale,
                double rounding = 1e-6) {
  const auto found = answer(a, b);
  ASSERT_TRUE(found);
  expectDistance(random, a, b, *found, scale, rounding);
  EXPECT_TRUE(answer(a, b, Engine::BruteForce) == found);
  const auto back = answer(b, a);
  EXPECT_EQ(back->distance, found->distance);
  EXPECT_EQ(back->normal, -found->normal);
  EXPECT_EQ(back->pointA, found->pointB);
  EXPECT_EQ(back->pointB, found->pointA);
}

TEST(ShapePairs, MatchTheDefinition) {
  Random random(1);
  std::size_t apart = 0, overlapping = 0;
  for (int run = 0; run < casesOf(12); ++run) {
    const std::vector<AnalyticalGeometry> all = shapesOfEveryKind(random);
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        const PlacedShape a{all[i], randomTurn(random), randomPoint(random, -.3, .3)},
            b{all[j], randomTurn(random), randomPoint(random, -.3, .3)};
        if (isPlane(a) && isPlane(b)) continue;
        SCOPED_TRACE("kinds " + std::to_string(i) + " and " + std::to_string(j));
        expectPair(random, a, b, 1);
        const double distance = answer(a, b)->distance;
        ++(distance > 0 ? apart : overlapping);
        // After a shift by its depth and a little more, the distance is that little.
        const ShapeShapeContact c = *answer(a, b);
        PlacedShape moved = a;
        moved.translation += (0.01 - c.distance) * c.normal;
        EXPECT_NEAR(answer(moved, b)->distance, 0.01, 1e-13);
        const Matrix3d turn = randomTurn(random);
        const Vector3d shift = randomPoint(random, -3, 3);
        const auto there = answer({a.geometry, turn * a.rotation, turn * a.translation + shift},
                                  {b.geometry, turn * b.rotation, turn * b.translation + shift});
        EXPECT_NEAR(there->distance, c.distance, isRound(a, b) && c.distance < 0 ? 1e-8 : 1e-13);
      }
  }
  EXPECT_GE(apart, leastOf(300));
  EXPECT_GE(overlapping, leastOf(300));
}

/// Shapes that are parallel, touching or in one plane.
TEST(ShapePairs, DegenerateShapesMatchTheDefinition) {
  Random random(2);
  const std::vector<AnalyticalGeometry> all = degenerateShapes();
  std::size_t number = 0;
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j)
      for (int run = 0; run < 6; ++run) {
        if (isLeftOut(number++)) continue;
        const auto grid = [&] { return static_cast<double>(random() % 5) - 2; };
        const double x = grid(), y = grid(), z = run < 3 ? 0 : grid();
        const PlacedShape a{all[i]},
            b{all[j], Matrix3d::Identity(), run == 0 ? Vector3d(0, 0, 0) : Vector3d(x, y, z)};
        if (isPlane(a) && isPlane(b)) continue;
        if (i == j && b.translation.isZero()) continue;  // exchanged, the contact is the same
        SCOPED_TRACE("kinds " + std::to_string(i) + " and " + std::to_string(j) + " at " +
                     std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z));
        expectPair(random, a, b, 4, 1e-3);
      }
}

TEST(ShapePairs, MatchHandComputedValues) {
  const Vector3d zero = Vector3d::Zero();
  const Box table{{0, 0, 0}, {2, 2, 1}};
  struct Row {
    AnalyticalGeometry a, b;
    double distance;
    std::optional<Vector3d> pointA{}, pointB{};
  };
  for (const Row& row : {
           Row{Sphere{{0, 0, 3}, 1}, Sphere{{0, 0, 0}, 1}, 1, Vector3d(0, 0, 2), Vector3d(0, 0, 1)},
           Row{Capsule{{-1, 0, 1}, {1, 0, 1}, 1}, Plane{}, 0, {}, zero},  // in the middle
           Row{Box{{0, 0, 0.5}, {1, 1, 1}}, Plane{}, -0.5, Vector3d(0, 0, -0.5)},
           Row{Box{{0, 0, 1.75}, {1, 1, 1}}, table, -0.25},
           Row{Cylinder{{0, 0, 2}, {0, 0, 4}, 1}, table, 1},
       }) {
    SCOPED_TRACE(row.a.index());
    const ShapeShapeContact c = *answer({row.a}, {row.b});
    EXPECT_NEAR(c.distance, row.distance, 1e-15);
    EXPECT_EQ(c.normal, Vector3d::UnitZ());
    EXPECT_EQ(c.pointA, row.pointA.value_or(c.pointA));
    EXPECT_EQ(c.pointB, row.pointB.value_or(c.pointB));
  }
  // Out sideways or upwards.
  EXPECT_NEAR(answer({Capsule{{0, 0, -2}, {0, 0, 1}, 0.25}}, {table})->distance, -2.25, 1e-14);
}

TEST(ShapePairs, BadInputThrowsErrorsThatNameIt) {
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const GeometryId box = collisions.addAnalyticalGeometry(Box{{0, 0, 0}, {1, 1, 1}}),
                   plane = collisions.addAnalyticalGeometry(Plane{}),
                   other = collisions.addAnalyticalGeometry(Plane{{0, 0, 1}, {1, 0, 0}, true});
  const auto refuse = [&](GeometryId a, GeometryId b, Method method, const std::string& words) {
    expectRefused(ErrorCode::UnsupportedMethod, words, [&] {
      collisions.addCollisionPair(a, b, {method, 1.0});
    });
  };
  refuse(box, box, Method::Proximity, "pair (0, 0): a shape cannot be tested against itself");
  refuse(plane, other, Method::Proximity, "pair (1, 2): a pair of two planes is not supported");
  refuse(plane, other, Method::Continuous, "pair (1, 2): a pair of two planes is not supported");
  refuse(box, plane, Method::Intersection,
         "a shape and a shape; use Auto, Proximity or Continuous");
}

/// Unsupported shapes are refused. Spheres, and pairs of capsules, may have any size.
TEST(ShapePairs, SizesThatDifferTooMuchAreRefused) {
  for (const double length : {1e14, 1e155, 1e300}) {
    OctreeBasedCD collisions;
    const GeometryId box = collisions.addAnalyticalGeometry(Box{{0, 0, 0}, {length, length, 1}}),
                     rod = collisions.addAnalyticalGeometry(Capsule{{0, 0, 2}, {1, 0, 2}, 0.25}),
                     ball = collisions.addAnalyticalGeometry(Sphere{{0, 0, 2}, 0.25}),
                     other = collisions.addAnalyticalGeometry(
                         Capsule{{-length, 0, 0}, {length, 0, 0}, 0.25});
    for (const Method method : supportedMethods(GeometryType::Shape, GeometryType::Shape))
      expectRefused(ErrorCode::UnsupportedMethod, "ratio must be at most 2^40", [&] {
        collisions.addCollisionPair(box, rod, {method, 1});
      });
    collisions.addCollisionPair(box, ball, {Method::Proximity, 1});
    collisions.addCollisionPair(other, rod, {Method::Proximity, 2});
    collisions.detectCollision();
    ASSERT_EQ(collisions.collisionData(box, ball).shapeShape().size(), 1u);
    EXPECT_NEAR(collisions.collisionData(box, ball).shapeShape()[0].distance, 0.75, 1e-12);
    ASSERT_EQ(collisions.collisionData(other, rod).shapeShape().size(), 1u);
    EXPECT_NEAR(collisions.collisionData(other, rod).shapeShape()[0].distance, 1.5, 1e-12);
  }
}

/// A regression: among planes of almost equal depth, the points were those of a face beside the
/// foot, and off by up to half of a box.
TEST(ShapePairs, NearlyAlignedBoxesAndHullsMatchTheDefinition) {
  Random random(19);
  const auto isEven = [&] { return random() >> 63 == 0; };
  const auto half = [&] { return std::ldexp(0.25, static_cast<int>(random() >> 62)); };
  const auto solid = [](bool isBox, const Vector3d& size) -> AnalyticalGeometry {
    if (isBox) return Box{Vector3d::Zero(), size};
    ConvexHull hull;
    for (int i = 0; i < 8; ++i)
      hull.points.push_back(
          size.cwiseProduct(Vector3d(i & 1 ? 1.0 : -1.0, i & 2 ? 1.0 : -1.0, i & 4 ? 1.0 : -1.0)));
    return hull;
  };
  const auto turned = [](double angle, const Vector3d& axis) {
    return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
  };
  for (const bool isBox : {false, true})  // a case that a user met: off by 0.157
    for (const bool isOnBox : {false, true})
      expectPair(random, PlacedShape{solid(isOnBox, Vector3d(0.5, 0.5, 2))},
                 PlacedShape{solid(isBox, Vector3d::Constant(0.25)),
                             turned(1e-6, Vector3d(-1, 0, 1)), Vector3d(0.1, 0.1, 2.249999)},
                 4.0);
  for (int run = 0; run < casesOf(400); ++run) {
    SCOPED_TRACE(run);
    std::array<Vector3d, 2> sizes;
    for (Vector3d& size : sizes)
      for (double& x : size) x = half();
    const double tilt = std::pow(10.0, uniform(random, -14.0, -5.0));
    const Vector3d axis = isEven() ? Vector3d(-1, 0, 1) : randomPoint(random, -1, 1);
    const double overlap = isEven() ? tilt : uniform(random, 0.0, 1e-3);
    const PlacedShape a{solid(isEven(), sizes[0])},
        b{solid(isEven(), sizes[1]),
          turned(tilt, axis),
          {0.1 * half(), 0.1, sizes[0][2] + sizes[1][2] - overlap}};
    expectPair(random, a, b, 4.0);
  }
}

}  // namespace
}  // namespace palpate::testing
